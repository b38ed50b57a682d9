// Gradients against golden/raster: made in double by automatic differentiation of a dense implementation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/render/backward.h"
#include "engine/render/reference/backward_reference.h"
#include "tests/engine/render/raster_golden.h"

namespace engine::render {
namespace {

using support::RasterGolden;
using support::Tensor;

class BackwardGoldenTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { REQUIRE_SHARED(support::golden_dir() / "raster" / (GetParam() + ".safetensors")); }
};

/// Tensor names of a scene start with its degree where it has several.
std::string prefix_of(const RasterGolden& golden) { return golden.file.contains("dense_stop.out.rgb") ? "" : "deg3."; }

/// Largest relative L2 difference that golden/manifest.json grants double code: 1e-6 where the tensor is stored as
/// float.
double double_tolerance(const Tensor& expected) { return expected.dtype == "F64" ? 1e-9 : 1e-6; }

double float_tolerance(const std::string& scene) { return scene == "b1_needles" || scene == "b8_mix" ? 1e-3 : 1e-4; }

std::vector<std::uint32_t> all_rows(const RasterGolden& golden) {
  std::vector<std::uint32_t> rows(golden.cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

/// One channel of one view of a [views, height, width, channels] tensor.
template <class Real>
std::vector<Real> view_plane(const Tensor& tensor, std::size_t view, std::size_t channel, std::size_t channels) {
  const std::size_t pixels = tensor.shape[1] * tensor.shape[2];
  std::vector<Real> plane(pixels);
  for (std::size_t i = 0; i < pixels; ++i) plane[i] = Real(tensor.values[(view * pixels + i) * channels + channel]);
  return plane;
}

enum class Loss { color, color_depth_alpha };

template <class Real>
ReferenceUpstream<Real> upstream_of(const RasterGolden& golden, std::size_t view, Loss loss) {
  ReferenceUpstream<Real> upstream;
  for (std::size_t c = 0; c < 3; ++c) upstream.color[c] = view_plane<Real>(golden.file.at("upstream.rgb"), view, c, 3);
  if (loss == Loss::color_depth_alpha) {
    upstream.depth = view_plane<Real>(golden.file.at("upstream.depth"), view, 0, 1);
    upstream.alpha = view_plane<Real>(golden.file.at("upstream.alpha"), view, 0, 1);
  }
  return upstream;
}

/// Gradients in the layout of the golden tensors, summed over views but for mean2d_px.
using NamedGradients = std::map<std::string, std::vector<double>>;

void add(std::vector<double>& to, const std::vector<double>& values) {
  to.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) to[i] += values[i];
}

template <class Arrays>
std::vector<double> flat(const Arrays& arrays) {
  std::vector<double> out;
  for (const auto& array : arrays) out.insert(out.end(), array.begin(), array.end());
  return out;
}

/// From [N][3][16] to [N][16][3].
template <class Real>
std::vector<double> sh_as_stored_in_goldens(const std::vector<Real>& sh) {
  std::vector<double> out(sh.size());
  for (std::size_t i = 0; i < sh.size() / 48; ++i)
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 16; ++k) out[i * 48 + k * 3 + c] = double(sh[i * 48 + c * 16 + k]);
  return out;
}

template <class Real>
NamedGradients reference_gradients(const RasterGolden& golden, const BackwardOptions& options, Loss loss) {
  NamedGradients sums;
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    const auto seen = backward_reference<Real>(golden.cloud, golden.cameras[v], options,
                                               upstream_of<Real>(golden, v, loss), all_rows(golden));
    add(sums["means"], flat(seen.mean));
    add(sums["log_scales"], flat(seen.log_scale));
    add(sums["quats"], flat(seen.rotation));
    add(sums["opacity_logits"], {seen.opacity_logit.begin(), seen.opacity_logit.end()});
    add(sums["sh"], sh_as_stored_in_goldens(seen.sh));
    const auto mean2d = flat(seen.mean2d_px);
    sums["mean2d_px"].insert(sums["mean2d_px"].end(), mean2d.begin(), mean2d.end());
  }
  return sums;
}

std::vector<double> interleaved(std::initializer_list<const std::vector<float>*> components) {
  std::vector<double> out;
  for (std::size_t i = 0; i < (*components.begin())->size(); ++i)
    for (const auto* component : components) out.push_back((*component)[i]);
  return out;
}

scene::Image image_of(const RasterGolden& golden, std::initializer_list<const std::vector<float>*> planes) {
  scene::Image image(golden.cameras[0].width, golden.cameras[0].height, int(planes.size()));
  int c = 0;
  for (const auto* plane : planes) std::copy(plane->begin(), plane->end(), image.plane(c++).begin());
  return image;
}

/// By the public function, which sums views itself.
NamedGradients public_gradients(const RasterGolden& golden, const BackwardOptions& options, Loss loss) {
  NamedGradients named;
  Gradients sums;
  sums.reset(golden.cloud.size(), golden.cloud.sh_degree);
  BackwardWorkspace workspace;
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    const auto planes = upstream_of<float>(golden, v, loss);
    Upstream upstream;
    upstream.color = image_of(golden, {&planes.color[0], &planes.color[1], &planes.color[2]});
    if (loss == Loss::color_depth_alpha) {
      upstream.depth = image_of(golden, {&planes.depth});
      upstream.alpha = image_of(golden, {&planes.alpha});
    }
    backward(golden.cloud, golden.cameras[v], options, upstream, all_rows(golden), workspace, sums);
    const auto mean2d = interleaved({&sums.mean2d_x_px, &sums.mean2d_y_px});
    named["mean2d_px"].insert(named["mean2d_px"].end(), mean2d.begin(), mean2d.end());
  }
  named["means"] = interleaved({&sums.mean.x, &sums.mean.y, &sums.mean.z});
  named["log_scales"] = interleaved({&sums.log_scale.x, &sums.log_scale.y, &sums.log_scale.z});
  named["quats"] = interleaved({&sums.rotation.w, &sums.rotation.x, &sums.rotation.y, &sums.rotation.z});
  named["opacity_logits"] = {sums.opacity_logit.begin(), sums.opacity_logit.end()};
  named["sh"] = sh_as_stored_in_goldens(sums.sh);
  return named;
}

double relative_l2(const std::vector<double>& seen, const std::vector<double>& expected) {
  EXPECT_EQ(seen.size(), expected.size());
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += (seen[i] - expected[i]) * (seen[i] - expected[i]);
    norm += expected[i] * expected[i];
  }
  return std::sqrt(difference) / std::max(std::sqrt(norm), 1e-30);
}

/// Compares every tensor `<name>.<parameter>` that the golden holds; at least `at_least` of them.
template <class Tolerance>
void expect_close(const NamedGradients& seen, const RasterGolden& golden, const std::string& name, int at_least,
                  Tolerance&& tolerance) {
  int compared = 0;
  for (const auto& [parameter, values] : seen) {
    if (!golden.file.contains(name + "." + parameter)) continue;
    const Tensor& expected = golden.file.at(name + "." + parameter);
    EXPECT_LT(relative_l2(values, expected.values), tolerance(expected)) << name << "." << parameter;
    ++compared;
  }
  EXPECT_GE(compared, at_least) << name;
}

TEST_P(BackwardGoldenTest, DoubleReferenceAgreesToRounding) {
  const RasterGolden golden(GetParam());
  const BackwardOptions options{.forward = {.background = golden.background}};
  expect_close(reference_gradients<double>(golden, options, Loss::color), golden,
               prefix_of(golden) + "dense_stop.grad_rgb", 6, double_tolerance);
  expect_close(reference_gradients<double>(golden, options, Loss::color_depth_alpha), golden,
               prefix_of(golden) + "dense_stop.grad_rgb_depth_alpha", 5, double_tolerance);
}

TEST_P(BackwardGoldenTest, DoubleReferenceAgreesWithTheOtherSemantics) {
  const RasterGolden golden(GetParam());
  for (const auto& [name, semantics, clamp] :
       {std::tuple{"dense_nostop", Semantics::dense_nostop, AlphaClamp::exact},
        std::tuple{"tile16_stop", Semantics::tile16_stop, AlphaClamp::exact},
        std::tuple{"dense_stop_clampST", Semantics::dense_stop, AlphaClamp::straight_through}}) {
    const BackwardOptions options{.forward = {.background = golden.background, .semantics = semantics},
                                  .alpha_clamp = clamp};
    expect_close(reference_gradients<double>(golden, options, Loss::color), golden,
                 prefix_of(golden) + name + ".grad_rgb", 5, double_tolerance);
  }
}

TEST_P(BackwardGoldenTest, FloatReferenceIsWithinToleranceInEverySemantics) {
  const RasterGolden golden(GetParam());
  const auto tolerance = [](const Tensor&) { return float_tolerance(GetParam()); };
  for (const auto& [name, semantics, clamp] :
       {std::tuple{"dense_stop", Semantics::dense_stop, AlphaClamp::exact},
        std::tuple{"dense_nostop", Semantics::dense_nostop, AlphaClamp::exact},
        std::tuple{"tile16_stop", Semantics::tile16_stop, AlphaClamp::exact},
        std::tuple{"dense_stop_clampST", Semantics::dense_stop, AlphaClamp::straight_through}}) {
    const BackwardOptions options{.forward = {.background = golden.background, .semantics = semantics},
                                  .alpha_clamp = clamp};
    expect_close(reference_gradients<float>(golden, options, Loss::color), golden,
                 prefix_of(golden) + name + ".grad_rgb", 5, tolerance);
  }
}

TEST_P(BackwardGoldenTest, BothBackendsAreWithinTheFloatTolerance) {
  const RasterGolden golden(GetParam());
  const auto tolerance = [](const Tensor&) { return float_tolerance(GetParam()); };
  for (const Backend backend : {Backend::reference, Backend::simd}) {
    SCOPED_TRACE(backend == Backend::simd ? "simd" : "reference");
    const BackwardOptions options{.forward = {.background = golden.background, .backend = backend}};
    expect_close(public_gradients(golden, options, Loss::color), golden, prefix_of(golden) + "dense_stop.grad_rgb", 6,
                 tolerance);
    expect_close(public_gradients(golden, options, Loss::color_depth_alpha), golden,
                 prefix_of(golden) + "dense_stop.grad_rgb_depth_alpha", 5, tolerance);
  }
}

TEST_P(BackwardGoldenTest, EverySimdTargetIsWithinTheFloatTolerance) {
  const RasterGolden golden(GetParam());
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    const BackwardOptions options{.forward = {.background = golden.background}};
    expect_close(public_gradients(golden, options, Loss::color_depth_alpha), golden,
                 prefix_of(golden) + "dense_stop.grad_rgb_depth_alpha", 5,
                 [](const Tensor&) { return float_tolerance(GetParam()); });
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(BackwardGoldenDegrees, EveryShDegreeAgrees) {
  REQUIRE_SHARED(support::golden_dir() / "raster" / "a_random200.safetensors");
  const RasterGolden golden("a_random200");
  for (int degree = 0; degree <= 3; ++degree) {
    const std::string name = "deg" + std::to_string(degree) + ".dense_stop.grad_rgb";
    BackwardOptions options{.forward = {.background = golden.background, .max_sh_degree = degree}};
    expect_close(reference_gradients<double>(golden, options, Loss::color), golden, name, 2, double_tolerance);
    for (const Backend backend : {Backend::reference, Backend::simd}) {
      options.forward.backend = backend;
      expect_close(public_gradients(golden, options, Loss::color), golden, name, 2,
                   [](const Tensor&) { return float_tolerance("a_random200"); });
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, BackwardGoldenTest, testing::ValuesIn(support::raster_scenes()),
                         [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace engine::render
