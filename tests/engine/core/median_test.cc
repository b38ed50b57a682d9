#include "engine/core/median.h"

#include <gtest/gtest.h>

namespace engine {
namespace {

TEST(Median, IsTheValueInTheMiddle) {
  EXPECT_EQ(median<float>({3, 1, 2}), 2);
  EXPECT_EQ(median<int>({7}), 7);
}

TEST(Median, OfAnEvenNumberIsTheUpperOfTwo) { EXPECT_EQ(median<double>({4, 1, 3, 2}), 3); }

TEST(Median, DoesNotMindEqualAndFarValues) { EXPECT_EQ(median<double>({1e300, 5, 5, -1e300, 5}), 5); }

}  // namespace
}  // namespace engine
