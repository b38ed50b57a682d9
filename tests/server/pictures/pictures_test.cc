#include "server/pictures/pictures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace server::pictures {
namespace {

using engine::scene::Image;
using engine::scene::Mask;

TEST(Pictures, PsnrLooksOnlyOutsideTheMask) {
  const Image a(4, 2, 3, 0.5f);
  Image b = a;
  Mask mask(4, 2);
  mask.at(1, 1) = 1;
  b.at(1, 1, 2) = 1.0f;
  EXPECT_EQ(psnr_outside(a, b, mask), std::numeric_limits<double>::infinity());
  b.at(2, 1, 0) = 0.6f;
  // One value of 7 * 3 is off by 0.1.
  EXPECT_NEAR(psnr_outside(a, b, mask), -10 * std::log10(0.01 / 21), 1e-5);
  mask.data.assign(mask.data.size(), 1);
  EXPECT_EQ(psnr_outside(a, b, mask), std::numeric_limits<double>::infinity());
}

TEST(Pictures, TheMaskTintsItsPixelsAlone) {
  const Image picture(3, 1, 3, 0.2f);
  Mask mask(3, 1);
  mask.at(1, 0) = 1;
  const Image shown = with_mask_shown(picture, mask);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(shown.at(0, 0, c), 0.2f);
    EXPECT_EQ(shown.at(2, 0, c), 0.2f);
  }
  EXPECT_GT(shown.at(1, 0, 0), 0.5f);
  EXPECT_LT(shown.at(1, 0, 1), 0.2f);
}

TEST(Pictures, MeanDepthDividesByWhatIsSeen) {
  Image depth(3, 1, 1), alpha(3, 1, 1);
  depth.data = {1.5f, 0.0f, 0.001f};
  alpha.data = {0.5f, 0.0f, 0.001f};
  EXPECT_EQ(mean_depth(depth, alpha).data, (std::vector<float>{3.0f, 0.0f, 0.0f}));
}

TEST(Pictures, DepthIsShadedFromNearToFar) {
  Image depth(4, 1, 1);
  depth.data = {2.0f, 4.0f, 0.0f, 3.0f};
  const Image shades = shaded_depth(depth);
  EXPECT_FLOAT_EQ(shades.data[0], 1.0f);
  EXPECT_FLOAT_EQ(shades.data[1], 0.1f);
  EXPECT_EQ(shades.data[2], 0.0f);
  EXPECT_FLOAT_EQ(shades.data[3], 0.55f);
}

TEST(Pictures, DepthOfAWallOrOfNothingIsFinite) {
  for (const float z : {0.0f, 5.0f, 1e30f}) {
    const Image shades = shaded_depth(Image(2, 2, 1, z));
    for (const float shade : shades.data) EXPECT_EQ(shade, z > 0 ? 1.0f : 0.0f) << z;
  }
}

TEST(Pictures, ClampingKeepsTheRangeOfAPhoto) {
  Image picture(3, 1, 1);
  picture.data = {-0.5f, 0.25f, 1.5f};
  EXPECT_EQ(clamped(picture).data, (std::vector<float>{0.0f, 0.25f, 1.0f}));
}

}  // namespace
}  // namespace server::pictures
