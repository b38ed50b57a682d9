#include "engine/correct/harmonic.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/correct/samples.h"

namespace engine::correct {
namespace {

scene::Mask scattered(int width, int height, std::uint32_t kept_in, std::uint64_t seed) {
  scene::Mask mask(width, height);
  Rng rng(seed);
  for (std::uint8_t& flag : mask.data) flag = rng.below(kept_in) != 0;
  return mask;
}

TEST(FillHarmonic, GoesOnAffinelyWhereAllAroundIsAffine) {
  const scene::Image truth = painted(40, 30, [](int x, int y, int c) { return 0.1f + 0.02f * x - 0.01f * c * y; });
  scene::Mask unknown = box_mask(40, 30, {5, 4, 33, 25});
  unknown.at(12, 12) = 0;  // an island
  unknown.at(3, 2) = 1;    // and a lone pixel
  scene::Image filled = spoilt(truth, unknown, -7);
  fill_harmonic(filled, unknown);
  EXPECT_LT(largest_difference(filled, truth), 1e-4);
}

TEST(FillHarmonic, NothingFlowsAtTheRimOfThePicture) {
  // Known along the left side only: what solves it is that column, all the way to the right.
  const scene::Image truth(25, 1, 3, 0.7f);
  const scene::Mask unknown = box_mask(25, 1, {1, 0, 25, 1});
  scene::Image filled = spoilt(truth, unknown, 3);
  fill_harmonic(filled, unknown);
  EXPECT_LT(largest_difference(filled, truth), 1e-5);
  // Known at both ends: a straight line between them.
  const scene::Image ramp = painted(25, 6, [](int x, int, int) { return 0.04f * float(x); });
  const scene::Mask inner = box_mask(25, 6, {1, 0, 24, 6});
  filled = spoilt(ramp, inner, 3);
  fill_harmonic(filled, inner);
  EXPECT_LT(largest_difference(filled, ramp), 1e-4);
}

TEST(FillHarmonic, EachUnknownPixelIsTheMeanOfItsNeighbours) {
  const scene::Mask unknown = scattered(31, 23, 4, 5);
  scene::Image filled = noise(31, 23, 6);
  fill_harmonic(filled, unknown);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 23; ++y)
      for (int x = 0; x < 31; ++x) {
        if (unknown.at(x, y) == 0) continue;
        double sum = 0, count = 0;
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}})
          if (x + dx >= 0 && y + dy >= 0 && x + dx < 31 && y + dy < 23)
            sum += double(filled.at(x + dx, y + dy, c)), ++count;
        ASSERT_NEAR(filled.at(x, y, c), sum / count, 1e-4) << x << ", " << y << ", " << c;
      }
}

TEST(FillHarmonic, StaysWithinWhatIsKnown) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    const scene::Mask unknown = scattered(40, 40, 20, seed);
    const scene::Image picture = spoilt(noise(40, 40, 100 + seed), unknown, 9);
    scene::Image filled = picture;
    fill_harmonic(filled, unknown);
    for (int c = 0; c < 3; ++c) {
      float least = 1, most = 0;
      for (std::size_t i = 0; i < unknown.data.size(); ++i)
        if (unknown.data[i] == 0)
          least = std::min(least, picture.plane(c)[i]), most = std::max(most, picture.plane(c)[i]);
      const auto [low, high] = std::minmax_element(filled.plane(c).begin(), filled.plane(c).end());
      EXPECT_GE(*low, least - 1e-4f);
      EXPECT_LE(*high, most + 1e-4f);
    }
  }
}

TEST(FillHarmonic, LeavesKnownPixelsAsTheyAre) {
  const scene::Mask unknown = scattered(33, 21, 3, 1);
  const scene::Image before = noise(33, 21, 2);
  scene::Image filled = before;
  fill_harmonic(filled, unknown);
  std::size_t changed = 0;
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < unknown.data.size(); ++i)
      if (unknown.data[i] == 0) {
        ASSERT_EQ(filled.plane(c)[i], before.plane(c)[i]) << i;
      } else {
        changed += filled.plane(c)[i] != before.plane(c)[i];
      }
  EXPECT_GT(changed, unknown.area());
}

TEST(FillHarmonic, KeepsWhatIsJoinedToNothingKnown) {
  const scene::Image before = noise(9, 7, 3);
  scene::Image filled = before;
  fill_harmonic(filled, all_set(9, 7));
  EXPECT_EQ(filled, before);
  fill_harmonic(filled, scene::Mask(9, 7));
  EXPECT_EQ(filled, before);
}

TEST(FillHarmonic, IsLinearInTheKnownValues) {
  const scene::Mask unknown = scattered(29, 30, 6, 7);
  const scene::Image picture = noise(29, 30, 8);
  scene::Image filled = picture, larger = picture;
  for (float& value : larger.data) value *= 1024;  // exact in binary
  fill_harmonic(filled, unknown);
  fill_harmonic(larger, unknown);
  for (std::size_t i = 0; i < filled.data.size(); ++i) ASSERT_EQ(larger.data[i], 1024 * filled.data[i]) << i;
}

TEST(FillHarmonic, TakesPicturesOfAnySizeAndNumberOfChannels) {
  scene::Image one(1, 1, 1, 0.5f);
  fill_harmonic(one, all_set(1, 1));
  EXPECT_EQ(one.data[0], 0.5f);
  scene::Image two(2, 1, 5, 0.5f);
  two.at(0, 0, 4) = 0.25f;
  fill_harmonic(two, box_mask(2, 1, {1, 0, 2, 1}));
  EXPECT_EQ(two.at(1, 0, 3), 0.5f);
  EXPECT_EQ(two.at(1, 0, 4), 0.25f);
}

}  // namespace
}  // namespace engine::correct
