#include "engine/deform/motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/rng.h"

namespace engine::deform {
namespace {

constexpr Interpolation interpolations[] = {Interpolation::paper, Interpolation::smooth, Interpolation::rigid};
constexpr Rotation rotations[] = {Rotation::shortest_arc, Rotation::paper, Rotation::none};

DVec3 random_point(Rng& rng, double scale = 1) {
  return scale * DVec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
}

std::vector<Drag> random_drags(std::size_t n, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Drag> drags(n);
  for (Drag& drag : drags) drag.source = random_point(rng), drag.target = drag.source + random_point(rng, 0.5);
  return drags;
}

bool finite(const GaussianMotion& m) {
  return std::isfinite(m.mean.x + m.mean.y + m.mean.z) && std::abs(glm::length(m.rotation) - 1) < 1e-12;
}

/// Length of the rotation between two unit quaternions, as a chord; q and -q are one rotation.
double turn_between(const DQuat& a, const DQuat& b) {
  return std::min(glm::length(DQuat(a.w - b.w, a.x - b.x, a.y - b.y, a.z - b.z)),
                  glm::length(DQuat(a.w + b.w, a.x + b.x, a.y + b.y, a.z + b.z)));
}

TEST(GaussianMotion, OneHandleIsAPureTranslation) {
  Rng rng(1);
  const auto motions = handle_motions(std::vector<Drag>{{DVec3(1, 2, 3), DVec3(1.5, 2, 2.25)}}, Rotation::shortest_arc);
  for (const Interpolation interpolation : interpolations) {
    const DVec3 mean = random_point(rng);
    const GaussianMotion motion = gaussian_motion(mean, motions, 0, interpolation);
    EXPECT_EQ(motion.mean, mean + DVec3(0.5, 0, -0.75));
    EXPECT_EQ(motion.rotation, DQuat(1, 0, 0, 0));
  }
}

TEST(GaussianMotion, OnAHandleItGoesWhereTheHandleGoes) {
  const auto drags = random_drags(6, 2);
  const auto motions = handle_motions(drags, Rotation::shortest_arc);
  for (const Interpolation interpolation : interpolations)
    for (std::size_t i = 0; i < drags.size(); ++i)
      EXPECT_LT(glm::distance(gaussian_motion(drags[i].source, motions, 0, interpolation).mean, drags[i].target),
                1e-12);
}

TEST(GaussianMotion, AllHandlesMovingAlikeCarryEverythingAlong) {
  auto drags = random_drags(5, 3);
  const DVec3 step(0.25, -0.5, 0.125);
  for (Drag& drag : drags) drag.target = drag.source + step;
  Rng rng(4);
  for (const Interpolation interpolation : interpolations) {
    const auto motions = handle_motions(drags, Rotation::shortest_arc);
    for (int trial = 0; trial < 20; ++trial) {
      const DVec3 mean = random_point(rng, 2);
      const GaussianMotion motion = gaussian_motion(mean, motions, 0, interpolation);
      EXPECT_LT(glm::distance(motion.mean, mean + step), 1e-14);
      EXPECT_LT(turn_between(motion.rotation, DQuat(1, 0, 0, 0)), 1e-15);
    }
  }
}

TEST(GaussianMotion, RigidReproducesARotationInThePlaneOfItsHandles) {
  // Two handles that turn about their midpoint: the rotation is known from the pair alone.
  const double angle = 0.6;
  const DQuat turn(std::cos(angle / 2), 0, 0, std::sin(angle / 2));
  std::vector<Drag> drags{{DVec3(1, 0, 0)}, {DVec3(-1, 0, 0)}};
  for (Drag& drag : drags) drag.target = turn * drag.source;
  const auto motions = handle_motions(drags, Rotation::shortest_arc);
  Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    const DVec3 mean = random_point(rng, 2);
    const GaussianMotion motion = gaussian_motion(mean, motions, 0, Interpolation::rigid);
    EXPECT_LT(glm::distance(motion.mean, turn * mean), 1e-14);
    EXPECT_LT(turn_between(motion.rotation, turn), 1e-14);
  }
}

TEST(GaussianMotion, SmoothWeightsAreThePapersForTwoHandles) {
  const auto motions = handle_motions(random_drags(2, 6), Rotation::shortest_arc);
  Rng rng(7);
  for (int trial = 0; trial < 20; ++trial) {
    const DVec3 mean = random_point(rng, 3);
    const GaussianMotion paper = gaussian_motion(mean, motions, 0, Interpolation::paper);
    const GaussianMotion smooth = gaussian_motion(mean, motions, 0, Interpolation::smooth);
    EXPECT_LT(glm::distance(paper.mean, smooth.mean), 1e-14);
    EXPECT_LT(turn_between(paper.rotation, smooth.rotation), 1e-14);
  }
}

/// The largest jump of the displacement and of the rotation between samples of a straight path.
struct Jump {
  double shift = 0, turn = 0;
};
Jump largest_jump(DVec3 from, DVec3 to, std::span<const HandleMotion> motions, Interpolation interpolation,
                  int samples) {
  Jump worst;
  DVec3 last_shift{0};
  DQuat last_turn{1.0, 0.0, 0.0, 0.0};
  for (int s = 0; s <= samples; ++s) {
    const DVec3 mean = from + double(s) / samples * (to - from);
    const GaussianMotion motion = gaussian_motion(mean, motions, 0, interpolation);
    const DVec3 shift = motion.mean - mean;
    if (s > 0) {
      worst.shift = std::max(worst.shift, glm::distance(shift, last_shift));
      worst.turn = std::max(worst.turn, turn_between(motion.rotation, last_turn));
    }
    last_shift = shift, last_turn = motion.rotation;
  }
  return worst;
}

TEST(GaussianMotion, SmoothAndRigidDoNotJumpWhereTheNearestHandlesChange) {
  // Every path passes through the point that is equally far from three handles, where no two of them are "the" nearest.
  const std::vector<Drag> drags{{DVec3(1, 0, 0), DVec3(1, 0, 1)},
                                {DVec3(-0.5, std::sqrt(0.75), 0), DVec3(-0.5, 1.5, 0)},
                                {DVec3(-0.5, -std::sqrt(0.75), 0), DVec3(-1, -1, -0.5)},
                                {DVec3(0, 0, 1.2), DVec3(0.4, 0, 1.2)}};
  const auto motions = handle_motions(drags, Rotation::shortest_arc);
  Rng rng(8);
  double paper_jump = 0;
  for (int path = 0; path < 20; ++path) {
    const DVec3 aside = random_point(rng);
    for (const Interpolation interpolation : {Interpolation::smooth, Interpolation::rigid}) {
      const Jump coarse = largest_jump(aside, -aside, motions, interpolation, 1000);
      const Jump fine = largest_jump(aside, -aside, motions, interpolation, 10000);
      EXPECT_LT(fine.shift, coarse.shift / 5) << path;  // a jump would not shrink with the step
      EXPECT_LT(fine.turn, coarse.turn / 5) << path;
      EXPECT_LT(fine.shift, 0.005) << path;
    }
    paper_jump = std::max(paper_jump, largest_jump(aside, -aside, motions, Interpolation::paper, 10000).shift);
  }
  EXPECT_GT(paper_jump, 0.1);  // the measure sees a jump where there is one
}

TEST(GaussianMotion, StaysWithinItsGroup) {
  const std::vector<Drag> drags{{DVec3(0), DVec3(1, 0, 0), 0}, {DVec3(0.1, 0, 0), DVec3(0, 5, 0), 7}};
  const auto motions = handle_motions(drags, Rotation::shortest_arc);
  for (const Interpolation interpolation : interpolations) {
    EXPECT_EQ(gaussian_motion(DVec3(0.09, 0, 0), motions, 0, interpolation).mean, DVec3(1.09, 0, 0));
    EXPECT_EQ(gaussian_motion(DVec3(0.09, 0, 0), motions, 0, interpolation).rotation, DQuat(1, 0, 0, 0));
  }
}

TEST(GaussianMotion, AnchorsHoldExactly) {
  // The anchor's target is not read; beside it a handle turns.
  std::vector<Drag> drags{{DVec3(0), DVec3(9), 0, true}, {DVec3(1, 0, 0), DVec3(0, 1, 0)}};
  const auto motions = handle_motions(drags, Rotation::shortest_arc);
  EXPECT_EQ(motions[0].translation, DVec3(0));
  EXPECT_EQ(motions[0].rotation, DQuat(1, 0, 0, 0));
  EXPECT_NEAR(motions[1].rotation.w, std::cos(std::numbers::pi / 4), 1e-15);
  for (const Interpolation interpolation : interpolations) {
    const GaussianMotion motion = gaussian_motion(DVec3(0), motions, 0, interpolation);
    EXPECT_EQ(motion.mean, DVec3(0));
    EXPECT_EQ(motion.rotation, DQuat(1, 0, 0, 0));
  }
}

TEST(GaussianMotion, NoDragIsExactlyNoMotion) {
  auto drags = random_drags(5, 9);
  for (Drag& drag : drags) drag.target = drag.source;
  Rng rng(10);
  for (const Rotation rotation : rotations) {
    const auto motions = handle_motions(drags, rotation);
    for (const Interpolation interpolation : interpolations)
      for (int trial = 0; trial < 20; ++trial) {
        const DVec3 mean = random_point(rng);
        const GaussianMotion motion = gaussian_motion(mean, motions, 0, interpolation);
        EXPECT_EQ(motion.mean, mean);
        // [s, r] of equal directions has length |s|, which may be one rounding off; the others are exact.
        if (rotation != Rotation::paper) {
          EXPECT_EQ(motion.rotation, DQuat(1, 0, 0, 0));
        }
      }
  }
}

TEST(GaussianMotion, DegenerateHandlesGiveFiniteMotion) {
  Rng rng(11);
  const DVec3 a(0.3, -0.2, 0.9), b(-1, 0.5, 0);
  const std::vector<std::vector<Drag>> cases{
      {{a, b}, {a, b}},                              // coincident, and stay so
      {{a, b}, {a, a}, {a, -b}},                     // coincident, then apart
      {{a, b}, {b, a}, {2.0 * b - a, 2.0 * a - b}},  // exact reversal of every pair
      {{a, a}, {b, a}},                              // apart, then coincident
      {{a, a}, {a + DVec3(1e-13), b}, {a - DVec3(1e-13), b}, {b, b}},
      {{a, b}, {a, b}, {a, b}, {b, a}}};
  for (std::size_t c = 0; c < cases.size(); ++c) {
    for (const Rotation rotation : rotations) {
      const auto motions = handle_motions(cases[c], rotation);
      for (const Interpolation interpolation : interpolations) {
        for (const Drag& drag : cases[c])
          EXPECT_TRUE(finite(gaussian_motion(drag.source, motions, 0, interpolation))) << c;
        for (int trial = 0; trial < 10; ++trial)
          EXPECT_TRUE(finite(gaussian_motion(random_point(rng), motions, 0, interpolation))) << c;
        EXPECT_TRUE(finite(gaussian_motion(DVec3(1e150, 0, 0), motions, 0, interpolation))) << c;
      }
    }
  }
}

TEST(PairRotation, TakesOneDirectionToTheOther) {
  Rng rng(12);
  for (int trial = 0; trial < 100; ++trial) {
    const DVec3 from = random_point(rng), to = random_point(rng);
    const DQuat q = pair_rotation(from, to, Rotation::shortest_arc);
    EXPECT_LT(glm::distance(q * glm::normalize(from), glm::normalize(to)), 1e-14) << trial;
    const DQuat twice = q * q, printed = pair_rotation(from, to, Rotation::paper);
    EXPECT_LT(turn_between(twice, printed), 1e-14) << trial;  // the form in the paper turns by twice the angle
  }
}

TEST(PairRotation, ReversalIsAHalfTurnAlsoNextToTheAxes) {
  for (const DVec3 v : {DVec3(1, 0, 0), DVec3(0, -2, 0), DVec3(0, 0, 3), DVec3(1, 1, 1), DVec3(1, 1e-9, 0)}) {
    const DQuat q = pair_rotation(v, -v, Rotation::shortest_arc);
    EXPECT_NEAR(q.w, 0, 1e-15);
    EXPECT_LT(glm::distance(q * v, -v), 1e-14 * glm::length(v) + 1e-15);
  }
}

TEST(PairRotation, WithoutADirectionThereIsNoTurn) {
  EXPECT_EQ(pair_rotation(DVec3(0), DVec3(1, 0, 0), Rotation::shortest_arc), DQuat(1, 0, 0, 0));
  EXPECT_EQ(pair_rotation(DVec3(1, 0, 0), DVec3(1e-13, 0, 0), Rotation::paper), DQuat(1, 0, 0, 0));
}

TEST(GaussianMotion, RotationsThatCancelGiveTheIdentity) {
  // Half a turn one way and half a turn the other way are one rotation, but no hemisphere of the identity decides that.
  const std::vector<HandleMotion> motions{{DVec3(1, 0, 0), DVec3(0), DQuat(0, 0, 0, 1), 0},
                                          {DVec3(-1, 0, 0), DVec3(0), DQuat(0, 0, 0, -1), 0}};
  EXPECT_EQ(gaussian_motion(DVec3(0), motions, 0, Interpolation::smooth).rotation, DQuat(1, 0, 0, 0));
  EXPECT_LT(turn_between(gaussian_motion(DVec3(0), motions, 0, Interpolation::paper).rotation, DQuat(0, 0, 0, 1)),
            1e-15);
}

}  // namespace
}  // namespace engine::deform
