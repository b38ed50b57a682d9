#include "engine/render/blend.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/rng.h"
#include "tests/support/gradient_matches.h"

namespace engine::render {
namespace {

using support::gradient_matches;

Projection<double> splat_of(const std::vector<double>& x) {
  Projection<double> splat;
  splat.visible = true;
  splat.x = x[0], splat.y = x[1];
  splat.l1 = x[2], splat.l2 = x[3], splat.l3 = x[4];
  return splat;
}

/// Gradient by the pullbacks with respect to (x, y, l1, l2, l3, opacity) of falloff() at a pixel: undoes the strain.
std::vector<double> falloff_gradient(const std::vector<double>& x, double px, double py, double v_alpha) {
  const auto splat = splat_of(x);
  SplatGradient<double> v_splat;
  falloff_vjp(falloff(splat, x[5], px - x[0], py - x[1]), v_alpha, AlphaClamp::exact, v_splat);
  const auto v = projection_gradient(splat, v_splat);
  const double v_l2 = -v.strain_12 / splat.l3, v_l3 = -v.strain_22 / splat.l3;
  return {v.x, v.y, (-v.strain_11 - v_l2 * splat.l2) / splat.l1, v_l2, v_l3, v_splat.g / x[5]};
}

TEST(FalloffVjp, MatchesCentralDifferences) {
  Rng rng(1);
  for (int repeat = 0; repeat < 50; ++repeat) {
    SCOPED_TRACE(repeat);
    const std::vector<double> x{rng.uniform(-2.0f, 2.0f), rng.uniform(-2.0f, 2.0f), rng.uniform(0.2f, 0.9f),
                                rng.uniform(-0.5f, 0.5f), rng.uniform(0.2f, 0.9f),  rng.uniform(0.1f, 0.9f)};
    EXPECT_TRUE(gradient_matches(
        [](const std::vector<double>& at) {
          return 1.7 * falloff(splat_of(at), at[5], 1.0 - at[0], -0.5 - at[1]).alpha;
        },
        x, falloff_gradient(x, 1.0, -0.5, 1.7)));
  }
}

TEST(FalloffVjp, AlphaClampedAt99PercentHasNoGradientAtTheClampOrBeyondUnlessToldToPassStraightThrough) {
  const auto g_of = [](double opacity, AlphaClamp clamp) {
    SplatGradient<double> v_splat;
    falloff_vjp(falloff(splat_of({0, 0, 1, 0, 1}), opacity, 0.0, 0.0), 1.0, clamp, v_splat);
    return v_splat.g;
  };
  EXPECT_EQ(g_of(std::nextafter(max_alpha, 0.0), AlphaClamp::exact), std::nextafter(max_alpha, 0.0));
  EXPECT_EQ(g_of(max_alpha, AlphaClamp::exact), 0.0) << "the derivative of the clamped side";
  EXPECT_EQ(g_of(0.995, AlphaClamp::exact), 0.0);
  EXPECT_EQ(g_of(0.995, AlphaClamp::straight_through), 0.995) << "of the raw product, not of 0.99";
}

TEST(OpacityLogitGradient, IsTheChainRuleThroughTheSigmoid) {
  for (const double logit : {-3.0, 0.2, 6.0}) {
    const SplatGradient<double> v_splat{.g = 0.8};
    EXPECT_NEAR(opacity_logit_gradient(logit, v_splat), opacity_vjp(logit, 0.8 / opacity(logit)), 1e-12);
  }
  EXPECT_EQ(opacity_logit_gradient(30.5, SplatGradient<double>{.g = 0.8}), 0.0);
}

/// C + 0.6 T_n of a ray that blends n splats of alpha x[i] and value x[n + i], nearest first.
double blended(const std::vector<double>& x, double background) {
  const std::size_t n = x.size() / 2;
  double value = 0, transmittance = 1;
  for (std::size_t i = 0; i < n; ++i) {
    value += transmittance * x[i] * x[n + i];
    transmittance *= 1 - x[i];
  }
  return value + background * transmittance;
}

TEST(BlendVjp, MatchesCentralDifferencesOfAWholeRay) {
  constexpr std::size_t n = 7;
  Rng rng(2);
  std::vector<double> x(2 * n);
  for (double& value : x) value = rng.uniform(0.1f, 0.9f);
  double transmittance = 1;
  for (std::size_t i = 0; i < n; ++i) transmittance *= 1 - x[i];
  RayBackward<double> ray{transmittance, 0.6 * transmittance};
  std::vector<double> gradient(2 * n);
  for (std::size_t i = n; i-- > 0;) {
    gradient[i] = blend_vjp(x[i], x[n + i], ray);
    gradient[n + i] = ray.transmittance * x[i];
  }
  EXPECT_NEAR(ray.transmittance, 1, 1e-12);
  EXPECT_NEAR(ray.behind, blended(x, 0.6), 1e-12);
  EXPECT_TRUE(gradient_matches([](const std::vector<double>& at) { return blended(at, 0.6); }, x, gradient));
}

}  // namespace
}  // namespace engine::render
