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

TEST(Mask, ItsBoundingBoxHoldsExactlyTheSetPixels) {
  Mask mask(10, 8);
  EXPECT_TRUE(bounding_box(mask).empty());
  EXPECT_EQ(bounding_box(mask), Rect{});
  mask.at(7, 3) = 1;
  EXPECT_EQ(bounding_box(mask), (Rect{7, 3, 8, 4}));
  mask.at(2, 6) = 1;
  EXPECT_EQ(bounding_box(mask), (Rect{2, 3, 8, 7}));
  mask.at(0, 0) = mask.at(9, 7) = 1;
  EXPECT_EQ(bounding_box(mask), (Rect{0, 0, 10, 8}));
}

Image counted(int width, int height, int channels) {
  Image image(width, height, channels);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i);
  return image;
}

TEST(CutOut, HoldsThePixelsOfThePart) {
  const Image image = counted(7, 5, 2);
  const Rect part{2, 1, 6, 4};
  const Image cut = cut_out(image, part);
  ASSERT_EQ(cut.width, 4);
  ASSERT_EQ(cut.height, 3);
  ASSERT_EQ(cut.channels, 2);
  for (int c = 0; c < 2; ++c)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x) EXPECT_EQ(cut.at(x, y, c), image.at(x + 2, y + 1, c)) << x << ", " << y << ", " << c;
}

TEST(CutOut, OfAMaskHoldsThePixelsOfThePart) {
  Mask mask(7, 5);
  mask.at(2, 1) = mask.at(5, 3) = mask.at(6, 4) = 1;
  const Mask cut = cut_out(mask, {2, 1, 6, 4});
  Mask expected(4, 3);
  expected.at(0, 0) = expected.at(3, 2) = 1;
  EXPECT_EQ(cut, expected);
}

TEST(CutOut, OfEverythingIsThePictureAndOfNothingIsEmpty) {
  const Image image = counted(7, 5, 3);
  EXPECT_EQ(cut_out(image, {0, 0, 7, 5}), image);
  EXPECT_TRUE(cut_out(image, {3, 2, 3, 2}).data.empty());
}

TEST(Paste, PutsBackWhatWasCutOutAndLeavesTheRest) {
  const Image image = counted(7, 5, 2), blank(7, 5, 2, -1.0f);
  const Rect part{2, 1, 7, 3};
  Image pasted = blank;
  paste(cut_out(image, part), part, pasted);
  for (int c = 0; c < 2; ++c)
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 7; ++x) {
        const bool inside = x >= part.x0 && x < part.x1 && y >= part.y0 && y < part.y1;
        EXPECT_EQ(pasted.at(x, y, c), inside ? image.at(x, y, c) : -1.0f) << x << ", " << y << ", " << c;
      }
  Image same = image;
  paste(cut_out(image, part), part, same);
  EXPECT_EQ(same, image);
}

}  // namespace
}  // namespace engine::scene
