#include "engine/correct/pyramid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/engine/correct/samples.h"

namespace engine::correct {
namespace {

TEST(HalfSize, TakesTheMeanOfWhatIsKnown) {
  MaskedPicture fine{scene::Image(3, 2, 3), scene::Image(3, 2, 1, 1.0f)};
  const float red[] = {0.1f, 0.3f, 0.8f, 0.5f, 0.7f, 0.2f};
  std::copy(std::begin(red), std::end(red), fine.picture.data.begin());
  fine.confidence.data = {1, 0, 1, 0.5f, 0, 1};
  const MaskedPicture coarse = half_size(fine);
  ASSERT_EQ(coarse.picture.width, 2);
  ASSERT_EQ(coarse.picture.height, 1);
  EXPECT_FLOAT_EQ(coarse.picture.at(0, 0), (0.1f + 0.5f * 0.5f) / 1.5f);
  EXPECT_FLOAT_EQ(coarse.picture.at(1, 0), 0.5f) << "two pixels at the odd side";
  EXPECT_FLOAT_EQ(coarse.confidence.at(0, 0), 1.5f / 4);
  EXPECT_FLOAT_EQ(coarse.confidence.at(1, 0), 1);
}

TEST(HalfSize, WhereNothingIsKnownItIsFiniteAndSaysSo) {
  const MaskedPicture coarse = half_size({noise(7, 5, 1), scene::Image(7, 5, 1, 0.0f)});
  EXPECT_EQ(coarse.confidence, scene::Image(4, 3, 1, 0.0f));
  for (const float value : coarse.picture.data) EXPECT_TRUE(value >= 0 && value <= 1) << value;
}

TEST(HalfSize, OneColourStaysOneColourHoweverLittleIsKnown) {
  MaskedPicture picture{scene::Image(37, 21, 3, 0.25f), noise(37, 21, 2, 1)};
  while (picture.picture.pixels() > 1) {
    picture = half_size(picture);
    for (const float value : picture.picture.data) ASSERT_NEAR(value, 0.25f, 1e-6f);
  }
}

TEST(HalfSizeMask, NeedsEveryPixel) {
  scene::Mask fine = all_set(5, 3);
  fine.at(1, 1) = 0;
  const scene::Mask coarse = half_size_mask(fine);
  ASSERT_EQ(coarse.width, 3);
  ASSERT_EQ(coarse.height, 2);
  EXPECT_EQ(coarse.data, (std::vector<std::uint8_t>{0, 1, 1, 1, 1, 1}));
}

TEST(DoubleSize, IsExactOnAffinePicturesAwayFromTheRim) {
  // The middle of pixel u of the fine picture is at (u + 1/2) / 2 of the coarse one.
  const auto value = [](double x, double y) { return float(0.3 + 0.05 * x - 0.03 * y); };
  const scene::Image coarse = painted(9, 8, [&](int x, int y, int) { return value(x + 0.5, y + 0.5); });
  const scene::Image fine = double_size(coarse, 17, 16);
  for (int y = 1; y < 15; ++y)
    for (int x = 1; x < 17; ++x)
      ASSERT_NEAR(fine.at(x, y), value((x + 0.5) / 2, (y + 0.5) / 2), 1e-6) << x << ", " << y;
}

TEST(DoubleSize, RepeatsWhatIsAtTheRimAndLooksTheSameFromEachSide) {
  const scene::Image coarse = noise(6, 5, 3);
  const scene::Image fine = double_size(coarse, 12, 10);
  EXPECT_FLOAT_EQ(fine.at(0, 0), coarse.at(0, 0));
  EXPECT_FLOAT_EQ(fine.at(11, 0), coarse.at(5, 0));
  EXPECT_FLOAT_EQ(fine.at(0, 9), coarse.at(0, 4));
  EXPECT_FLOAT_EQ(fine.at(11, 9), coarse.at(5, 4));
  const auto mirrored = [](const scene::Image& image) {
    return painted(image.width, image.height,
                   [&](int x, int y, int c) { return image.at(image.width - 1 - x, image.height - 1 - y, c); });
  };
  EXPECT_LT(largest_difference(double_size(mirrored(coarse), 12, 10), mirrored(fine)), 1e-6);
}

TEST(DoubleSize, OfOnePixelIsOneColour) {
  const scene::Image fine = double_size(scene::Image(1, 1, 3, 0.4f), 2, 1);
  for (const float value : fine.data) EXPECT_FLOAT_EQ(value, 0.4f);
}

TEST(DepthWithin, IsTheNumberOfStepsToTheNearestPixelThatIsNotSet) {
  scene::Mask mask(23, 17);
  Rng rng(4);
  for (std::uint8_t& flag : mask.data) flag = rng.below(40) != 0;
  const std::vector<int> depth = depth_within(mask);
  for (int y = 0; y < 17; ++y)
    for (int x = 0; x < 23; ++x) {
      int nearest = 23;
      for (int v = 0; v < 17; ++v)
        for (int u = 0; u < 23; ++u)
          if (mask.at(u, v) == 0) nearest = std::min(nearest, std::max(std::abs(u - x), std::abs(v - y)));
      ASSERT_EQ(depth[std::size_t(y * 23 + x)], nearest) << x << ", " << y;
    }
  EXPECT_EQ(depth_within(all_set(5, 9)), std::vector<int>(45, 9)) << "a side of the picture";
}

}  // namespace
}  // namespace engine::correct
