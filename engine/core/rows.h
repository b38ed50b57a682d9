// Rows by number, of columns that say something of each row.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <ranges>
#include <span>
#include <vector>

namespace engine {

/// The rows of whose value `is_wanted` holds, ascending.
///   values  [N], a value per row
template <std::ranges::sized_range Values, class Wanted>
[[nodiscard]] std::vector<std::uint32_t> rows_where(const Values& values, Wanted&& is_wanted) {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; const auto& value : values) {
    if (is_wanted(value)) rows.push_back(row);
    ++row;
  }
  return rows;
}

/// The rows whose byte is not 0, ascending.
[[nodiscard]] inline std::vector<std::uint32_t> marked_rows(std::span<const std::uint8_t> marks) {
  return rows_where(marks, [](std::uint8_t mark) { return mark != 0; });
}

/// The rows of either list; both ascend, each row once.
[[nodiscard]] inline std::vector<std::uint32_t> united(std::span<const std::uint32_t> a,
                                                       std::span<const std::uint32_t> b) {
  std::vector<std::uint32_t> rows;
  std::ranges::set_union(a, b, std::back_inserter(rows));
  return rows;
}

}  // namespace engine
