#include "engine/mask/mask.h"

#include <gtest/gtest.h>

#include <limits>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::mask {
namespace {

using scene::Mask;

Mask random_mask(int width, int height, float density, std::uint64_t seed) {
  Mask mask(width, height);
  Rng rng(seed);
  for (auto& pixel : mask.data) pixel = rng.uniform() < density;
  return mask;
}

Mask dilate_by_definition(const Mask& mask, int radius) {
  Mask wide(mask.width, mask.height);
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      for (int v = 0; v < mask.height; ++v)
        for (int u = 0; u < mask.width; ++u)
          if (mask.at(u, v) && (u - x) * (u - x) + (v - y) * (v - y) <= radius * radius) wide.at(x, y) = 1;
  return wide;
}

TEST(Mask2d, TakesPixelsAtOrAboveTheThresholdAndNoOthers) {
  scene::Image weight(5, 1, 1);
  weight.data = {0.0f, 0.4999f, 0.5f, 1.0f, std::numeric_limits<float>::quiet_NaN()};
  const Mask mask = mask2d(weight);
  EXPECT_EQ(mask.width, 5);
  EXPECT_EQ(mask.data, (std::vector<std::uint8_t>{0, 0, 1, 1, 0}));
  EXPECT_EQ(mask2d(weight, 0.25f).area(), 3u);
}

TEST(DilationRadius, IsTenPixelsAt512AndScalesWithThePicture) {
  EXPECT_EQ(dilation_radius(512), 10);
  EXPECT_EQ(dilation_radius(1024), 20);
  EXPECT_EQ(dilation_radius(640), 13);
  EXPECT_EQ(dilation_radius(20), 1);
  EXPECT_EQ(dilation_radius(1), 1);
}

TEST(Dilate, IsTheDiscOfItsDefinition) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    const float density = seed % 3 == 0 ? 0.003f : 0.05f;
    const Mask mask = random_mask(23 + int(seed), 37 - int(seed), density, seed);
    for (const int radius : {1, 2, 3, 5, 9}) {
      SCOPED_TRACE(radius);
      EXPECT_EQ(dilate(mask, radius), dilate_by_definition(mask, radius));
    }
  }
}

TEST(Dilate, IsTheSameDiscWhereColumnsAreSharedOut) {
  // Columns are worked on 64 at a time: one such share, one and a bit, two, and several with a last one that is cut.
  for (const int width : {64, 65, 128, 300}) {
    SCOPED_TRACE(width);
    const Mask mask = random_mask(width, 19, 0.02f, std::uint64_t(width));
    ASSERT_GT(mask.area(), 0u);
    for (const int radius : {1, 4, 11}) {
      SCOPED_TRACE(radius);
      EXPECT_EQ(dilate(mask, radius), dilate_by_definition(mask, radius));
    }
  }
}

TEST(Dilate, LeavesAnEmptyMaskEmptyAndAFullOneFull) {
  const Mask empty(9, 4);
  EXPECT_EQ(dilate(empty, 3), empty);
  Mask full(9, 4);
  full.data.assign(full.data.size(), 1);
  EXPECT_EQ(dilate(full, 3), full);
  EXPECT_EQ(dilate(Mask(), 3), Mask());
}

TEST(Dilate, ByZeroOrLessChangesNothing) {
  const Mask mask = random_mask(8, 8, 0.3f, 1);
  EXPECT_EQ(dilate(mask, 0), mask);
  EXPECT_EQ(dilate(mask, -4), mask);
}

TEST(Dilate, ByMoreThanThePictureFillsIt) {
  Mask mask(6, 200);
  mask.at(0, 0) = 1;
  EXPECT_EQ(dilate(mask, std::numeric_limits<int>::max()).area(), mask.data.size());
}

TEST(Dilate, IsTheSameForAnyNumberOfThreads) {
  const Mask mask = random_mask(300, 200, 0.001f, 7);
  Mask one, four;
  WorkArena(1).run([&] { one = dilate(mask, 11); });
  WorkArena(4).run([&] { four = dilate(mask, 11); });
  EXPECT_EQ(one, four);
}

TEST(Eroded, KeepsWhatIsFarFromAllElse) {
  Mask mask(7, 5);
  for (int y = 1; y < 5; ++y)
    for (int x = 1; x < 6; ++x) mask.at(x, y) = 1;
  Mask inner(7, 5);
  for (int y = 2; y < 5; ++y)
    for (int x = 2; x < 5; ++x) inner.at(x, y) = 1;
  EXPECT_EQ(eroded(mask, 1), inner) << "the picture's rim is no end";
  EXPECT_EQ(eroded(mask, 0), mask);
  EXPECT_EQ(eroded(mask, 9), Mask(7, 5));
}

TEST(Opened, LosesWhatIsThinAndKeepsTheRest) {
  Mask mask(20, 12);
  for (int y = 2; y < 9; ++y)
    for (int x = 2; x < 9; ++x) mask.at(x, y) = 1;
  const Mask square = mask;
  for (int x = 9; x < 18; ++x) mask.at(x, 5) = mask.at(x, 6) = 1;  // two pixels wide
  mask.at(18, 10) = 1;
  const Mask out = opened(mask, 1);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 20; ++x) {
      const bool corner = (x == 2 || x == 8) && (y == 2 || y == 8);
      const bool joint = x == 9 && (y == 5 || y == 6);  // of a disc whose centre is in the square
      EXPECT_EQ(out.at(x, y) != 0, (square.at(x, y) != 0 && !corner) || joint) << x << ", " << y;
    }
}

TEST(Opened, KeepsWhatReachesTheRimOfThePicture) {
  Mask mask(9, 9);
  for (int y = 0; y < 9; ++y) mask.at(0, y) = mask.at(1, y) = 1;
  EXPECT_EQ(opened(mask, 1), mask);
  EXPECT_EQ(opened(mask, 0), mask);
  EXPECT_EQ(opened(Mask(5, 5), 2), Mask(5, 5));
}

TEST(BlurRadius, GrowsWithThePictureAndIsNeverNothing) {
  EXPECT_EQ(blur_radius(512), 2);
  EXPECT_EQ(blur_radius(240), 1);
  EXPECT_EQ(blur_radius(1), 1);
  EXPECT_EQ(blur_radius(16384), 85);
}

TEST(Unite, KeepsWhatEitherHolds) {
  Mask a(2, 2), b(2, 2);
  a.at(0, 0) = b.at(0, 0) = b.at(1, 1) = 1;
  unite(a, b);
  EXPECT_EQ(a.data, (std::vector<std::uint8_t>{1, 0, 0, 1}));
}

}  // namespace
}  // namespace engine::mask
