#include "engine/select/thinning.h"

#include <algorithm>
#include <array>
#include <span>

#include "engine/core/rng.h"

namespace engine::select {
namespace {

/// A number by chance, and the row, so that no two are alike.
std::uint64_t drawn(std::uint32_t row) {
  constexpr std::array<std::uint32_t, 2> thinning{0x7468696e, 0};
  return std::uint64_t(philox4x32({row, 0, 0, 0}, thinning)[0]) << 32 | row;
}

std::vector<std::uint32_t> rows_of(std::span<const std::uint64_t> draws) {
  std::vector<std::uint32_t> out(draws.size());
  std::ranges::transform(draws, out.begin(), [](std::uint64_t one) { return std::uint32_t(one); });
  std::ranges::sort(out);
  return out;
}

}  // namespace

std::vector<std::uint32_t> thin_out(std::vector<std::uint32_t>& rows, std::size_t most) {
  if (rows.size() <= most) return {};
  std::vector<std::uint64_t> draws(rows.size());
  std::ranges::transform(rows, draws.begin(), drawn);
  std::ranges::nth_element(draws, draws.begin() + std::ptrdiff_t(most));
  const std::span<const std::uint64_t> all = draws;
  rows = rows_of(all.first(most));
  return rows_of(all.subspan(most));
}

}  // namespace engine::select
