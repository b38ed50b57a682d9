#include "engine/select/outline.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

scene::Camera camera_of(int width, int height) {
  scene::Camera camera = front_camera();
  camera.width = width, camera.height = height;
  return camera;
}

/// A picture as text: '#' where it is 1.
std::vector<std::string> text_of(const scene::Image& picture) {
  std::vector<std::string> lines;
  for (int y = 0; y < picture.height; ++y) {
    lines.emplace_back();
    for (int x = 0; x < picture.width; ++x) lines.back() += picture.at(x, y) == 1 ? '#' : '.';
  }
  return lines;
}

/// Pixel by pixel, what drawn() does line by line.
template <class Outline>
std::size_t pixels_that_differ(const Outline& outline) {
  const scene::Image picture = drawn(outline);
  std::size_t count = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) count += (picture.at(x, y) == 1) != holds(outline, {x + 0.5, y + 0.5});
  return count;
}

TEST(Outline, OfAPolygonIsItsPixelCentres) {
  const Polygon square{camera_of(5, 4), {{1, 1}, {4, 1}, {4, 3}, {1, 3}}};
  EXPECT_EQ(text_of(drawn(square)), (std::vector<std::string>{".....", ".###.", ".###.", "....."}));
  const Polygon sliver{camera_of(5, 4), {{1.6, 0}, {2.4, 0}, {2.4, 4}, {1.6, 4}}};
  EXPECT_EQ(drawn(sliver), scene::Image(5, 4, 1)) << "between two centres";
}

TEST(Outline, OfAPolygonThatCrossesItselfIsOddHere) {
  // A pentagram: its middle is enclosed twice.
  const Polygon star{camera_of(100, 100), {{50, 5}, {76, 86}, {7, 36}, {93, 36}, {24, 86}}};
  EXPECT_FALSE(holds(star, {50, 50}));
  EXPECT_TRUE(holds(star, {50, 20}));
  EXPECT_EQ(drawn(star).at(50, 50), 0);
  EXPECT_EQ(drawn(star).at(50, 20), 1);
}

TEST(Outline, OfPolygonsSideBySideTakesEachPixelOnce) {
  // Edges through pixel centres, also where two edges meet on one.
  const Polygon left{camera_of(20, 20), {{-5, -5}, {10.5, -5}, {10.5, 10.5}, {4.5, 30}, {-5, 30}}};
  const Polygon right{camera_of(20, 20), {{40, -5}, {10.5, -5}, {10.5, 10.5}, {4.5, 30}, {40, 30}}};
  const scene::Image a = drawn(left), b = drawn(right);
  for (std::size_t i = 0; i < a.data.size(); ++i) EXPECT_EQ(a.data[i] + b.data[i], 1) << i;
}

TEST(Outline, OfAStrokeIsWhatIsNear) {
  const Stroke dot{camera_of(7, 5), {{3.5, 2.5}}, 1.2};
  EXPECT_EQ(text_of(drawn(dot)), (std::vector<std::string>{".......", "...#...", "..###..", "...#...", "......."}));
  const Stroke line{camera_of(7, 5), {{1.5, 2.5}, {5.5, 2.5}}, 0.6};
  EXPECT_EQ(text_of(drawn(line)), (std::vector<std::string>{".......", ".......", ".#####.", ".......", "......."}));
  EXPECT_EQ(drawn(Stroke{camera_of(7, 5), {{-50, -50}}, 10}), scene::Image(7, 5, 1)) << "beside the picture";
}

TEST(Outline, IsTheSameByLinesAndByPoints) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    Rng rng(seed);
    Polygon polygon{camera_of(61, 43), {}};
    Stroke stroke{camera_of(61, 43), {}, double(rng.uniform(0.3f, 12.0f))};
    for (std::size_t i = 0; i < 3 + seed; ++i) {
      polygon.points.emplace_back(rng.uniform(-30.0f, 90.0f), rng.uniform(-30.0f, 70.0f));
      stroke.points.emplace_back(rng.uniform(-30.0f, 90.0f), rng.uniform(-30.0f, 70.0f));
    }
    EXPECT_EQ(pixels_that_differ(polygon), 0u) << seed;
    EXPECT_EQ(pixels_that_differ(stroke), 0u) << seed;
  }
}

TEST(Outline, OfFarPointsIsFine) {
  const Polygon all{camera_of(9, 9), {{-1e6, -1e6}, {1e6, -1e6}, {1e6, 1e6}, {-1e6, 1e6}}};
  EXPECT_EQ(drawn(all), scene::Image(9, 9, 1, 1.0f));
  EXPECT_EQ(drawn(Stroke{camera_of(9, 9), {{-1e6, 4}, {1e6, 4}}, 1e6}), scene::Image(9, 9, 1, 1.0f));
}

}  // namespace
}  // namespace engine::select
