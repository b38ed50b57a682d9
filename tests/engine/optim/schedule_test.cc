#include "engine/optim/schedule.h"

#include <gtest/gtest.h>

#include <cmath>
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

TEST(ShareOfPosition, NoRateIsLargerThanAShareOfTheWidth) {
  EXPECT_DOUBLE_EQ(share_of_position(std::log(2.0), std::log(8.0)), 0.25);
  EXPECT_EQ(share_of_position(std::log(8.0), std::log(8.0)), 1.0);
  EXPECT_EQ(share_of_position(std::log(9.0), std::log(8.0)), 1.0);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double most = std::numeric_limits<float>::max();
  EXPECT_EQ(share_of_position(most, -infinity), 1.0) << "a rate of 0, or any number of widths";
  EXPECT_EQ(share_of_position(-most, -infinity), 1.0);
  EXPECT_EQ(share_of_position(-most, 0.0), 0.0);
  EXPECT_EQ(share_of_position(most, 0.0), 1.0);
}

TEST(LearningRates, ThatMakeNoSenseAreNamed) {
  EXPECT_TRUE(validate(LearningRates{}));
  EXPECT_EQ(validate(LearningRates{.sh_rest = -1}).error().where, "sh_rest");
  EXPECT_EQ(validate(LearningRates{.mask_radii = 0}).error().where, "mask_radii");
  EXPECT_EQ(validate(LearningRates{.last = 0}).error().where, "last");
  EXPECT_EQ(validate(LearningRates{.most_widths = 0}).error().where, "most_widths");
}

}  // namespace
}  // namespace engine::optim
