#include "engine/scene/rotate_sh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/rng.h"
#include "engine/scene/sh.h"

namespace engine::scene {
namespace {

DVec3 random_direction(Rng& rng) { return glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal())); }
DQuat random_rotation(Rng& rng) {
  return glm::normalize(DQuat(rng.normal(), rng.normal(), rng.normal(), rng.normal()));
}

double colour(int degree, std::span<const float> coefficients, DVec3 d) {
  std::vector<double> basis(coefficients.size());
  sh_basis(degree, d.x, d.y, d.z, basis.data());
  double sum = 0;
  for (std::size_t k = 0; k < basis.size(); ++k) sum += basis[k] * double(coefficients[k]);
  return sum;
}

TEST(RotateSh, ColourSeenFromTheRotatedDirectionIsTheColourOfBefore) {
  Rng rng(1);
  for (int degree = 0; degree <= 3; ++degree) {
    for (int trial = 0; trial < 50; ++trial) {
      const DQuat rotation = random_rotation(rng);
      std::vector<float> before(std::size_t((degree + 1) * (degree + 1)));
      for (float& value : before) value = rng.uniform(-1, 1);
      std::vector<float> after = before;
      rotate_sh(sh_rotation(rotation), after);
      for (int view = 0; view < 10; ++view) {
        const DVec3 d = random_direction(rng);
        EXPECT_NEAR(colour(degree, after, rotation * d), colour(degree, before, d), 1e-6) << degree << " " << trial;
      }
    }
  }
}

TEST(RotateSh, MatricesAreOrthogonalAndTheIdentityIsOne) {
  Rng rng(2);
  const ShRotation one = sh_rotation(DQuat(1, 0, 0, 0)), any = sh_rotation(random_rotation(rng));
  const auto check = [](const auto& identity, const auto& matrix, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        double dot = 0;
        for (std::size_t k = 0; k < n; ++k) dot += matrix[i * n + k] * matrix[j * n + k];
        EXPECT_NEAR(dot, i == j ? 1 : 0, 1e-14) << n << ": " << i << " " << j;
        EXPECT_NEAR(identity[i * n + j], i == j ? 1 : 0, 1e-14) << n << ": " << i << " " << j;
      }
    }
  };
  check(one.band1, any.band1, 3);
  check(one.band2, any.band2, 5);
  check(one.band3, any.band3, 7);
}

TEST(RotateSh, LeavesTheConstantTermAlone) {
  std::vector<float> coefficients(16, 0.5f);
  coefficients[0] = -0.0f;
  rotate_sh(sh_rotation(DQuat(0, 1, 0, 0)), coefficients);
  EXPECT_TRUE(std::signbit(coefficients[0]));
}

TEST(ShBasis, IsOrthonormalOnTheSphere) {
  // Gauss-Legendre in z (8 nodes: exact to degree 15) times 16 equal steps in azimuth (exact to degree 15).
  const double nodes[] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
  const double weights[] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
  std::vector<double> gram(256, 0.0);
  for (int i = 0; i < 8; ++i) {
    const double z = (i % 2 ? -1 : 1) * nodes[i / 2], r = std::sqrt(1 - z * z);
    for (int j = 0; j < 16; ++j) {
      const double phi = 2 * std::numbers::pi * (j + 0.25) / 16;
      double basis[16];
      sh_basis(3, r * std::cos(phi), r * std::sin(phi), z, basis);
      for (std::size_t a = 0; a < 16; ++a)
        for (std::size_t b = 0; b < 16; ++b)
          gram[a * 16 + b] += basis[a] * basis[b] * weights[i / 2] * 2 * std::numbers::pi / 16;
    }
  }
  for (std::size_t a = 0; a < 16; ++a)
    for (std::size_t b = 0; b < 16; ++b) EXPECT_NEAR(gram[a * 16 + b], a == b ? 1 : 0, 1e-9) << a << " " << b;
}

TEST(ShBasis, HasTheSignsOfTheFiles) {
  double y[16];
  sh_basis(3, 0.0, 1.0, 0.0, y);
  EXPECT_LT(y[1], 0);  // -y
  sh_basis(3, 1.0, 0.0, 0.0, y);
  EXPECT_LT(y[3], 0);   // -x
  EXPECT_GT(y[8], 0);   // xx - yy
  EXPECT_LT(y[15], 0);  // -x (xx - 3yy)
  sh_basis(3, 0.0, 0.0, 1.0, y);
  EXPECT_GT(y[2], 0);
  EXPECT_GT(y[12], 0);
  const double s = std::sqrt(0.5);
  sh_basis(3, 0.0, s, s, y);
  EXPECT_NEAR(y[5], -0.5462742152960396, 1e-15);  // -yz
  EXPECT_GT(y[9], 0);                             // -y (3xx - yy)
}

}  // namespace
}  // namespace engine::scene
