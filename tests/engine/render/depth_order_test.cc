#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

/// Rows of splats with these depths after sort_by_depth(). Projection is taken to have left half of every block, but
/// nothing of every third.
std::vector<std::uint32_t> sorted_rows(const std::vector<float>& depths) {
  ForwardBuffers buffers;
  std::vector<std::uint32_t> row_of_splat;
  std::vector<DepthKey> keys;
  for (std::size_t row = 0; row < depths.size();) {
    const std::size_t first = buffers.block_sizes.size() * project_block;
    keys.resize(first + project_block), row_of_splat.resize(first + project_block);
    std::size_t kept = 0;
    KeyRange range;
    if (buffers.block_sizes.size() % 3 != 1)
      for (; kept < project_block / 2 && row < depths.size(); ++kept, ++row) {
        const auto key = std::bit_cast<std::uint32_t>(depths[row]);
        keys[first + kept] = {key, std::uint32_t(first + kept)};
        range.extend({key, key});
        row_of_splat[first + kept] = std::uint32_t(row);
      }
    buffers.block_sizes.push_back(kept), buffers.key_ranges.push_back(range);
  }
  std::copy(keys.begin(), keys.end(), buffers.keys.reserve(keys.size()));
  sort_by_depth(buffers);
  EXPECT_EQ(buffers.by_depth.size(), depths.size());
  std::vector<std::uint32_t> rows;
  for (const DepthKey& keyed : buffers.by_depth) rows.push_back(row_of_splat[keyed.splat]);
  return rows;
}

std::vector<std::uint32_t> expected_rows(const std::vector<float>& depths) {
  std::vector<std::uint32_t> rows(depths.size());
  std::iota(rows.begin(), rows.end(), 0u);
  std::stable_sort(rows.begin(), rows.end(), [&](std::uint32_t a, std::uint32_t b) { return depths[a] < depths[b]; });
  return rows;
}

TEST(SortByDepth, OrdersByDepthAndEqualDepthsByRowWhateverTheirRange) {
  Rng rng(5);
  const std::vector<std::pair<const char*, std::function<float(std::size_t)>>> kinds = {
      {"of a room", [&](std::size_t) { return rng.uniform(0.2f, 12.0f); }},
      {"from the near plane to where nothing is shown",
       [&](std::size_t) { return std::pow(10.0f, rng.uniform(-2.0f, 18.0f)); }},
      {"all equal", [](std::size_t) { return 3.0f; }},
      {"two neighbours among floats", [](std::size_t i) { return i % 3 == 0 ? 3.0f : std::nextafter(3.0f, 4.0f); }},
      {"few, often", [&](std::size_t) { return std::floor(rng.uniform(1.0f, 9.0f)); }},
      {"descending", [](std::size_t i) { return 1e6f - float(i); }}};
  for (const auto& [name, depth] : kinds)
    for (const std::size_t n : {0, 1, 2, 1000, 20'000, 300'000}) {  // of no block, one, several, and larger ones
      SCOPED_TRACE(std::string(name) + ", " + std::to_string(n));
      std::vector<float> depths(n);
      for (std::size_t i = 0; i < n; ++i) depths[i] = depth(i);
      ASSERT_EQ(sorted_rows(depths), expected_rows(depths));
    }
}

}  // namespace
}  // namespace engine::render
