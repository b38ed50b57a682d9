#include "engine/correct/repeats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/correct/samples.h"

namespace engine::correct {
namespace {

constexpr float unlike_any = 9;  // a colour that occurs nowhere else

/// Checks in a lattice that is askew, no whole number of pixels wide.
scene::Image checks(int width, int height, double side = 9.7) {
  return painted(width, height, [&](int x, int y, int c) {
    const double u = (x + 0.21 * y) / side, v = (y - 0.21 * x) / side;
    const double wave = std::sin(3.141592653589793 * u) * std::sin(3.141592653589793 * v);
    return float(0.5 + (0.4 - 0.1 * c) * std::tanh(6 * wave));
  });
}

scene::Mask all_but(const scene::Mask& mask) {
  scene::Mask out = mask;
  for (std::uint8_t& flag : out.data) flag = flag == 0;
  return out;
}

struct Filled {
  scene::Image picture;
  scene::Mask foretold;
};

Filled fill(const scene::Image& truth, const scene::Mask& hole) {
  Filled out{spoilt(truth, hole, unlike_any), {}};
  out.foretold = continue_repeats(out.picture, all_but(hole), hole);
  return out;
}

const scene::Mask middle = box_mask(150, 140, {52, 45, 96, 93});

TEST(Repeats, ChecksGoOnInTheirLattice) {
  const scene::Image truth = checks(150, 140);
  const Filled filled = fill(truth, middle);
  EXPECT_EQ(filled.foretold.area(), middle.area());
  EXPECT_GT(psnr_in(filled.picture, truth, middle), 22) << "shifts are whole pixels";
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < middle.data.size(); ++i)
      if (middle.data[i] == 0) {
        ASSERT_EQ(filled.picture.plane(c)[i], truth.plane(c)[i]) << "what is known stays";
      }
}

TEST(Repeats, StripesGoOnThroughNoise) {
  const scene::Image clean = stripes(150, 140);
  scene::Image noisy = clean;
  Rng rng(3);
  for (float& value : noisy.data) value += 0.05f * rng.normal();
  const Filled filled = fill(noisy, middle);
  EXPECT_EQ(filled.foretold.area(), middle.area());
  EXPECT_GT(psnr_in(filled.picture, clean, middle), 28) << "which several shifts average: one has 26 dB";
}

TEST(Repeats, FineAndCoarseOnesAreFoundInALargePicture) {
  const scene::Mask hole = box_mask(520, 400, {220, 150, 330, 260});
  for (const double side : {11.3, 47.0}) {
    const scene::Image truth = checks(520, 400, side);
    const Filled filled = fill(truth, hole);
    EXPECT_GT(double(filled.foretold.area()), 0.9 * double(hole.area())) << side;
    EXPECT_GT(psnr_in(filled.picture, truth, filled.foretold), 20) << side;
  }
}

TEST(Repeats, NoiseForetellsNothing) {
  const Filled filled = fill(noise(150, 140, 5), middle);
  EXPECT_EQ(filled.foretold.area(), 0u);
  EXPECT_EQ(filled.picture, spoilt(noise(150, 140, 5), middle, unlike_any));
}

TEST(Repeats, OneHalfThatRepeatsForetellsNothingOfTheOther) {
  // Left checks, right noise; the hole lies in both.
  scene::Image truth = checks(150, 140);
  const scene::Image other = noise(150, 140, 7);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 140; ++y)
      for (int x = 76; x < 150; ++x) truth.at(x, y, c) = other.at(x, y, c);
  const Filled filled = fill(truth, middle);
  for (int y = 0; y < 140; ++y)
    for (int x = 92; x < 150; ++x) ASSERT_EQ(filled.foretold.at(x, y), 0) << x << ", " << y;
}

TEST(Repeats, SmallHolesAndEmptyOnesAreLeftAlone) {
  const scene::Image truth = checks(150, 140);
  EXPECT_EQ(fill(truth, box_mask(150, 140, {60, 60, 75, 75})).foretold.area(), 0u);
  EXPECT_GT(fill(truth, box_mask(150, 140, {60, 60, 76, 76})).foretold.area(), 200u);
  EXPECT_EQ(fill(truth, scene::Mask(150, 140)).foretold.area(), 0u);
}

TEST(Repeats, WhereNothingIsKnownNothingIsForetold) {
  const scene::Image truth = checks(60, 50);
  EXPECT_EQ(fill(truth, all_set(60, 50)).foretold.area(), 0u);
  // Of one colour, and of one pixel's width.
  EXPECT_EQ(
      fill(painted(60, 50, [](int, int, int) { return 0.1f; }), box_mask(60, 50, {20, 15, 40, 35})).foretold.area(),
      0u);
  EXPECT_EQ(fill(checks(1, 400), box_mask(1, 400, {0, 20, 1, 380})).foretold.area(), 0u);
}

TEST(Repeats, PixelsOfTheHoleThatAreKnownStay) {
  const scene::Image truth = checks(150, 140);
  scene::Image picture = spoilt(truth, middle, unlike_any);
  scene::Mask known = all_but(middle);
  known.at(70, 70) = 1;
  const scene::Mask foretold = continue_repeats(picture, known, middle);
  EXPECT_EQ(foretold.at(70, 70), 0);
  EXPECT_EQ(picture.at(70, 70), unlike_any);
}

TEST(Repeats, EveryNumberIsFinite) {
  for (const float scale : {0.0f, 1e-6f, 1.0f, 1e6f}) {
    scene::Image truth = checks(150, 140);
    for (float& value : truth.data) value *= scale;
    const Filled filled = fill(truth, middle);
    EXPECT_TRUE(std::ranges::all_of(filled.picture.data, [](float value) { return std::isfinite(value); })) << scale;
  }
}

TEST(Repeats, HaveTheSameBytesForAnyNumberOfThreads) {
  const scene::Image truth = checks(150, 140);
  Filled one, three;
  WorkArena(1).run([&] { one = fill(truth, middle); });
  WorkArena(3).run([&] { three = fill(truth, middle); });
  EXPECT_EQ(one.picture, three.picture);
  EXPECT_EQ(one.foretold.data, three.foretold.data);
}

}  // namespace
}  // namespace engine::correct
