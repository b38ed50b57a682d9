#include "engine/select/thinning.h"

#include <algorithm>
#include <array>

#include "engine/core/rng.h"

namespace engine::select {
namespace {

/// A number by chance, and the row, so that no two are alike.
std::uint64_t drawn(std::uint32_t row) {
  constexpr std::array<std::uint32_t, 2> thinning{0x7468696e, 0};
  return std::uint64_t(philox4x32({row, 0, 0, 0}, thinning)[0]) << 32 | row;
}

}  // namespace

Thinned thin_out(std::span<const std::uint32_t> rows, std::size_t most) {
  if (rows.size() <= most) return {{rows.begin(), rows.end()}, {}};
  std::vector<std::uint64_t> draws(rows.size());
  std::ranges::transform(rows, draws.begin(), drawn);
  const auto first_other = draws.begin() + std::ptrdiff_t(most);
  std::ranges::nth_element(draws, first_other);
  const std::uint64_t limit = *first_other;
  Thinned out;
  for (const std::uint32_t row : rows) (drawn(row) < limit ? out.kept : out.others).push_back(row);
  return out;
}

}  // namespace engine::select
