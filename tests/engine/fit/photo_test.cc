#include "engine/fit/photo.h"

#include <gtest/gtest.h>

#include "engine/core/rng.h"

namespace engine::fit {
namespace {

scene::Camera camera_of(int width, int height) {
  scene::Camera camera = scene::look_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 1.0, width, height);
  camera.cx += 1.25;  // nothing may assume the middle
  return camera;
}

TEST(Photo, HoldsAPictureOfBytesWithoutLoss) {
  const scene::Camera camera = camera_of(17, 9);
  scene::Image picture(17, 9, 3);
  Rng rng(1);
  for (float& value : picture.data) value = float(rng.below(256)) / 255.0f;
  scene::Image back;
  to_image(to_photo(camera, picture), back);
  EXPECT_EQ(back, picture);
}

TEST(Photo, CutsWhatBytesCannotHold) {
  scene::Image picture(1, 1, 3);
  picture.data = {-0.5f, 2.0f, 0.5f};
  EXPECT_EQ(to_photo(camera_of(1, 1), picture).rgb, (std::vector<std::uint8_t>{0, 255, 128}));
}

TEST(Halved, IsTheMeanOfFourPixelsAndLeavesOddOnesOut) {
  Photo photo{camera_of(5, 3), std::vector<std::uint8_t>(3 * 15, 0)};
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 3; ++y) photo.rgb[std::size_t(15 + y * 5 + x)] = std::uint8_t(10 * x + 4 * y);  // green
  const Photo half = half_size(photo);
  EXPECT_EQ(half.camera.width, 2);
  EXPECT_EQ(half.camera.height, 1);
  EXPECT_EQ(half.rgb, (std::vector<std::uint8_t>{0, 0, 7, 27, 0, 0}));
}

TEST(Halved, SeesAPointAtHalfThePixelPosition) {
  const scene::Camera fine = camera_of(41, 30);
  const scene::Camera coarse = half_size({fine, std::vector<std::uint8_t>(3 * 41 * 30)}).camera;
  const DVec3 point(0.3, -0.2, 0.5);
  const DVec2 at = fine.pixel_from_cam(fine.cam_from_world(point)),
              half = coarse.pixel_from_cam(coarse.cam_from_world(point));
  EXPECT_NEAR(half.x, at.x / 2, 1e-12);
  EXPECT_NEAR(half.y, at.y / 2, 1e-12);
}

}  // namespace
}  // namespace engine::fit
