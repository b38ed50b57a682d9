#include "engine/render/weight_sums.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/reference/forward_reference.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

struct Sums {
  std::vector<double> all, valued;
  bool operator==(const Sums&) const = default;
};

Sums sums(const scene::GaussianCloud& cloud, const scene::Camera& camera, const scene::Image& value) {
  Workspace workspace;
  Sums out{std::vector<double>(cloud.size(), 0.0), std::vector<double>(cloud.size(), 0.0)};
  add_weight_sums(cloud, camera, value, workspace, out.all, out.valued);
  return out;
}

scene::Image random_picture(int width, int height) {
  scene::Image picture(width, height, 1);
  Rng rng(5);
  for (float& value : picture.data) value = rng.uniform(-1.0f, 2.0f);
  return picture;
}

TEST(WeightSums, AreThoseOfTheReference) {
  const scene::GaussianCloud cloud = cloud_in_view(300, 4, 0);
  const scene::Camera camera = off_centre_camera(75, 53);  // no whole number of tiles
  const scene::Image value = random_picture(75, 53);
  const Sums found = sums(cloud, camera, value);
  int shown = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    std::vector<double> weight(cloud.size(), 0.0);
    weight[row] = 1;
    const auto pictures = forward_reference<double>(cloud, camera, {}, std::span<const double>(weight));
    double all = 0, valued = 0;
    for (std::size_t pixel = 0; pixel < value.pixels(); ++pixel) {
      all += pictures.weight[pixel];
      valued += pictures.weight[pixel] * double(value.data[pixel]);
    }
    // Float sums of up to 256 pixels; and at the cut of 1/255, float and double may decide otherwise for a pixel.
    EXPECT_NEAR(found.all[row], all, 1e-4 * all + 0.005) << row;
    EXPECT_NEAR(found.valued[row], valued, 2e-4 * all + 0.01) << row;
    shown += all > 1;
  }
  EXPECT_GT(shown, 50);
}

TEST(WeightSums, OfAllRowsMakeUpThePicture) {
  const scene::GaussianCloud cloud = cloud_in_view(2000, 7, 0);
  const scene::Camera camera = off_centre_camera(120, 90);
  const Sums found = sums(cloud, camera, scene::Image(120, 90, 1, 3.0f));
  double all = 0, valued = 0, expected = 0;
  for (const double sum : found.all) all += sum;
  for (const double sum : found.valued) valued += sum;
  for (const float alpha : forward(cloud, camera, {.color = false}).alpha.data) expected += double(alpha);
  EXPECT_NEAR(all, expected, 1e-4 * expected);
  EXPECT_NEAR(valued, 3 * expected, 3e-4 * expected);
}

TEST(WeightSums, AreZeroOfWhatIsHidden) {
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 1, 10, 1);
  add_on_axis(cloud, 2, 0, 1);
  add_on_axis(cloud, 3, 10, 1);  // it would leave 5e-5: rays end before
  add_on_axis(cloud, -3, 10, 1);
  const Sums found = sums(cloud, one_pixel_camera(), scene::Image(1, 1, 1, 0.5f));
  EXPECT_NEAR(found.all[0], 0.99, 1e-6);
  EXPECT_NEAR(found.valued[0], 0.495, 1e-6);
  EXPECT_NEAR(found.all[1], 0.005, 1e-6);
  EXPECT_EQ(found.all[2], 0.0);
  EXPECT_EQ(found.all[3], 0.0) << "behind the camera";
}

TEST(WeightSums, AddUpOverCamerasToTheSameBytesForAnyThreads) {
  const scene::GaussianCloud cloud = cloud_in_view(600, 4, 0);
  const scene::Camera one = off_centre_camera(75, 53), other = off_centre_camera(120, 160);
  const Sums none{std::vector<double>(cloud.size(), 0.0), std::vector<double>(cloud.size(), 0.0)};
  Sums both = none, again = none;
  for (auto [threads, out] : {std::pair{1, &both}, {4, &again}})
    WorkArena(threads).run([&] {
      Workspace workspace;
      for (const scene::Camera& camera : {one, other})
        add_weight_sums(cloud, camera, random_picture(camera.width, camera.height), workspace, out->all, out->valued);
    });
  EXPECT_EQ(both, again);
  const Sums first = sums(cloud, one, random_picture(75, 53)), second = sums(cloud, other, random_picture(120, 160));
  for (std::size_t row = 0; row < cloud.size(); ++row)
    EXPECT_NEAR(both.all[row], first.all[row] + second.all[row], 1e-9) << row;
}

}  // namespace
}  // namespace engine::render
