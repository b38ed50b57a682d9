#include "engine/core/svd.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"

namespace engine {
namespace {

DMat3 random_matrix(Rng& rng) {
  DMat3 m;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) m[column][row] = double(rng.normal());
  return m;
}

double largest_difference(const DMat3& a, const DMat3& b) {
  double largest = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(a[column][row] - b[column][row]));
  return largest;
}

/// tr(R^T m)
double agreement(const DQuat& turn, const DMat3& m) {
  const DMat3 r = glm::mat3_cast(turn);
  return glm::dot(r[0], m[0]) + glm::dot(r[1], m[1]) + glm::dot(r[2], m[2]);
}

TEST(Decompose, GivesTheMatrixBack) {
  Rng rng(1, 0);
  for (int k = 0; k < 100; ++k) {
    SCOPED_TRACE(k);
    const DMat3 m = random_matrix(rng);
    const Svd parts = decompose(m);
    DMat3 scaled = parts.u;
    for (int axis = 0; axis < 3; ++axis) scaled[axis] *= parts.s[axis];
    EXPECT_LT(largest_difference(scaled * glm::transpose(parts.v), m), 1e-12);
    EXPECT_GE(parts.s[0], parts.s[1]);
    EXPECT_GE(parts.s[1], std::abs(parts.s[2]) - 1e-12);
    EXPECT_NEAR(glm::determinant(parts.u), 1, 1e-12);
    EXPECT_NEAR(glm::determinant(parts.v), 1, 1e-12);
  }
}

TEST(NearestRotation, IsThatOfTheSingularVectors) {
  Rng rng(2, 0);
  for (int k = 0; k < 300; ++k) {
    SCOPED_TRACE(k);
    const DMat3 m = random_matrix(rng) * std::pow(10.0, double(k % 21 - 10));
    const Svd parts = decompose(m);
    EXPECT_LT(largest_difference(glm::mat3_cast(nearest_rotation(m)), parts.u * glm::transpose(parts.v)), 1e-7);
  }
}

TEST(NearestRotation, OfARotationIsItself) {
  Rng rng(3, 0);
  for (int k = 0; k < 100; ++k) {
    const DQuat turn = glm::normalize(DQuat(rng.normal(), rng.normal(), rng.normal(), rng.normal()));
    const DQuat found = nearest_rotation(3.0 * glm::mat3_cast(turn));
    EXPECT_NEAR(std::abs(glm::dot(turn, found)), 1, 1e-14) << k;
  }
}

TEST(NearestRotation, AgreesMostWhereSeveralDo) {
  const DMat3 flat = glm::outerProduct(DVec3(0, 2, 0), DVec3(1, 0, 0));     // x to y; any turn about y
  const DMat3 sheet(DVec3(0, 1, 0), DVec3(-1, 0, 0), DVec3(0, 0, 0));       // a quarter turn about z
  const DMat3 mirrored(DVec3(-1, 0, 0), DVec3(0, -1, 0), DVec3(0, 0, -1));  // any half-turn
  EXPECT_NEAR(agreement(nearest_rotation(flat), flat), 2, 1e-9);
  EXPECT_NEAR(agreement(nearest_rotation(sheet), sheet), 2, 1e-9);
  EXPECT_NEAR(agreement(nearest_rotation(mirrored), mirrored), 1, 1e-9);
}

TEST(NearestRotation, HoldsAtTheEndsOfTheRange) {
  EXPECT_EQ(nearest_rotation(DMat3(0.0)), DQuat(1, 0, 0, 0));
  const DMat3 quarter(DVec3(0, 1, 0), DVec3(-1, 0, 0), DVec3(0, 0, 1));
  for (const double size : {1e-200, 1e-12, 1e12, 1e200}) {
    const DQuat turn = nearest_rotation(size * quarter);
    EXPECT_NEAR(turn.w, std::sqrt(0.5), 1e-12) << size;
    EXPECT_NEAR(turn.z, std::sqrt(0.5), 1e-12) << size;
  }
}

}  // namespace
}  // namespace engine
