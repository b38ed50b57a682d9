#include "engine/optim/schedule.h"

#include <gtest/gtest.h>

#include <limits>

namespace engine::optim {
namespace {

TEST(ExponentialDecay, IsAStraightLineInTheLogarithm) {
  EXPECT_DOUBLE_EQ(exponential_decay(1.6e-4, 1.6e-6, 0), 1.6e-4);
  EXPECT_DOUBLE_EQ(exponential_decay(1.6e-4, 1.6e-6, 0.5), 1.6e-5);
  EXPECT_DOUBLE_EQ(exponential_decay(1.6e-4, 1.6e-6, 1), 1.6e-6);
  EXPECT_DOUBLE_EQ(exponential_decay(1.6e-4, 1.6e-6, 7), 1.6e-6);  // after the end it stays
}

TEST(DecayWithinCorrection, FallsFromOneToItsLastFactor) {
  EXPECT_DOUBLE_EQ(decay_within_correction(0, 500), 1.0);
  EXPECT_DOUBLE_EQ(decay_within_correction(499, 500), 0.01);
  for (int i = 1; i < 500; ++i) EXPECT_LT(decay_within_correction(i, 500), decay_within_correction(i - 1, 500));
  EXPECT_DOUBLE_EQ(decay_within_correction(0, 1), 1.0);
}

TEST(PositionScale, IsTheSmallerOfTheSceneAndTheMask) {
  const LearningRates rates{.mask_radii = 5};
  EXPECT_DOUBLE_EQ(position_scale(rates, 4.0, 0.1), 0.5);
  EXPECT_DOUBLE_EQ(position_scale(rates, 4.0, 3.0), 4.0);
  EXPECT_DOUBLE_EQ(position_scale(rates, 0.0, 3.0), 15.0);
}

TEST(ShareOfPosition, NoStepIsLongerThanAShareOfTheWidth) {
  const LearningRates rates{.widths = 0.5};
  EXPECT_DOUBLE_EQ(share_of_position(rates, 4.0, 2.0), 0.25);
  EXPECT_DOUBLE_EQ(share_of_position(rates, 1.0, 2.0), 1.0);
  EXPECT_DOUBLE_EQ(share_of_position(rates, 0.1, 2.0), 1.0);
  EXPECT_EQ(share_of_position(rates, 0.0, 0.0), 1.0) << "nothing moves: any share will do, but no NaN";
  EXPECT_EQ(share_of_position(rates, 1.0, 0.0), 0.0);
  constexpr double most = std::numeric_limits<double>::max();
  EXPECT_EQ(share_of_position(LearningRates{.widths = most}, 1.0, most), 1.0) << "infinite widths bound nothing";
}

TEST(LearningRates, ThatMakeNoSenseAreNamed) {
  EXPECT_TRUE(validate(LearningRates{}));
  EXPECT_EQ(validate(LearningRates{.sh_rest = -1}).error().where, "sh_rest");
  EXPECT_EQ(validate(LearningRates{.mask_radii = 0}).error().where, "mask_radii");
  EXPECT_EQ(validate(LearningRates{.last = 0}).error().where, "last");
  EXPECT_EQ(validate(LearningRates{.widths = 0}).error().where, "widths");
}

}  // namespace
}  // namespace engine::optim
