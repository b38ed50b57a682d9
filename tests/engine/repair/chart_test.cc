#include "engine/repair/chart.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/mask/mask.h"
#include "engine/repair/seed.h"

namespace engine::repair {
namespace {

constexpr int width = 96, height = 72;
constexpr scene::Rect hole{38, 30, 58, 42};

/// The ground z = 0, seen at a slant from a height.
scene::Camera slanted(double side = 0, double up = 2) {
  return scene::look_at({side, -4, up}, {0, 0, 0}, {0, 0, 1}, 0.6, width, height);
}

/// Inverse depth of the ground at a pixel position.
double ground(const scene::Camera& camera, DVec2 pixel) {
  const DVec3 ray = glm::transpose(camera.rotation) *
                    DVec3((pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy, 1.0);
  return -ray.z / camera.centre().z;
}

/// What the ground looks like: a pattern wide enough for pictures of that size.
float pattern(DVec3 at) { return float(0.5 + 0.2 * std::sin(5 * at.x) + 0.2 * std::cos(4 * at.y)); }

/// The ground goes on in a hole of this view.
ContinuedSurfaces ground_behind(const scene::Camera& camera) {
  ContinuedSurfaces surfaces{scene::Image(width, height, 1),
                             [camera](DVec2 pixel) { return ground(camera, pixel); },
                             {4, 4, width - 4, height - 4}};
  for (int y = hole.y0; y < hole.y1; ++y)
    for (int x = hole.x0; x < hole.x1; ++x) surfaces.inverse_depth.at(x, y) = float(ground(camera, {x + 0.5, y + 0.5}));
  return surfaces;
}

/// What a camera sees of the ground, and whether it may be relied upon.
struct Seen {
  scene::Image color{width, height, 3}, inverse_depth{width, height, 1};
  scene::Mask reliable{width, height};

  explicit Seen(const scene::Camera& camera, scene::Rect unreliable = {}) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const DVec2 pixel(x + 0.5, y + 0.5);
        const double here = ground(camera, pixel);
        inverse_depth.at(x, y) = float(here);
        for (int c = 0; c < 3; ++c) color.at(x, y, c) = pattern(point_at(camera, pixel, here));
        const bool is_out = x >= unreliable.x0 && x < unreliable.x1 && y >= unreliable.y0 && y < unreliable.y1;
        reliable.at(x, y) = !is_out;
      }
  }
  operator Shown() const { return {color, inverse_depth, reliable}; }
};

DVec3 point_of(const Chart& chart, int x, int y) {
  return point_at(chart.camera, {x + 0.5, y + 0.5}, double(chart.inverse_depth.at(x, y)));
}

TEST(Chart, FacesTheGroundAndLiesOnIt) {
  const scene::Camera view = slanted();
  const auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  EXPECT_NEAR(chart->camera.ray_direction({chart->camera.cx, chart->camera.cy}).z, -1, 1e-9) << "straight down";
  const DVec3 middle = point_at(view, {(hole.x0 + hole.x1) / 2.0, (hole.y0 + hole.y1) / 2.0},
                                ground(view, {(hole.x0 + hole.x1) / 2.0, (hole.y0 + hole.y1) / 2.0}));
  EXPECT_NEAR(glm::distance(chart->camera.centre(), middle), glm::distance(view.centre(), middle), 0.1);
  EXPECT_DOUBLE_EQ(chart->camera.fy, view.fy) << "as finely as the view";
  std::size_t on = 0, open = 0;
  for (int y = 0; y < chart->camera.height; ++y)
    for (int x = 0; x < chart->camera.width; ++x) {
      if (chart->inverse_depth.at(x, y) == 0) continue;
      ++on;
      EXPECT_NEAR(point_of(*chart, x, y).z, 0, 1e-5);
      if (chart->goes_on.at(x, y) == 0) continue;
      ++open;
      const DVec2 at = view.pixel_from_cam(view.cam_from_world(point_of(*chart, x, y)));
      EXPECT_TRUE(at.x >= hole.x0 && at.x < hole.x1 && at.y >= hole.y0 && at.y < hole.y1) << at.x << ", " << at.y;
    }
  // At a slant of 2 in 4.5 the ground is drawn together to that part, so from above there are so many more pixels.
  EXPECT_NEAR(double(open), hole.width() * hole.height() * std::hypot(4, 2) / 2, 0.2 * double(open));
  EXPECT_GT(on, 4 * open) << "with its surroundings";
}

TEST(Chart, ShowsWhatViewsShow) {
  const scene::Camera view = slanted(), other = slanted(1.5);
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  add_view(*chart, view, Seen(view, hole));
  EXPECT_TRUE(is_surrounded(*chart, 1));
  std::size_t unknown = 0;
  for (std::size_t i = 0; i < chart->goes_on.data.size(); ++i)
    if (chart->goes_on.data[i] != 0) unknown += chart->weights.data[i] == 0 ? 1 : 0;
  EXPECT_EQ(unknown, chart->goes_on.area()) << "the hole of this view";
  add_view(*chart, other, Seen(other));
  const scene::Image picture = picture_of(*chart);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      if (chart->goes_on.at(x, y) != 0) {
        EXPECT_GT(chart->weights.at(x, y), 0) << "the other view looks into it";
      }
      if (chart->weights.at(x, y) > 0) {
        ASSERT_NEAR(picture.at(x, y, 1), pattern(point_of(*chart, x, y)), 0.02) << x << ", " << y;
      }
    }
}

TEST(Chart, ItsRimIsWhereTheViewSeesThroughTheSurfaceAround) {
  const scene::Camera view = slanted();
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  constexpr int untold = 2;  // pixels beside the hole of which the view tells nothing
  const scene::Rect ring{hole.x0 - untold, hole.y0 - untold, hole.x1 + untold, hole.y1 + untold};
  add_view(*chart, view, Seen(view, ring));
  scene::Image trust(width, height, 1, 1.0f);
  EXPECT_EQ(rim_of(*chart, view, trust, untold).area(), 0u) << "nothing is seen through it";
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width / 2; ++x) trust.at(x, y) = 0.9f;  // the left half of the picture lets through
  const scene::Mask rim = rim_of(*chart, view, trust, untold);
  const scene::Mask around = mask::dilate(chart->goes_on, 2 * untold);
  std::size_t expected = 0;
  for (int y = 0; y < rim.height; ++y)
    for (int x = 0; x < rim.width; ++x) {
      const bool is_left = chart->inverse_depth.at(x, y) > 0 &&
                           view.pixel_from_cam(view.cam_from_world(point_of(*chart, x, y))).x < width / 2.0;
      const bool is_around = around.at(x, y) != 0 && chart->goes_on.at(x, y) == 0;
      EXPECT_EQ(rim.at(x, y) != 0, is_around && is_left) << x << ", " << y;
      expected += is_around && is_left;
    }
  EXPECT_GT(expected, 20u);
}

TEST(Chart, HasNoRimBeyondTheEdgeOfASurface) {
  const scene::Camera view = slanted();
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  constexpr int untold = 2;
  // To the right of the hole nobody tells of the ground: it may end there.
  add_view(*chart, view, Seen(view, {hole.x0 - untold, 0, width, height}));
  const scene::Mask rim = rim_of(*chart, view, scene::Image(width, height, 1), untold);
  EXPECT_GT(rim.area(), 10u) << "to its left, and a little in the corners there";
  for (int y = 0; y < rim.height; ++y)
    for (int x = 0; x < rim.width; ++x) {
      if (rim.at(x, y) == 0) continue;
      EXPECT_LT(view.pixel_from_cam(view.cam_from_world(point_of(*chart, x, y))).x, hole.x0 + untold + 1);
    }
}

TEST(Chart, LeavesOutWhatIsNotTheSurface) {
  const scene::Camera view = slanted();
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  Seen seen(view);
  for (float& inverse_depth : seen.inverse_depth.data) inverse_depth *= 1.05f;  // something stands before it
  add_view(*chart, view, seen);
  for (const float weight : chart->weights.data) EXPECT_EQ(weight, 0);
  const scene::Camera below = slanted(0, -2);
  add_view(*chart, below, Seen(below));
  for (const float weight : chart->weights.data) EXPECT_EQ(weight, 0) << "it looks at the other side";
  for (const float value : picture_of(*chart).data) EXPECT_EQ(value, 0);
  EXPECT_FALSE(is_surrounded(*chart, 1));
}

TEST(Chart, AViewThatShowsItFinerTellsMore) {
  const scene::Camera view = slanted(), steep = slanted(0, 8);
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  Chart other = *chart;
  add_view(*chart, view, Seen(view));
  scene::Camera fine = steep;
  fine.fx = fine.fy = 2 * view.fy;
  add_view(other, fine, Seen(fine));
  const int middle = chart->camera.width / 2;
  EXPECT_GT(other.weights.at(middle, middle), chart->weights.at(middle, middle));
}

TEST(Chart, StaysFiniteBesideACameraOnTheSurface) {
  const scene::Camera view = slanted();
  auto chart = chart_of(view, ground_behind(view));
  ASSERT_TRUE(chart);
  const scene::Camera on_it = scene::look_at({0, 0, 1e-12}, {0, 0, 0}, {0, 1, 0}, 3.0, width, height);
  for (int i = 0; i < 3; ++i) add_view(*chart, on_it, Seen(on_it));
  for (const float value : picture_of(*chart).data) ASSERT_TRUE(std::isfinite(value));
}

TEST(Chart, ThereIsNoneOfNothingOrAlongASurface) {
  const scene::Camera view = slanted();
  EXPECT_FALSE(chart_of(view, {scene::Image(width, height, 1), {}, {}}));
  ContinuedSurfaces few = ground_behind(view);
  few.inverse_depth = scene::Image(width, height, 1);
  few.inverse_depth.at(40, 40) = float(ground(view, {40.5, 40.5}));
  EXPECT_FALSE(chart_of(view, few)) << "a pixel";
  const scene::Camera low = slanted(0, 0.1);
  EXPECT_FALSE(chart_of(low, ground_behind(low))) << "it looks along the ground";
}

}  // namespace
}  // namespace engine::repair
