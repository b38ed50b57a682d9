#include "engine/scene/sh.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <vector>

#include "engine/core/rng.h"
#include "engine/scene/gaussian_cloud.h"
#include "tests/support/gradient_matches.h"

namespace engine::scene {
namespace {

TEST(ShBasisVjp, MatchesCentralDifferencesOfEveryFunctionOfEveryDegree) {
  Rng rng(8);
  for (int degree = 0; degree <= max_sh_degree; ++degree)
    for (std::size_t k = 0; k < sh_coefficients(degree); ++k) {
      SCOPED_TRACE(k);
      std::array<double, 16> v_basis{};
      v_basis[k] = 1;
      std::vector<double> x(3);
      for (double& value : x) value = rng.uniform(-1.0f, 1.0f);
      const auto v = sh_basis_vjp(degree, x[0], x[1], x[2], v_basis.data());
      EXPECT_TRUE(support::gradient_matches(
          [&](const std::vector<double>& at) {
            std::array<double, 16> basis;
            sh_basis(degree, at[0], at[1], at[2], basis.data());
            return basis[k];
          },
          x, {v.begin(), v.end()}));
    }
}

}  // namespace
}  // namespace engine::scene
