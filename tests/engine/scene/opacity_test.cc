#include "engine/scene/opacity.h"

#include <gtest/gtest.h>

#include <limits>

namespace engine::scene {
namespace {

TEST(Logit, IsTheInverseOfTheSigmoid) {
  for (const double opacity : {1e-12, 0.01, 0.1, 0.3, 0.5, 0.95, 0.999})
    EXPECT_NEAR(1 / (1 + std::exp(-logit(opacity))), opacity, 1e-15) << opacity;
  EXPECT_EQ(logit(0.5), 0);
}

TEST(Logit, IsInfiniteAtTheEnds) {
  EXPECT_EQ(logit(0), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(logit(1), std::numeric_limits<double>::infinity());
}

// The value that scenes and files hold for it must not change by a bit.
TEST(Logit, OfALoweredOriginalIsAsItWasWrittenOut) { EXPECT_EQ(float(logit(0.01)), float(std::log(0.01 / 0.99))); }

}  // namespace
}  // namespace engine::scene
