#include "engine/core/half_axes.h"

#include <gtest/gtest.h>

namespace engine {
namespace {

void expect_those_of(DVec3 a, DVec3 b) {
  const auto [longer, shorter] = half_axes(a, b);
  const double size = glm::dot(a, a) + glm::dot(b, b);
  EXPECT_LE(std::abs(glm::dot(longer, shorter)), 1e-12 * size) << "at right angles";
  EXPECT_GE(glm::length(longer), glm::length(shorter));
  // Pairs of one ellipse have the same a a^T + b b^T.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(longer[i] * longer[j] + shorter[i] * shorter[j], a[i] * a[j] + b[i] * b[j], 1e-12 * size);
}

TEST(HalfAxes, AreThoseOfTheSameEllipse) {
  expect_those_of({1, 2, 3}, {-2, 0.5, 1});
  expect_those_of({1, 0, 0}, {0, 1, 0});
  expect_those_of({0, 0.1, 0}, {3, 0, 0});
  expect_those_of({1, 1, 0}, {1, 1, 1e-9});
}

TEST(HalfAxes, OfWhatIsFlatTheShorterOneIsNothing) {
  expect_those_of({1, 2, 3}, {2, 4, 6});
  expect_those_of({1, 2, 3}, {0, 0, 0});
  EXPECT_EQ(half_axes(DVec3(0), DVec3(0)).first, DVec3(0));
}

}  // namespace
}  // namespace engine
