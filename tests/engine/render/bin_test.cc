#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/splats.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

/// Rows of splats with these depths after sort_by_depth(). Projection is taken to have left half of every block.
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
    for (const std::size_t n : {0, 1, 2, 1000, 20'000, 300'000}) {  // of no block, one, several, and larger ones
      SCOPED_TRACE(std::string(name) + ", " + std::to_string(n));
      std::vector<float> depths(n);
      for (std::size_t i = 0; i < n; ++i) depths[i] = depth(i);
      ASSERT_EQ(sorted_rows(depths), expected_rows(depths));
    }
}

/// 19 x 14 tiles: groups of 3 x 3 at the right and the lower edge are not whole.
scene::Camera wide_camera() { return off_centre_camera(300, 220); }

constexpr std::size_t many_rows = 20'000;

/// Binned with every third row changeable, and as many more that are nowhere as make up `rows`.
struct Binned {
  std::size_t rows;                       ///< That may change.
  std::vector<std::int32_t> slot_of_row;  ///< Of all.
  TileGrid grid;
  ForwardBuffers buffers;

  explicit Binned(std::size_t at_least, const std::vector<std::uint8_t>& wanted = {}) {
    const auto cloud = cloud_in_view(600, 8);
    const auto camera = wide_camera();
    std::int32_t next = 0;
    for (std::size_t row = 0; row < cloud.size(); ++row) slot_of_row.push_back(row % 3 == 0 ? next++ : -1);
    rows = std::max(at_least, std::size_t(next));
    grid = {.columns = tile_columns(camera.width),
            .rows = tile_rows(camera.height),
            .pixels = {0, 0, camera.width, camera.height},
            .wanted = wanted};
    project(cloud, view_params<float>(camera), -1, {}, Culling::exact, grid.pixels, buffers);
    sort_by_depth(buffers);
    bin(grid, buffers, slot_of_row.data(), rows);
  }
};

/// Every splat's pair with every group that it is listed in has a number of its own, and a row has as many numbers as
/// its box meets groups, or none if no tile lists it.
void expect_numbered(const Binned& binned) {
  const ForwardBuffers& buffers = binned.buffers;
  const int tile_group = buffers.tile_group;
  std::map<std::uint32_t, std::pair<std::uint32_t, int>> owner;  // of a number: splat and group
  std::vector<bool> is_listed(buffers.count);
  for (int tile = 0; tile < binned.grid.columns * binned.grid.rows; ++tile) {
    const int column = tile % binned.grid.columns / tile_group, row = tile / binned.grid.columns / tile_group;
    for (std::uint32_t e = buffers.tile_begin[std::size_t(tile)]; e < buffers.tile_begin[std::size_t(tile) + 1]; ++e) {
      const std::uint32_t splat = buffers.entries[e];
      is_listed[splat] = true;
      const PairsOfSplat& of = buffers.pairs_of_splat[splat];
      const std::int32_t slot = binned.slot_of_row[buffers.splats[splat].row];
      ASSERT_EQ(of.any(), slot >= 0);
      if (!of.any()) continue;
      const std::uint32_t number = of.number(std::uint32_t(column), std::uint32_t(row));
      ASSERT_GE(number, buffers.first_pair[std::size_t(slot)]);
      ASSERT_LT(number, buffers.first_pair[std::size_t(slot) + 1]);
      const std::pair here{splat, row * 1000 + column};
      ASSERT_EQ(owner.try_emplace(number, here).first->second, here) << "two pairs have one number";
    }
  }
  EXPECT_GT(owner.size(), 50u);
  std::vector<std::uint32_t> expected(binned.rows, 0);
  std::size_t unlisted = 0;
  for (std::size_t i = 0; i < buffers.count; ++i) {
    const std::int32_t slot = binned.slot_of_row[buffers.splats[i].row];
    if (slot < 0) continue;
    const TileBox& box = buffers.boxes[i];
    const int columns = box.last_column / tile_group - box.first_column / tile_group + 1,
              rows = box.last_row / tile_group - box.first_row / tile_group + 1;
    expected[std::size_t(slot)] = is_listed[i] ? std::uint32_t(columns * rows) : 0;
    if (!is_listed[i]) {
      ++unlisted;
      EXPECT_FALSE(buffers.pairs_of_splat[i].any());
    }
  }
  for (std::size_t r = 0; r < binned.rows; ++r)
    EXPECT_EQ(buffers.first_pair[r + 1] - buffers.first_pair[r], expected[r]) << r;
  if (!binned.grid.wanted.empty()) {
    EXPECT_GT(unlisted, 10u);
  }
}

TEST(Bin, FewRowsHaveAPairPerTileAndManyOnePerGroupOfTiles) {
  const Binned few(0), many(many_rows);
  EXPECT_EQ(few.buffers.tile_group, 1);
  EXPECT_EQ(many.buffers.tile_group, 3);
  expect_numbered(few);
  expect_numbered(many);
  EXPECT_LT(many.buffers.first_pair[many.rows], few.buffers.first_pair[few.rows] / 2);
}

TEST(Bin, NumbersThePairsOfWantedTilesAlike) {
  std::vector<std::uint8_t> wanted(19 * 14, 0);
  for (const int tile : {0, 5, 6, 18, 60, 61, 62, 80, 81, 100, 101, 119, 120, 121, 140, 246})
    wanted[std::size_t(tile)] = 1;
  expect_numbered(Binned(0, wanted));
  expect_numbered(Binned(many_rows, wanted));
}

TEST(Bin, WithoutSlotsAllRowsMayChange) {
  Binned some(0);
  bin(some.grid, some.buffers, nullptr, some.slot_of_row.size());
  for (std::size_t row = 0; row < some.slot_of_row.size(); ++row) some.slot_of_row[row] = std::int32_t(row);
  some.rows = some.slot_of_row.size();
  expect_numbered(some);
}

}  // namespace
}  // namespace engine::render
