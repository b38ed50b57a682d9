#include "engine/render/project_vjp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/rng.h"
#include "engine/scene/gaussian_cloud.h"
#include "tests/support/gradient_matches.h"

namespace engine::render {
namespace {

using support::gradient_matches;

scene::Camera test_camera() {
  scene::Camera camera = scene::look_at({0.3, -0.2, -0.5}, {0.1, 0.2, 3}, {0.1, -1, 0.05}, 1.0, 70, 50);
  camera.cx += 3.3;  // off centre: nothing may assume the middle
  camera.fy *= 1.2;
  return camera;
}

std::vector<double> uniform(Rng& rng, std::size_t n, float low, float high) {
  std::vector<double> values(n);
  for (double& value : values) value = rng.uniform(low, high);
  return values;
}

template <std::size_t n>
std::array<double, n> part(const std::vector<double>& values, std::size_t begin) {
  std::array<double, n> out;
  for (std::size_t i = 0; i < n; ++i) out[i] = values[begin + i];
  return out;
}

double dot(const auto& a, const auto& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

TEST(RotationMatrixVjp, MatchesCentralDifferencesForQuaternionsOfAnyLength) {
  Rng rng(1);
  for (const double length : {1e-6, 0.3, 1.0, 40.0}) {
    SCOPED_TRACE(length);
    for (int repeat = 0; repeat < 20; ++repeat) {
      auto q = uniform(rng, 4, -1.0f, 1.0f);
      const double scale = length / std::sqrt(dot(q, q));
      for (double& value : q) value *= scale;
      const auto v_r = part<9>(uniform(rng, 9, -1.0f, 1.0f), 0);
      const auto v = rotation_matrix_vjp(q[0], q[1], q[2], q[3], v_r);
      EXPECT_TRUE(gradient_matches(
          [&](const std::vector<double>& x) { return dot(rotation_matrix(x[0], x[1], x[2], x[3]), v_r); }, q,
          {v.begin(), v.end()}, {.step = 1e-3 * length}));
    }
  }
}

TEST(RotationMatrixVjp, HasNoComponentAlongTheQuaternion) {
  Rng rng(2);
  for (int repeat = 0; repeat < 200; ++repeat) {
    const double length = std::pow(10.0, rng.uniform(-11.0f, 18.0f));
    auto q = uniform(rng, 4, -1.0f, 1.0f);
    for (double& value : q) value *= length;
    const auto v = rotation_matrix_vjp(q[0], q[1], q[2], q[3], part<9>(uniform(rng, 9, -1.0f, 1.0f), 0));
    EXPECT_GT(dot(v, v), 0.0);
    EXPECT_NEAR(dot(v, q) / std::sqrt(dot(v, v) * dot(q, q)), 0.0, 1e-12) << length;
  }
}

TEST(RotationMatrixVjp, IsFiniteForTheLongestAndZeroForTheShortestFloats) {
  std::array<float, 9> v_r{1, 2, 3, 4, 5, 6, 7, 8, 10};
  for (const float length : {0.0f, 1e-38f, 1e-20f, 1e-13f}) {
    const std::array<float, 4> none{};
    EXPECT_EQ(rotation_matrix_vjp(length, 0.5f * length, 0.0f, length, v_r), none) << length;
  }
  for (const float length : {1e-10f, 1e20f, 1e38f})
    for (const float value : rotation_matrix_vjp(length, -length, 0.0f, length, v_r))
      EXPECT_TRUE(std::isfinite(value)) << length;
}

/// dL/d(projection) from dL/d(each value), as blending would have summed it.
ProjectionGradient<double> with_strain(const Projection<double>& at, double v_x, double v_y, double v_depth,
                                       double v_l1, double v_l2, double v_l3) {
  return {.x = v_x,
          .y = v_y,
          .depth = v_depth,
          .strain_11 = -(v_l1 * at.l1 + v_l2 * at.l2),
          .strain_12 = -v_l2 * at.l3,
          .strain_22 = -v_l3 * at.l3};
}

/// A loss over all that blending sees of project(x[0..2], x[3..5], x[6..9]), and its gradient by project_vjp().
struct ProjectionLoss {
  ViewParams<double> view;
  std::vector<double> weight;  // of x, y, depth, l1, l2, l3

  [[nodiscard]] Projection<double> at(const std::vector<double>& x) const {
    return project(view, part<3>(x, 0), part<3>(x, 3), part<4>(x, 6));
  }
  [[nodiscard]] double operator()(const std::vector<double>& x) const {
    const auto p = at(x);
    return dot(std::array{p.x, p.y, p.depth, p.l1, p.l2, p.l3}, weight);
  }
  [[nodiscard]] std::vector<double> gradient(const std::vector<double>& x) const {
    const auto& w = weight;
    const auto v = project_vjp(view, part<3>(x, 0), part<3>(x, 3), part<4>(x, 6),
                               with_strain(at(x), w[0], w[1], w[2], w[3], w[4], w[5]));
    std::vector<double> all(v.mean.begin(), v.mean.end());
    all.insert(all.end(), v.log_scale.begin(), v.log_scale.end());
    all.insert(all.end(), v.rotation.begin(), v.rotation.end());
    return all;
  }
};

/// Mean, log scales and quaternion of a Gaussian at a place given in units of the view: x / z, y / z, z.
std::vector<double> gaussian_at(const scene::Camera& camera, double x_over_z, double y_over_z, double z, Rng& rng) {
  const DVec3 mean = camera.world_from_cam({x_over_z * z, y_over_z * z, z});
  std::vector<double> x{mean.x, mean.y, mean.z};
  for (const double value : uniform(rng, 3, -4.0f, 0.0f)) x.push_back(value);
  for (const double value : uniform(rng, 4, -1.0f, 1.0f)) x.push_back(value);
  return x;
}

TEST(ProjectVjp, MatchesCentralDifferencesWithinTheFieldOfView) {
  Rng rng(3);
  const auto camera = test_camera();
  for (int repeat = 0; repeat < 100; ++repeat) {
    SCOPED_TRACE(repeat);
    const auto x =
        gaussian_at(camera, rng.uniform(-0.4f, 0.4f), rng.uniform(-0.4f, 0.4f), rng.uniform(1.0f, 5.0f), rng);
    ProjectionLoss loss{view_params<double>(camera), uniform(rng, 6, -1.0f, 1.0f)};
    for (std::size_t i = 3; i < 6; ++i) loss.weight[i] *= 20;  // l1..l3 are small beside the rest
    EXPECT_TRUE(gradient_matches(loss, x, loss.gradient(x), {.step = 2e-4}));
  }
}

TEST(ProjectVjp, MatchesCentralDifferencesBeyondTheClampOfTheFieldOfView) {
  Rng rng(4);
  const auto camera = test_camera();
  for (int repeat = 0; repeat < 100; ++repeat) {
    SCOPED_TRACE(repeat);
    const double x_over_z = (repeat % 2 ? 1 : -1) * rng.uniform(1.5f, 3.0f);
    const double y_over_z = repeat % 4 < 2 ? rng.uniform(-0.3f, 0.3f) : rng.uniform(1.2f, 2.0f);
    const auto x = gaussian_at(camera, x_over_z, y_over_z, rng.uniform(1.0f, 5.0f), rng);
    const ProjectionLoss loss{view_params<double>(camera), uniform(rng, 6, -1.0f, 1.0f)};
    EXPECT_TRUE(gradient_matches(loss, x, loss.gradient(x), {.step = 2e-4}));
  }
}

TEST(ProjectVjp, MatchesCentralDifferencesForNeedlesAndBlades) {
  Rng rng(5);
  const auto camera = test_camera();
  for (int repeat = 0; repeat < 60; ++repeat) {
    SCOPED_TRACE(repeat);
    auto x = gaussian_at(camera, rng.uniform(-0.4f, 0.4f), rng.uniform(-0.4f, 0.4f), rng.uniform(1.0f, 5.0f), rng);
    x[3] = 0.5, x[4] = -8.7, x[5] = repeat % 2 ? -8.7 : 0.3;
    const ProjectionLoss loss{view_params<double>(camera), uniform(rng, 6, -1.0f, 1.0f)};
    EXPECT_TRUE(gradient_matches(loss, x, loss.gradient(x), {.step = 2e-5, .rtol = 1e-6}));
  }
}

TEST(ProjectVjp, ANeedlesGradientSurvivesFloat) {
  // About 800 pixels long and as thin as the low pass leaves it. Were K [u; v] computed as it is written, means and
  // rotations would be up to 5 % off.
  Rng rng(6);
  const auto camera = test_camera();
  const auto relative_error = [](const auto& seen, const auto& expected) {
    double difference = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) difference += std::pow(double(seen[i]) - expected[i], 2);
    return std::sqrt(difference / dot(expected, expected));
  };
  const DVec3 mean = camera.world_from_cam({0.2, -0.4, 2});
  const std::array<float, 3> mean_f{float(mean.x), float(mean.y), float(mean.z)}, log_scale_f{3.5f, -7, -7};
  for (int repeat = 0; repeat < 400; ++repeat) {
    SCOPED_TRACE(repeat);
    std::array<float, 4> q;
    for (float& value : q) value = rng.uniform(-1.0f, 1.0f);
    const float s11 = rng.normal(), s12 = rng.normal(), s22 = rng.normal();
    const auto seen = project_vjp<float>(view_params<float>(camera), mean_f, log_scale_f, q,
                                         {.strain_11 = s11, .strain_12 = s12, .strain_22 = s22});
    const auto expected =
        project_vjp<double>(view_params<double>(camera), {mean_f[0], mean_f[1], mean_f[2]},
                            {log_scale_f[0], log_scale_f[1], log_scale_f[2]}, {q[0], q[1], q[2], q[3]},
                            {.strain_11 = s11, .strain_12 = s12, .strain_22 = s22});
    EXPECT_LT(relative_error(seen.mean, expected.mean), 1e-3);
    EXPECT_LT(relative_error(seen.rotation, expected.rotation), 1e-3);
    EXPECT_LT(relative_error(seen.log_scale, expected.log_scale), 2e-2);
  }
}

TEST(ProjectVjp, AtTheFieldOfViewClampItselfTheDerivativeIsTheOneFromInside) {
  // Camera at the origin, looking along z: x / z is exactly the bound.
  scene::Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 70, 50);
  const auto view = view_params<double>(camera);
  Rng rng(7);
  auto x = gaussian_at(camera, 0, 0, 1, rng);
  x[0] = view.max_x_over_z;
  const ProjectionLoss loss{view, {0, 0, 0, 1, 1, 1}};
  const double slope = loss.gradient(x)[0];
  const auto one_sided = [&](double h) {  // second order
    const auto f = [&](double offset) {
      auto moved = x;
      moved[0] += offset;
      return loss(moved);
    };
    return (-3 * f(0) + 4 * f(h) - f(2 * h)) / (2 * h);
  };
  EXPECT_NEAR(slope, one_sided(-1e-4), 1e-5 * std::abs(slope));
  EXPECT_NEAR(one_sided(1e-4), 0, 1e-5 * std::abs(slope)) << "outside, only the splat's place changes with x";
}

TEST(ProjectVjp, AtTheNearPlaneAndBeforeItThereIsNoGradientAndJustBehindItThereIs) {
  scene::Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 70, 50);
  const auto view = view_params<double>(camera);
  const ProjectionGradient<double> v{.x = 1, .y = 1, .depth = 1, .strain_11 = 1, .strain_12 = 1, .strain_22 = 1};
  const auto at = [&](double z) { return project_vjp(view, {0.01, 0.02, z}, {-3, -3, -2}, {1, 0.1, 0.2, 0.3}, v); };
  for (const double z : {-1.0, 0.1, near_plane}) {
    const auto none = at(z);
    EXPECT_EQ(dot(none.mean, none.mean) + dot(none.log_scale, none.log_scale) + dot(none.rotation, none.rotation), 0.0);
  }
  const auto behind = at(std::nextafter(near_plane, 1.0)), farther = at(near_plane + 1e-9);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(behind.mean[i], farther.mean[i], 1e-6 * std::abs(farther.mean[i]));
  EXPECT_NE(behind.mean[2], 0.0);
}

TEST(ProjectVjp, ASaturatedLogScaleHasTheDerivativeFromInsideAtTheBoundAndNoneBeyond) {
  scene::Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 70, 50);
  const auto view = view_params<double>(camera);
  const auto slope = [&](double log_scale) {
    return project_vjp(view, {0, 0, 2}, {log_scale, -3, -3}, {1, 0, 0, 0}, {.x = 0, .strain_11 = 1}).log_scale[0];
  };
  EXPECT_NEAR(slope(max_log_scale), slope(max_log_scale - 1e-9), 1e-6 * slope(max_log_scale));
  EXPECT_GT(slope(max_log_scale), 0.0);
  EXPECT_EQ(slope(std::nextafter(max_log_scale, 30.0)), 0.0);
  EXPECT_GT(slope(-max_log_scale), 0.0);
  EXPECT_EQ(slope(-max_log_scale - 1e-9), 0.0);
}

TEST(OpacityVjp, MatchesCentralDifferencesAndTheClosedFormWhereFloatSaturates) {
  for (const double logit : {-12.0, -2.0, 0.0, 1.5, 9.0})
    EXPECT_TRUE(gradient_matches([](const std::vector<double>& x) { return 0.7 * opacity(x[0]); }, {logit},
                                 {opacity_vjp(logit, 0.7)}));
  EXPECT_NEAR(opacity_vjp(25.0f, 1.0f) / std::exp(-25.0), 1, 1e-5);  // 1 - opacity is 0 in float
}

TEST(OpacityVjp, ASaturatedLogitHasTheDerivativeFromInsideAtTheBoundAndNoneBeyond) {
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_GT(opacity_vjp(sign * max_opacity_logit, 1.0), 0.0);
    EXPECT_EQ(opacity_vjp(sign * std::nextafter(max_opacity_logit, 40.0), 1.0), 0.0);
  }
  EXPECT_EQ(opacity_vjp(std::numeric_limits<double>::quiet_NaN(), 1.0), 0.0);
}

/// SH of one Gaussian, floats; `stored` bands.
std::vector<float> random_sh(Rng& rng, int stored) {
  std::vector<float> sh(3 * scene::sh_coefficients(stored));
  for (float& value : sh) value = rng.uniform(-0.1f, 0.1f);
  return sh;
}

TEST(ColorVjp, MatchesCentralDifferencesForEveryDegreeStoredAndUsed) {
  Rng rng(9);
  const auto view = view_params<double>(test_camera());
  const std::array<double, 3> v_rgb{0.7, -1.3, 0.4};
  for (int stored = 0; stored <= 3; ++stored)
    for (int degree = 0; degree <= stored; ++degree) {
      SCOPED_TRACE(testing::Message() << "degree " << degree << " of " << stored);
      const auto sh = random_sh(rng, stored);
      const auto mean = uniform(rng, 3, 0.6f, 2.0f);
      std::vector<double> v_sh(sh.size(), 0.0);
      const auto v_mean = color_vjp<double>(view, part<3>(mean, 0), sh, degree, v_rgb, v_sh);
      EXPECT_TRUE(gradient_matches(
          [&](const std::vector<double>& x) { return dot(color(view, part<3>(x, 0), sh, degree), v_rgb); }, mean,
          {v_mean.begin(), v_mean.end()}));
      // Coefficients are stored as float, and colour is linear in them: steps of 1/64 are exact enough.
      EXPECT_TRUE(gradient_matches(
          [&](const std::vector<double>& x) {
            return dot(color(view, part<3>(mean, 0), std::vector<float>(x.begin(), x.end()), degree), v_rgb);
          },
          {sh.begin(), sh.end()}, v_sh, {.step = 1.0 / 64, .rtol = 1e-5}));
    }
}

TEST(ColorVjp, AddsToWhatIsThere) {
  Rng rng(10);
  const auto view = view_params<double>(test_camera());
  const auto sh = random_sh(rng, 1);
  std::vector<double> once(sh.size(), 0.0), after(sh.size(), 0.5);
  color_vjp<double>(view, {1, 1, 2}, sh, 1, {1, 2, 3}, once);
  color_vjp<double>(view, {1, 1, 2}, sh, 1, {1, 2, 3}, after);
  for (std::size_t i = 0; i < sh.size(); ++i) EXPECT_DOUBLE_EQ(after[i], once[i] + 0.5);
}

TEST(ColorVjp, AtBlackItselfTheDerivativeIsTheOneFromAboveAndBelowThereIsNone) {
  const auto view = view_params<float>(test_camera());
  // The coefficient at which 0.5 + sh Y_0 is exactly zero in float.
  float black = -0.5f / 0.28209479177387814f;
  while (0.5f + black * 0.28209479177387814f < 0) black = std::nextafter(black, 0.0f);
  while (0.5f + black * 0.28209479177387814f > 0) black = std::nextafter(black, -9.0f);
  ASSERT_EQ(0.5f + black * 0.28209479177387814f, 0.0f);
  const auto slope = [&](float dc) {
    const std::vector<float> sh(3, dc);
    std::vector<float> v_sh(3, 0.0f);
    color_vjp<float>(view, {0, 0, 2}, sh, 0, {1, 1, 1}, v_sh);
    return v_sh[0];
  };
  EXPECT_EQ(slope(black), 0.28209479177387814f);
  EXPECT_EQ(slope(black - 1e-3f), 0.0f);
  EXPECT_EQ(slope(3e5f), 0.0f) << "beyond the largest colour";
}

TEST(ColorVjp, AClampedChannelMovesNeitherTheMeanNorItsCoefficients) {
  Rng rng(11);
  const auto view = view_params<double>(test_camera());
  auto sh = random_sh(rng, 3);
  for (const std::size_t channel : {0u, 1u, 2u}) sh[channel * 16] = -5;
  std::vector<double> v_sh(sh.size(), 0.0);
  const auto v_mean = color_vjp<double>(view, {1, 1, 2}, sh, 3, {1, 2, 3}, v_sh);
  EXPECT_EQ(dot(v_mean, v_mean), 0.0);
  EXPECT_EQ(dot(v_sh, v_sh), 0.0);
}

}  // namespace
}  // namespace engine::render
