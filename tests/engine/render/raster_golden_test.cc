// Both backends against golden/raster: made in double by a dense implementation of the same semantics.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/render/forward.h"
#include "engine/render/reference/forward_reference.h"
#include "tests/engine/render/raster_golden.h"

namespace engine::render {
namespace {

using support::RasterGolden;

class RasterGoldenTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { REQUIRE_SHARED(support::golden_dir() / "raster" / (GetParam() + ".safetensors")); }
};

double relative_l2(const std::vector<double>& seen, const std::vector<double>& expected) {
  EXPECT_EQ(seen.size(), expected.size());
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += (seen[i] - expected[i]) * (seen[i] - expected[i]);
    norm += expected[i] * expected[i];
  }
  return std::sqrt(difference) / std::max(std::sqrt(norm), 1e-30);
}

/// One view of a [views, height, width, channels] tensor as planes [channels][height * width].
std::vector<double> view_planes(const support::Tensor& tensor, std::size_t view, std::size_t channels) {
  const std::size_t pixels = tensor.shape[1] * tensor.shape[2];
  std::vector<double> planes(pixels * channels);
  for (std::size_t i = 0; i < pixels; ++i)
    for (std::size_t c = 0; c < channels; ++c)
      planes[c * pixels + i] = tensor.values[(view * pixels + i) * channels + c];
  return planes;
}

template <class Real>
std::vector<double> widened(const std::array<std::vector<Real>, 3>& planes) {
  std::vector<double> all;
  for (const auto& plane : planes) all.insert(all.end(), plane.begin(), plane.end());
  return all;
}

/// The float tolerances of golden/manifest.json: 1e-4 away from a cut, 8e-3 at one, 2e-6 in the mean.
void expect_float_close(std::span<const float> seen, const std::vector<double>& expected,
                        const std::vector<double>& near_threshold, double scale = 1.0) {
  ASSERT_EQ(seen.size(), expected.size());
  double sum = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double difference = std::abs(double(seen[i]) - expected[i]);
    const bool loose = near_threshold[i % near_threshold.size()] != 0;
    ASSERT_LE(difference, (loose ? 8e-3 : 1e-4) * scale)
        << "value " << i << ": " << seen[i] << ", expected " << expected[i];
    sum += difference;
  }
  EXPECT_LE(sum / double(expected.size()), 2e-6 * scale);
}

double largest(const std::vector<double>& values) {
  double out = 0;
  for (const double value : values) out = std::max(out, std::abs(value));
  return out;
}

std::vector<double> inverse_depths(const scene::GaussianCloud& cloud, const scene::Camera& camera) {
  std::vector<double> out(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double z = camera.cam_from_world(DVec3(cloud.mean.get(i))).z;
    out[i] = z > near_plane ? 1 / z : 0;
  }
  return out;
}

TEST_P(RasterGoldenTest, DoubleReferenceAgreesToRounding) {
  const RasterGolden golden(GetParam());
  const std::string prefix = golden.file.contains("dense_stop.out.rgb") ? "" : "deg3.";
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    ForwardOptions options{.background = golden.background};
    const auto weight = inverse_depths(golden.cloud, golden.cameras[v]);
    const auto seen = forward_reference<double>(golden.cloud, golden.cameras[v], options, weight);
    auto expected = [&](const char* name, std::size_t channels) {
      return view_planes(golden.file.at(prefix + "dense_stop.out." + name), v, channels);
    };
    EXPECT_LT(relative_l2(widened(seen.color), expected("rgb", 3)), 1e-9);
    EXPECT_LT(relative_l2(seen.alpha, expected("alpha", 1)), 1e-9);
    EXPECT_LT(relative_l2(seen.depth, expected("depth", 1)), 1e-9);
    EXPECT_LT(relative_l2(seen.weight, expected("invdepth", 1)), 1e-9);
    const auto counts = expected("ncontrib", 1);
    EXPECT_EQ(std::vector<double>(seen.contributions.begin(), seen.contributions.end()), counts);
  }
}

TEST_P(RasterGoldenTest, DoubleReferenceAgreesWithTheOtherSemantics) {
  const RasterGolden golden(GetParam());
  const std::string prefix = golden.file.contains("dense_stop.out.rgb") ? "" : "deg3.";
  for (std::size_t v = 0; v < golden.cameras.size(); ++v)
    for (const auto& [name, semantics] :
         {std::pair{"dense_nostop", Semantics::dense_nostop}, std::pair{"tile16_stop", Semantics::tile16_stop}}) {
      SCOPED_TRACE(name);
      ForwardOptions options{.background = golden.background, .semantics = semantics};
      const auto seen = forward_reference<double>(golden.cloud, golden.cameras[v], options, {});
      const auto expected = view_planes(golden.file.at(prefix + name + ".out.rgb"), v, 3);
      EXPECT_LT(relative_l2(widened(seen.color), expected), 1e-6);  // stored as float
    }
}

TEST_P(RasterGoldenTest, ProjectionAgreesValueByValue) {
  const RasterGolden golden(GetParam());
  const std::size_t n = golden.cloud.size();
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    const auto view = view_params<double>(golden.cameras[v]);
    for (std::size_t i = 0; i < n; ++i) {
      SCOPED_TRACE(i);
      const auto& cloud = golden.cloud;
      const std::array<double, 3> mean{cloud.mean.x[i], cloud.mean.y[i], cloud.mean.z[i]};
      const auto seen =
          project<double>(view, mean, {cloud.log_scale.x[i], cloud.log_scale.y[i], cloud.log_scale.z[i]},
                          {cloud.rotation.w[i], cloud.rotation.x[i], cloud.rotation.y[i], cloud.rotation.z[i]});
      auto mid = [&](const char* name, std::size_t channels, std::size_t c) {
        return golden.file.at(std::string("mid.") + name).values[(v * n + i) * channels + c];
      };
      ASSERT_EQ(seen.visible, mid("visible", 1, 0) != 0);
      if (!seen.visible) continue;
      EXPECT_NEAR(seen.x, mid("mean2d_px", 2, 0), 1e-9 * (1 + std::abs(seen.x)));
      EXPECT_NEAR(seen.y, mid("mean2d_px", 2, 1), 1e-9 * (1 + std::abs(seen.y)));
      EXPECT_NEAR(seen.depth, mid("view_depth", 1, 0), 1e-9 * seen.depth);
      const double a = mid("cov2d_abc", 3, 0), b = mid("cov2d_abc", 3, 1), c = mid("cov2d_abc", 3, 2);
      EXPECT_NEAR(seen.sigma_x * seen.sigma_x, a, 1e-9 * a);
      EXPECT_NEAR(seen.covariance_xy, b, 1e-9 * std::sqrt(a * c));
      EXPECT_NEAR(seen.sigma_y * seen.sigma_y, c, 1e-9 * c);
      // The golden conic carries the cancellation of its determinant, which grows with the axis ratio.
      const double loss = 1e-12 * a * c / (a * c - b * b) + 1e-9;
      EXPECT_NEAR(seen.l1 * seen.l1, mid("conic_abc", 3, 0), loss * mid("conic_abc", 3, 0));
      EXPECT_NEAR(seen.l2 * seen.l2 + seen.l3 * seen.l3, mid("conic_abc", 3, 2), loss * mid("conic_abc", 3, 2));
      const auto rgb = color(view, mean, cloud.sh_row(i), 3);
      for (std::size_t channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(rgb[channel], mid("color", 3, channel), 1e-9 * (1 + rgb[channel]));
    }
  }
}

TEST_P(RasterGoldenTest, BothFloatBackendsAreWithinTolerance) {
  const RasterGolden golden(GetParam());
  const std::string prefix = golden.file.contains("dense_stop.out.rgb") ? "" : "deg3.";
  for (const Backend backend : {Backend::reference, Backend::simd})
    for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
      SCOPED_TRACE(backend == Backend::simd ? "simd" : "reference");
      const ForwardOptions options{.background = golden.background, .depth = true, .backend = backend};
      std::vector<float> weight;
      for (const double w : inverse_depths(golden.cloud, golden.cameras[v])) weight.push_back(float(w));
      const Rendering seen = forward(golden.cloud, golden.cameras[v], options, weight);
      auto expected = [&](const char* name, std::size_t channels) {
        return view_planes(golden.file.at(prefix + "dense_stop.out." + name), v, channels);
      };
      const auto near = view_planes(golden.file.at(prefix + "dense_stop.out.near_threshold"), v, 1);
      expect_float_close(seen.color.data, expected("rgb", 3), near);
      expect_float_close(seen.alpha.data, expected("alpha", 1), near);
      // Depths are not colours: the tolerance goes with their size.
      expect_float_close(seen.depth.data, expected("depth", 1), near, std::max(1.0, largest(expected("depth", 1))));
      expect_float_close(seen.weight.data, expected("invdepth", 1), near,
                         std::max(1.0, largest(expected("invdepth", 1))));
    }
}

TEST_P(RasterGoldenTest, EverySimdTargetIsWithinTolerance) {
  const RasterGolden golden(GetParam());
  const std::string prefix = golden.file.contains("dense_stop.out.rgb") ? "" : "deg3.";
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    const Rendering seen = forward(golden.cloud, golden.cameras[0], {.background = golden.background});
    expect_float_close(seen.color.data, view_planes(golden.file.at(prefix + "dense_stop.out.rgb"), 0, 3),
                       view_planes(golden.file.at(prefix + "dense_stop.out.near_threshold"), 0, 1));
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(RasterGoldenDegrees, EveryShDegreeIsWithinTolerance) {
  REQUIRE_SHARED(support::golden_dir() / "raster" / "a_random200.safetensors");
  const RasterGolden golden("a_random200");
  for (int degree = 0; degree <= 3; ++degree) {
    SCOPED_TRACE(degree);
    const std::string prefix = "deg" + std::to_string(degree) + ".dense_stop.out.";
    const auto expected = view_planes(golden.file.at(prefix + "rgb"), 0, 3);
    const auto near = view_planes(golden.file.at("deg3.dense_stop.out.near_threshold"), 0, 1);
    ForwardOptions options{.background = golden.background, .max_sh_degree = degree};
    EXPECT_LT(
        relative_l2(widened(forward_reference<double>(golden.cloud, golden.cameras[0], options, {}).color), expected),
        1e-6);  // degrees below 3 are stored as float
    for (const Backend backend : {Backend::reference, Backend::simd}) {
      options.backend = backend;
      expect_float_close(forward(golden.cloud, golden.cameras[0], options).color.data, expected, near);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, RasterGoldenTest, testing::ValuesIn(support::raster_scenes()),
                         [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace engine::render
