#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

/// Rows of splats with these depths after sort_by_depth(), every other row having been dropped by projection.
std::vector<std::uint32_t> sorted_rows(const std::vector<float>& depths) {
  const std::size_t kept_per_block = project_block / 2;
  const std::size_t blocks = (depths.size() + kept_per_block - 1) / kept_per_block;
  ForwardBuffers buffers;
  Splat* const splats = buffers.projected.reserve(blocks * project_block);
  TileBox* const boxes = buffers.projected_boxes.reserve(blocks * project_block);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const std::size_t at = i / kept_per_block * project_block + i % kept_per_block;
    splats[at] = {}, boxes[at] = {};
    splats[at].depth = depths[i], splats[at].row = std::uint32_t(i);
  }
  for (std::size_t b = 0; b < blocks; ++b)
    buffers.block_sizes.push_back(std::min(kept_per_block, depths.size() - b * kept_per_block));
  sort_by_depth(buffers);
  EXPECT_EQ(buffers.count, depths.size());
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < buffers.count; ++i) rows.push_back(buffers.splats[i].row);
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
    for (const std::size_t n : {0, 1, 2, 1000, 20'000}) {  // of no block, one, and several
      SCOPED_TRACE(std::string(name) + ", " + std::to_string(n));
      std::vector<float> depths(n);
      for (std::size_t i = 0; i < n; ++i) depths[i] = depth(i);
      ASSERT_EQ(sorted_rows(depths), expected_rows(depths));
    }
}

}  // namespace
}  // namespace engine::render
