// Real captures: fox (50 photos) and garden (cameras and points alone).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/io/dataset.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

TEST(FoxDataset, IsReadWhole) {
  const auto folder = support::data_dir() / "fox";
  REQUIRE_SHARED(folder / "sparse" / "0" / "images.bin");
  const auto dataset = read_dataset(folder);
  ASSERT_TRUE(dataset) << dataset.error().message << " " << dataset.error().where;
  ASSERT_EQ(dataset->views.size(), 50u);
  EXPECT_EQ(dataset->points.size(), 8498u);
  EXPECT_EQ(dataset->views.front().camera.name, "0001.jpg");
  EXPECT_TRUE(std::ranges::is_sorted(dataset->views, {}, [](const View& view) { return view.camera.name; }));

  DVec3 middle(0);
  for (const Point& point : dataset->points) middle += point.position / double(dataset->points.size());
  for (const View& view : dataset->views) {
    SCOPED_TRACE(view.camera.name);
    const scene::Camera& camera = view.camera;
    EXPECT_NEAR(camera.fx, 466.76, 0.005);
    EXPECT_NEAR(camera.fy, 466.73, 0.005);
    EXPECT_EQ(camera.cx, 179.5);
    EXPECT_EQ(camera.cy, 320);
    EXPECT_EQ(camera.width, 359);
    EXPECT_EQ(camera.height, 640);
    EXPECT_FALSE(view.lens);
    // Every camera looks at the fox from a few scene sizes away, and sees points.
    const double distance = glm::length(camera.centre() - middle);
    EXPECT_GT(distance, 0.5);
    EXPECT_LT(distance, 20);
    int visible = 0;
    for (const Point& point : dataset->points) {
      const DVec3 in_cam = camera.cam_from_world(point.position);
      if (in_cam.z <= 0) continue;
      const DVec2 pixel = camera.pixel_from_cam(in_cam);
      visible += pixel.x >= 0 && pixel.x < camera.width && pixel.y >= 0 && pixel.y < camera.height;
    }
    EXPECT_GT(visible, 500);
    const auto photo = load_photo(view);
    ASSERT_TRUE(photo) << photo.error().message;
    EXPECT_EQ(photo->width, 359);
    EXPECT_EQ(photo->height, 640);
    const auto [low, high] = std::ranges::minmax(photo->data);
    EXPECT_GE(low, 0);
    EXPECT_LE(high, 1);
    EXPECT_GT(high - low, 0.5f);
  }
}

/// Mean difference between the colours of the points and the pixels `shift` beside their projections.
double colour_error(const Dataset& dataset, int shift_x, int shift_y) {
  double sum = 0;
  int count = 0;
  for (const std::size_t i : {0u, 17u, 42u}) {
    const View& view = dataset.views[i];
    const auto photo = load_photo(view);
    if (!photo) return std::numeric_limits<double>::quiet_NaN();
    for (const Point& point : dataset.points) {
      const DVec3 in_cam = view.camera.cam_from_world(point.position);
      if (in_cam.z <= 0) continue;
      const DVec2 pixel = view.camera.pixel_from_cam(in_cam) + DVec2(shift_x, shift_y);
      if (!(pixel.x >= 0 && pixel.x < photo->width && pixel.y >= 0 && pixel.y < photo->height)) continue;
      for (int c = 0; c < 3; ++c)
        sum += std::abs(photo->at(int(pixel.x), int(pixel.y), c) - float(point.rgb[std::size_t(c)]) / 255.0f);
      count += 3;
    }
  }
  return sum / count;
}

TEST(FoxDataset, PointsHaveTheColourOfThePixelsTheyProjectToAndNotOfThoseBeside) {
  const auto folder = support::data_dir() / "fox";
  REQUIRE_SHARED(folder / "images");
  const auto dataset = read_dataset(folder);
  ASSERT_TRUE(dataset);
  // COLMAP gives a point the mean colour of the pixels that show it. Points that other parts of the scene hide keep the
  // error from vanishing, but it has a sharp minimum: half a pixel of misunderstanding would show.
  const double here = colour_error(*dataset, 0, 0);
  EXPECT_LT(here, 0.15);
  for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}})
    EXPECT_LT(here, 0.98 * colour_error(*dataset, dx, dy)) << dx << "," << dy;
  for (const auto& [dx, dy] : {std::pair{3, 0}, std::pair{-3, 0}, std::pair{0, 3}, std::pair{0, -3}})
    EXPECT_LT(here, 0.88 * colour_error(*dataset, dx, dy)) << dx << "," << dy;
}

TEST(GardenDataset, IsCamerasAndPointsAlone) {
  const auto folder = support::data_dir() / "garden";
  REQUIRE_SHARED(folder / "sparse" / "0" / "images.bin");
  const auto dataset = read_dataset(folder);
  ASSERT_TRUE(dataset) << dataset.error().message << " " << dataset.error().where;
  ASSERT_EQ(dataset->views.size(), 3u);
  EXPECT_EQ(dataset->points.size(), 138766u);
  for (const View& view : dataset->views) {
    EXPECT_EQ(view.camera.width, 648);
    EXPECT_EQ(view.camera.height, 420);
    EXPECT_TRUE(view.photo.empty());
    std::size_t ahead = 0;
    for (const Point& point : dataset->points) ahead += view.camera.cam_from_world(point.position).z > 0;
    EXPECT_GT(ahead, dataset->points.size() / 2);
  }
}

}  // namespace
}  // namespace engine::io
