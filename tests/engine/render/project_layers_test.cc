#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <new>
#include <utility>
#include <vector>

#include "engine/render/splats.h"
#include "tests/engine/render/gradients.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

/// 19 x 14 tiles: groups of 3 x 3 at the right and the lower edge are not whole.
scene::Camera wide_camera() { return off_centre_camera(300, 220); }

/// Some 600 Gaussians in view, as evenly spread over n rows as can be; nobody sees the others.
scene::GaussianCloud cloud_of(std::size_t n) {
  auto cloud = cloud_in_view(n, 8);
  for (std::size_t row = 0; row < n; ++row)
    if (row % (n / 600) != 0) cloud.opacity_logit[row] = -30;
  return cloud;
}

/// Projected, sorted and listed, with some rows changeable.
struct Binned {
  std::vector<std::uint32_t> rows;
  TileGrid grid;
  ForwardBuffers buffers;

  Binned(const Layers& layers, std::vector<std::uint32_t> changeable, const std::vector<std::uint8_t>& wanted = {})
      : rows(std::move(changeable)) {
    const auto camera = wide_camera();
    grid = {.columns = tile_columns(camera.width),
            .rows = tile_rows(camera.height),
            .pixels = {0, 0, camera.width, camera.height},
            .wanted = wanted};
    project(layers, view_params<float>(camera), -1, grid.pixels, rows, buffers);
    sort_by_depth(buffers);
    bin(grid, buffers);
  }
  /// Where a row is in the list of those that may change; rows.size() if it is not.
  [[nodiscard]] std::size_t slot_of(std::uint32_t row) const {
    const auto at = std::lower_bound(rows.begin(), rows.end(), row);
    return at != rows.end() && *at == row ? std::size_t(at - rows.begin()) : rows.size();
  }
};

std::vector<std::uint32_t> every_third(std::size_t n) {
  std::vector<std::uint32_t> rows;
  for (std::size_t row = 0; row < n; row += 3) rows.push_back(std::uint32_t(row));
  return rows;
}

/// Every changeable splat's pair with every group that it is listed in has a number of its own, and a row that is seen
/// has as many numbers as its box meets groups.
void expect_numbered(const Binned& binned) {
  const ForwardBuffers& buffers = binned.buffers;
  const int tile_group = buffers.tile_group;
  std::map<std::uint32_t, std::pair<std::uint32_t, int>> owner;  // of a number: splat and group
  for (int tile = 0; tile < binned.grid.columns * binned.grid.rows; ++tile) {
    const int column = tile % binned.grid.columns / tile_group, row = tile / binned.grid.columns / tile_group;
    for (std::uint32_t e = buffers.tile_begin[std::size_t(tile)]; e < buffers.tile_begin[std::size_t(tile) + 1]; ++e) {
      const std::uint32_t splat = buffers.entries[e];
      const PairsOfSplat& of = buffers.splats[splat].pairs;
      const std::size_t slot = binned.slot_of(buffers.splats[splat].row);
      ASSERT_EQ(of.any(), slot < binned.rows.size());
      if (!of.any()) continue;
      const std::uint32_t number =
          buffers.pairs_before[splat / project_block] + of.number(std::uint32_t(column), std::uint32_t(row));
      ASSERT_GE(number, buffers.first_pair[slot]);
      ASSERT_LT(number, buffers.first_pair[slot + 1]);
      const std::pair here{splat, row * 1000 + column};
      ASSERT_EQ(owner.try_emplace(number, here).first->second, here) << "two pairs have one number";
    }
  }
  EXPECT_GT(owner.size(), 50u);
  std::vector<std::uint32_t> expected(binned.rows.size(), 0);
  for (const DepthKey& keyed : buffers.by_depth) {
    const std::size_t slot = binned.slot_of(buffers.splats[keyed.splat].row);
    if (slot == binned.rows.size()) continue;
    const TileBox& box = buffers.splats[keyed.splat].box;
    const int columns = box.last_column / tile_group - box.first_column / tile_group + 1,
              rows = box.last_row / tile_group - box.first_row / tile_group + 1;
    expected[slot] = std::uint32_t(columns * rows);
  }
  EXPECT_GT(std::count(expected.begin(), expected.end(), 0u), 50);
  for (std::size_t r = 0; r < binned.rows.size(); ++r)
    ASSERT_EQ(buffers.first_pair[r + 1] - buffers.first_pair[r], expected[r]) << r;
}

TEST(PairNumbers, FewRowsHaveAPairPerTileAndManyOnePerGroupOfTiles) {
  const auto some = cloud_of(3000), more = cloud_of(60'000);  // of several blocks
  const Binned few(some, every_third(some.size())), many(more, every_third(more.size()));
  EXPECT_EQ(few.buffers.tile_group, 1);
  EXPECT_EQ(many.buffers.tile_group, 3);
  expect_numbered(few);
  expect_numbered(many);
  EXPECT_LT(many.buffers.first_pair[many.rows.size()], few.buffers.first_pair[few.rows.size()] / 2);
}

TEST(PairNumbers, AreThoseOfAllTilesWhereSomeAreWanted) {
  std::vector<std::uint8_t> wanted(19 * 14, 0);
  for (const int tile : {0, 5, 6, 18, 60, 61, 62, 80, 81, 100, 101, 119, 120, 121, 140, 246})
    wanted[std::size_t(tile)] = 1;
  const auto some = cloud_of(3000), more = cloud_of(60'000);
  expect_numbered(Binned(some, every_third(some.size()), wanted));
  expect_numbered(Binned(more, every_third(more.size()), wanted));
}

TEST(PairNumbers, GoThroughAllLayers) {
  const auto base = cloud_of(1800), top = cloud_of(1200);
  Layers layers(base);
  layers.top = &top;
  const Binned binned(layers, every_third(layers.size()));
  expect_numbered(binned);
  const auto of_top =
      std::size_t(std::lower_bound(binned.rows.begin(), binned.rows.end(), base.size()) - binned.rows.begin());
  EXPECT_GT(binned.buffers.first_pair[of_top], 100u);
  EXPECT_GT(binned.buffers.first_pair[binned.rows.size()], binned.buffers.first_pair[of_top] + 100);
}

TEST(PairNumbers, ThereAreNoneWhereNothingMayChange) {
  const auto cloud = cloud_of(1800);
  const Binned binned(cloud, {});
  ASSERT_GT(binned.buffers.by_depth.size(), 100u);
  EXPECT_EQ(binned.buffers.first_pair[0], 0u);
  for (const DepthKey& keyed : binned.buffers.by_depth) EXPECT_FALSE(binned.buffers.splats[keyed.splat].pairs.any());
}

TEST(PairNumbers, EndAtThirtyTwoBitsAndSayThatMemoryDoes) {
  // Gaussians that cover each of a million tiles.
  const scene::Camera camera = off_centre_camera(16384, 16384);
  const auto project_all = [](const scene::GaussianCloud& cloud, const scene::Camera& seen_by,
                              ForwardBuffers& buffers) {
    project(cloud, view_params<float>(seen_by), -1, {0, 0, seen_by.width, seen_by.height}, all_rows(cloud), buffers);
  };
  const auto covering = [](std::size_t n) {
    auto cloud = cloud_in_view(n, 3, 0);
    for (std::size_t row = 0; row < n; ++row) {
      cloud.mean.set(row, {0, 0, 2}), cloud.log_scale.set(row, {6, 6, 6});
      cloud.opacity_logit[row] = 4;
    }
    return cloud;
  };
  ForwardBuffers buffers;
  project_all(covering(4095), camera, buffers);
  EXPECT_EQ(buffers.first_pair[4095], 4095u << 20);
  EXPECT_EQ(buffers.first_pair[4094], 4094u << 20);
  EXPECT_THROW(project_all(covering(4096), camera, buffers), std::bad_alloc);

  const auto small = cloud_of(1800);
  ForwardBuffers fresh;
  project_all(small, wide_camera(), fresh), project_all(small, wide_camera(), buffers);
  for (std::size_t row = 0; row <= small.size(); ++row) ASSERT_EQ(buffers.first_pair[row], fresh.first_pair[row]);
}

}  // namespace
}  // namespace engine::render
