#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/forward.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr int columns = 20, rows = 12;

/// Of any size, shape and direction; half of them needles, some with their mean far outside the picture.
std::vector<Splat> random_splats(std::size_t n) {
  Rng rng(3);
  std::vector<Splat> splats(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = rng.uniform(0.0f, 3.15f), major = std::exp(rng.uniform(-0.6f, 5.5f));
    const double minor = i % 2 == 0 ? 0.55 : major * rng.uniform(0.2f, 1.0f);
    const double c = std::cos(angle), s = std::sin(angle), a = major * major, b = minor * minor;
    const double xy = (a - b) * c * s, yy = a * s * s + b * c * c;  // of the covariance
    const double to_sigmas = 0.84932180028801904;                   // see Splat
    Splat& splat = splats[i];
    splat.x = rng.uniform(-60.0f, columns * tile_size + 60.0f), splat.y = rng.uniform(-60.0f, rows * tile_size + 60.0f);
    splat.l1 = float(std::sqrt(yy / (a * b)) * to_sigmas), splat.l3 = float(to_sigmas / std::sqrt(yy));
    splat.l2 = float(-std::sqrt(yy / (a * b)) * to_sigmas * xy / yy);
    splat.log2_opacity = rng.uniform(-7.9f, -0.01f);
  }
  return splats;
}

/// Tiles that hold a pixel at which the splat has an alpha of 1/255, by trying all pixels.
std::set<std::uint32_t> tiles_by_pixels(const Splat& splat) {
  std::set<std::uint32_t> tiles;
  for (int y = 0; y < rows * tile_size; ++y)
    for (int x = 0; x < columns * tile_size; ++x) {
      const double dx = x - double(splat.x), dy = y - double(splat.y);
      const double u = double(splat.l1) * dx + double(splat.l2) * dy, v = double(splat.l3) * dy;
      if (splat.log2_opacity - u * u - v * v >= -log2_255)
        tiles.insert(std::uint32_t(y / tile_size * columns + x / tile_size));
    }
  return tiles;
}

/// Two tiles wider than need be on every side: what is listed is to be told by the ellipse.
TileBox wide_box(const std::set<std::uint32_t>& tiles) {
  int first_column = columns - 1, last_column = 0, first_row = rows - 1, last_row = 0;
  for (const std::uint32_t tile : tiles) {
    const int column = int(tile) % columns, row = int(tile) / columns;
    first_column = std::min(first_column, column), last_column = std::max(last_column, column);
    first_row = std::min(first_row, row), last_row = std::max(last_row, row);
  }
  return {std::uint16_t(std::max(first_column - 2, 0)), std::uint16_t(std::min(last_column + 2, columns - 1)),
          std::uint16_t(std::max(first_row - 2, 0)), std::uint16_t(std::min(last_row + 2, rows - 1))};
}

/// All of n splats, the last one first.
std::vector<DepthKey> backwards(std::size_t n) {
  std::vector<DepthKey> order;
  for (std::size_t i = n; i-- > 0;) order.push_back({0, std::uint32_t(i)});
  return order;
}

TEST(ListReachedTiles, ListsEveryTileThatHoldsAPixelWithinReachAndHardlyAnyOther) {
  std::vector<Splat> splats;
  std::vector<std::set<std::uint32_t>> expected;
  std::size_t needed = 0;
  for (Splat splat : random_splats(1000)) {
    auto tiles = tiles_by_pixels(splat);
    if (tiles.empty()) continue;  // projection drops it
    splat.box = wide_box(tiles);
    needed += tiles.size();
    splats.push_back(splat), expected.push_back(std::move(tiles));
  }
  ASSERT_GT(splats.size(), 500u);

  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    ReachedTiles reached;
    list_reached_tiles(splats.data(), backwards(splats.size()), columns, reached);
    std::size_t next = 0;
    for (std::size_t i = splats.size(); i-- > 0;) {
      std::vector<std::uint32_t> tiles;
      for (; next < reached.count && reached.splats[next] == i; ++next) tiles.push_back(reached.tiles[next]);
      ASSERT_EQ(std::adjacent_find(tiles.begin(), tiles.end(), std::greater_equal<>()), tiles.end()) << i;
      for (const std::uint32_t tile : expected[i])
        ASSERT_TRUE(std::binary_search(tiles.begin(), tiles.end(), tile)) << "splat " << i;
    }
    EXPECT_EQ(next, reached.count);
    EXPECT_LT(double(reached.count), 1.1 * double(needed)) << "but for ends of needles between pixel centres";
  }
  ASSERT_TRUE(pin_simd_target(best));
}

/// All tiles of the box, when the splat covers them and more.
std::vector<std::uint32_t> tiles_of(const TileBox& box) {
  std::vector<std::uint32_t> tiles;
  for (int row = box.first_row; row <= box.last_row; ++row)
    for (int column = box.first_column; column <= box.last_column; ++column)
      tiles.push_back(std::uint32_t(row * columns + column));
  return tiles;
}

TEST(ListReachedTiles, NeverLeavesTheBox) {
  // Splats that reach past any int fill their boxes: one tile, a row, a column, all, and what fills a vector to the
  // end.
  const std::vector<TileBox> boxes_of_all_kinds = {{7, 7, 5, 5},  {0, columns - 1, 3, 3},        {4, 4, 0, rows - 1},
                                                   {2, 9, 0, 10}, {0, columns - 1, 0, rows - 1}, {18, 19, 10, 11}};
  Splat wide{};
  wide.l1 = 1e-12f, wide.l2 = 3e-13f, wide.l3 = 1e-12f;
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    ReachedTiles reached;  // its memory is kept, and grows
    for (std::size_t n = 0; n <= 40; ++n) {
      std::vector<Splat> splats(n, wide);
      std::vector<std::uint32_t> expected, expected_splats;
      for (std::size_t i = 0; i < n; ++i) splats[i].box = boxes_of_all_kinds[(i + n) % boxes_of_all_kinds.size()];
      for (std::size_t i = n; i-- > 0;) {
        const auto all = tiles_of(splats[i].box);
        expected.insert(expected.end(), all.begin(), all.end());
        expected_splats.insert(expected_splats.end(), all.size(), std::uint32_t(i));
      }
      list_reached_tiles(splats.data(), backwards(n), columns, reached);
      ASSERT_EQ(std::vector(reached.tiles.data(), reached.tiles.data() + reached.count), expected) << n;
      ASSERT_EQ(std::vector(reached.splats.data(), reached.splats.data() + reached.count), expected_splats) << n;
    }
  }
  ASSERT_TRUE(pin_simd_target(best));
}

}  // namespace
}  // namespace engine::render
