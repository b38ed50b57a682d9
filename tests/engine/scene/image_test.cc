#include "engine/scene/image.h"

#include <gtest/gtest.h>

#include <cmath>

namespace engine::scene {
namespace {

TEST(Psnr, IsMinusTenLogOfTheMeanSquareError) {
  const Image a(4, 3, 3, 0.5f), b(4, 3, 3, 0.6f);
  EXPECT_NEAR(psnr(a, b), 20.0, 1e-5);
  EXPECT_TRUE(std::isinf(psnr(a, a)));
}

TEST(Mask, AreaCountsSetPixels) {
  Mask mask(5, 4);
  mask.at(4, 3) = 1;
  mask.at(0, 1) = 1;
  EXPECT_EQ(mask.area(), 2u);
}

}  // namespace
}  // namespace engine::scene
