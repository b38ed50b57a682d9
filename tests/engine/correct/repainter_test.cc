#include "engine/correct/repainter.h"

#include <gtest/gtest.h>

#include <limits>

namespace engine::correct {
namespace {

TEST(BytePicture, IsTheNearestOf256Values) {
  scene::Image picture(2, 1, 3);
  picture.data = {0, 1, 0.5f, 0.4999f / 255, 0.5001f / 255, 254.4f / 255};
  const BytePicture bytes = as_bytes(picture);
  EXPECT_EQ(bytes.width, 2);
  EXPECT_EQ(bytes.height, 1);
  EXPECT_EQ(bytes.data, (std::vector<std::uint8_t>{0, 255, 128, 0, 1, 254}));
}

TEST(BytePicture, ClampsWhatIsNoColour) {
  scene::Image picture(2, 1, 3);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  picture.data = {-1, 7, infinity, -infinity, std::numeric_limits<float>::quiet_NaN(), 1.0001f};
  EXPECT_EQ(as_bytes(picture).data, (std::vector<std::uint8_t>{0, 255, 255, 0, 0, 255}));
}

TEST(BytePicture, IsTheSameAfterItWasShown) {
  BytePicture bytes{16, 16, std::vector<std::uint8_t>(3 * 256)};
  for (std::size_t i = 0; i < bytes.data.size(); ++i) bytes.data[i] = std::uint8_t(i);
  EXPECT_EQ(as_bytes(as_image(bytes)), bytes);
}

}  // namespace
}  // namespace engine::correct
