#include "engine/core/finite.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace engine {
namespace {

TEST(FirstNotFinite, FindsThePositionOfNanAndInfinity) {
  std::vector<float> values(200, 1.0f);
  EXPECT_FALSE(first_not_finite(values));
  values[163] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(first_not_finite(values), 163u);
  values[64] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(first_not_finite(values), 64u);
}

TEST(FirstNotFinite, AcceptsTheLargestAndTheSmallestNumbers) {
  const std::vector<float> values{std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest(),
                                  std::numeric_limits<float>::denorm_min(), -0.0f};
  EXPECT_FALSE(first_not_finite(values));
}

}  // namespace
}  // namespace engine
