#include "engine/render/backward.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/reference.h"
#include "engine/render/reference_backward.h"
#include "tests/engine/render/test_scenes.h"
#include "tests/support/gradient_matches.h"

namespace engine::render {
namespace {

using support::gradient_matches;

constexpr float y0 = 0.28209479177387814f;  // the constant SH function

std::vector<std::uint32_t> all_rows(const Layers& layers) {
  std::vector<std::uint32_t> rows(layers.size());
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

Upstream random_upstream(int width, int height, std::uint64_t seed) {
  Upstream upstream{scene::Image(width, height, 3), scene::Image(width, height, 1), scene::Image(width, height, 1)};
  Rng rng(seed);
  for (scene::Image* image : {&upstream.color, &upstream.depth, &upstream.alpha})
    for (float& value : image->data) value = rng.normal();
  return upstream;
}

BackwardOptions on(Backend backend, Semantics semantics = Semantics::dense_stop) {
  return {.forward = {.background = {0.1f, 0.5f, 0.9f}, .backend = backend, .semantics = semantics}};
}

Gradients gradients_of(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                       const Upstream& upstream, std::span<const std::uint32_t> rows) {
  Gradients out;
  out.reset(rows.size(), layers.base->sh_degree);
  BackwardWorkspace workspace;
  backward(layers, camera, options, upstream, rows, workspace, out);
  return out;
}

Gradients gradients_of(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                       const Upstream& upstream) {
  return gradients_of(layers, camera, options, upstream, all_rows(layers));
}

struct Column {
  const char* name;
  std::vector<float> values;
};

std::vector<Column> columns_of(const Gradients& g) {
  return {{"mean.x", g.mean.x},
          {"mean.y", g.mean.y},
          {"mean.z", g.mean.z},
          {"log_scale.x", g.log_scale.x},
          {"log_scale.y", g.log_scale.y},
          {"log_scale.z", g.log_scale.z},
          {"rotation.w", g.rotation.w},
          {"rotation.x", g.rotation.x},
          {"rotation.y", g.rotation.y},
          {"rotation.z", g.rotation.z},
          {"opacity_logit", g.opacity_logit},
          {"sh", g.sh},
          {"mean2d_x_px", g.mean2d_x_px},
          {"mean2d_y_px", g.mean2d_y_px}};
}

void expect_same_bytes(const Gradients& seen, const Gradients& expected) {
  const auto a = columns_of(seen), b = columns_of(expected);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].values, b[i].values) << a[i].name;
}

void expect_finite(const Gradients& seen) {
  for (const Column& column : columns_of(seen)) {
    const auto bad = first_not_finite(column.values);
    EXPECT_FALSE(bad) << column.name << '[' << bad.value_or(0) << ']';
  }
}

double relative_l2(const std::vector<float>& seen, const std::vector<float>& expected) {
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += std::pow(double(seen[i]) - double(expected[i]), 2);
    norm += std::pow(double(expected[i]), 2);
  }
  return std::sqrt(difference) / std::max(std::sqrt(norm), 1e-30);
}

void expect_close(const Gradients& seen, const Gradients& expected, double tolerance) {
  const auto a = columns_of(seen), b = columns_of(expected);
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].values.size(), b[i].values.size());
    EXPECT_LE(relative_l2(a[i].values, b[i].values), tolerance) << a[i].name;
  }
}

// Against numbers ----------------------------------------------------------------------------------------------------

/// Five Gaussians that cover a small picture, each of which every pixel blends with an alpha well within its cuts.
/// Values lie on a grid, so that steps of 1/512 and their doubles are exact in float.
scene::GaussianCloud smooth_cloud() {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 3;
  cloud.resize(5);
  Rng rng(7);
  const auto on_grid = [&](float low, float high) { return std::round(rng.uniform(low, high) * 512) / 512; };
  for (std::size_t i = 0; i < 5; ++i) {
    cloud.mean.set(i, {on_grid(-1, 1), on_grid(-1, 1), 3 + float(i) + on_grid(0, 0.5f)});
    cloud.log_scale.set(i, {on_grid(0.7f, 1.5f), on_grid(0.7f, 1.5f), on_grid(0.7f, 1.5f)});
    cloud.rotation.set(i, {on_grid(0.5f, 1), on_grid(-1, 1), on_grid(-1, 1), on_grid(-1, 1)});
    cloud.opacity_logit[i] = on_grid(-1, 1);
  }
  for (float& value : cloud.sh) value = on_grid(-0.06f, 0.06f);
  return cloud;
}

std::vector<double> values_of(const scene::GaussianCloud& cloud) {
  std::vector<double> x;
  for (const auto* column :
       {&cloud.mean.x, &cloud.mean.y, &cloud.mean.z, &cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z,
        &cloud.rotation.w, &cloud.rotation.x, &cloud.rotation.y, &cloud.rotation.z, &cloud.opacity_logit, &cloud.sh})
    x.insert(x.end(), column->begin(), column->end());
  return x;
}

scene::GaussianCloud with_values(scene::GaussianCloud cloud, const std::vector<double>& x) {
  auto next = x.begin();
  for (auto* column :
       {&cloud.mean.x, &cloud.mean.y, &cloud.mean.z, &cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z,
        &cloud.rotation.w, &cloud.rotation.x, &cloud.rotation.y, &cloud.rotation.z, &cloud.opacity_logit, &cloud.sh})
    for (float& value : *column) value = float(*next++);
  return cloud;
}

ReferenceUpstream<double> planes_of(const Upstream& upstream) {
  const auto plane = [](const scene::Image& image, int c) {
    const auto from = image.plane(c);
    return std::vector<double>(from.begin(), from.end());
  };
  return {{plane(upstream.color, 0), plane(upstream.color, 1), plane(upstream.color, 2)},
          plane(upstream.depth, 0),
          plane(upstream.alpha, 0)};
}

double loss(const ReferencePictures<double>& pictures, const ReferenceUpstream<double>& upstream) {
  double sum = 0;
  for (std::size_t i = 0; i < pictures.alpha.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) sum += pictures.color[c][i] * upstream.color[c][i];
    sum += pictures.depth[i] * upstream.depth[i] + pictures.alpha[i] * upstream.alpha[i];
  }
  return sum;
}

TEST(BackwardReference, MatchesCentralDifferencesOfTheWholePassInEveryStoredValue) {
  auto camera = scene::look_at({0.1, -0.2, 0}, {0.2, 0.1, 4}, {0.1, -1, 0}, 0.7, 10, 7);
  camera.cx += 0.7;
  const auto cloud = smooth_cloud();
  const auto upstream = planes_of(random_upstream(10, 7, 3));
  const BackwardOptions options = on(Backend::reference);
  for (const int count : forward_reference<double>(cloud, camera, options.forward, {}).contributions)
    ASSERT_EQ(count, 5) << "the scene is not clear of the cuts";

  const auto v = backward_reference<double>(cloud, camera, options, upstream, all_rows(cloud));
  std::vector<double> gradient;
  const auto append = [&](const auto& arrays) {  // component by component, as values_of()
    for (std::size_t k = 0; k < arrays[0].size(); ++k)
      for (const auto& array : arrays) gradient.push_back(array[k]);
  };
  append(v.mean), append(v.log_scale), append(v.rotation);
  gradient.insert(gradient.end(), v.opacity_logit.begin(), v.opacity_logit.end());
  gradient.insert(gradient.end(), v.sh.begin(), v.sh.end());
  EXPECT_TRUE(gradient_matches(
      [&](const std::vector<double>& x) {
        return loss(forward_reference<double>(with_values(cloud, x), camera, options.forward, {}), upstream);
      },
      values_of(cloud), gradient, {.step = 1.0 / 512}));
}

TEST(BackwardReference, TheGradientOfASplatsPlaceInThePictureIsThatOfShiftingThePrincipalPoint) {
  const auto cloud = [] {
    scene::GaussianCloud one;
    add_on_axis(one, 3, 0.3f, 0.8f, 0.0f);
    return one;
  }();
  const auto camera = scene::look_at({0, 0, 0}, {0.1, 0.05, 1}, {0, -1, 0}, 1.0, 9, 8);
  const auto upstream = planes_of(random_upstream(9, 8, 4));
  const BackwardOptions options = on(Backend::reference);
  const auto v = backward_reference<double>(cloud, camera, options, upstream, all_rows(cloud));
  // Wide enough that the clamp of the field of view, which moves with the principal point, is far away.
  EXPECT_TRUE(gradient_matches(
      [&](const std::vector<double>& x) {
        auto shifted = camera;
        shifted.cx += x[0], shifted.cy += x[1];
        return loss(forward_reference<double>(cloud, shifted, options.forward, {}), upstream);
      },
      {0, 0}, {v.mean2d_px[0][0], v.mean2d_px[0][1]}));
}

// What every backend keeps -------------------------------------------------------------------------------------------

class BackwardTest : public testing::TestWithParam<Backend> {};
INSTANTIATE_TEST_SUITE_P(Backends, BackwardTest, testing::Values(Backend::reference, Backend::simd),
                         [](const auto& backend) { return backend.param == Backend::simd ? "simd" : "reference"; });

TEST_P(BackwardTest, AnEmptySceneAndAnEmptyChoiceOfRowsHaveNoGradients) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 1);
  const scene::GaussianCloud empty;
  EXPECT_EQ(gradients_of(empty, camera, on(GetParam()), upstream).size(), 0u);
  const auto cloud = cloud_in_view(50, 1);
  EXPECT_EQ(gradients_of(cloud, camera, on(GetParam()), upstream, {}).size(), 0u);
}

TEST_P(BackwardTest, WithoutUpstreamEveryGradientIsZero) {
  const auto cloud = cloud_in_view(50, 2);
  Gradients zero;
  zero.reset(cloud.size(), cloud.sh_degree);
  expect_same_bytes(gradients_of(cloud, off_centre_camera(), on(GetParam()), {}), zero);
}

TEST_P(BackwardTest, RowsThatMayChangeHaveTheGradientsTheyHaveAmongAll) {
  const auto cloud = cloud_in_view(400, 3);
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 2);
  const auto all = gradients_of(cloud, camera, on(GetParam()), upstream);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 5; row < 400; row += 7) rows.push_back(row);
  const auto some = gradients_of(cloud, camera, on(GetParam()), upstream, rows);
  Gradients expected;
  expected.reset(rows.size(), cloud.sh_degree);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const std::size_t row = rows[r];
    expected.mean.set(r, all.mean.get(row));
    expected.log_scale.set(r, all.log_scale.get(row));
    expected.rotation.set(r, all.rotation.get(row));
    expected.opacity_logit[r] = all.opacity_logit[row];
    expected.mean2d_x_px[r] = all.mean2d_x_px[row], expected.mean2d_y_px[r] = all.mean2d_y_px[row];
    std::copy_n(all.sh.begin() + std::ptrdiff_t(48 * row), 48, expected.sh.begin() + std::ptrdiff_t(48 * r));
  }
  expect_same_bytes(some, expected);
}

TEST_P(BackwardTest, RowsLaidOverABaseHaveTheGradientsOfTheMergedCloud) {
  const auto base = cloud_in_view(300, 4), top = cloud_in_view(40, 5);
  const std::vector<std::uint32_t> changed{3, 50, 51, 299}, hidden{3, 20, 50, 51, 130, 299};
  Layers layers(base);
  layers.top = &top, layers.hidden = hidden, layers.changed = changed;
  const auto merged = scene::flatten(base, scene::Overlay{.removed = {20, 130}, .changed = changed, .rows = top});
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 3);
  // The merged cloud has the changed rows in their places: compare row by row.
  const auto all = gradients_of(merged, camera, on(GetParam()), upstream);
  std::vector<std::uint32_t> rows(top.size());
  std::iota(rows.begin(), rows.end(), std::uint32_t(base.size()));
  const auto seen = gradients_of(layers, camera, on(GetParam()), upstream, rows);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const std::size_t row = layers.merged_row(rows[r]);
    EXPECT_EQ(seen.mean.get(r), all.mean.get(row)) << r;
    EXPECT_EQ(seen.opacity_logit[r], all.opacity_logit[row]) << r;
    EXPECT_EQ(seen.sh[48 * r], all.sh[48 * row]) << r;
  }
}

TEST_P(BackwardTest, OfTwoViewsTheGradientsSumAndThePlaceInThePictureIsThatOfTheLast) {
  const auto cloud = cloud_in_view(100, 6);
  const auto a = off_centre_camera(), b = scene::look_at({1, 0.5, -1}, {0, 0, 3}, {0, -1, 0}, 0.8, 48, 64);
  const auto upstream_a = random_upstream(a.width, a.height, 4), upstream_b = random_upstream(b.width, b.height, 5);
  const auto of_a = gradients_of(cloud, a, on(GetParam()), upstream_a);
  const auto of_b = gradients_of(cloud, b, on(GetParam()), upstream_b);
  Gradients sum;
  sum.reset(cloud.size(), cloud.sh_degree);
  BackwardWorkspace workspace;
  backward(cloud, a, on(GetParam()), upstream_a, all_rows(cloud), workspace, sum);
  backward(cloud, b, on(GetParam()), upstream_b, all_rows(cloud), workspace, sum);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(sum.mean.get(i), of_a.mean.get(i) + of_b.mean.get(i));
    EXPECT_EQ(sum.rotation.w[i], of_a.rotation.w[i] + of_b.rotation.w[i]);
    EXPECT_EQ(sum.opacity_logit[i], of_a.opacity_logit[i] + of_b.opacity_logit[i]);
  }
  EXPECT_EQ(sum.mean2d_x_px, of_b.mean2d_x_px);
  EXPECT_EQ(sum.mean2d_y_px, of_b.mean2d_y_px);
}

TEST_P(BackwardTest, ARectangleOrTilesHaveTheGradientsOfTheWholePictureWithNothingElsewhere) {
  const auto cloud = cloud_in_view(300, 7);
  const auto camera = off_centre_camera();
  const auto whole = random_upstream(camera.width, camera.height, 6);
  const auto zero_unless = [&](auto&& inside) {
    Upstream upstream = whole;
    for (scene::Image* image : {&upstream.color, &upstream.depth, &upstream.alpha})
      for (int c = 0; c < image->channels; ++c)
        for (int y = 0; y < image->height; ++y)
          for (int x = 0; x < image->width; ++x)
            if (!inside(x, y)) image->at(x, y, c) = 0;
    return upstream;
  };
  BackwardOptions options = on(GetParam());
  const scene::Rect rect{13, 7, 50, 49};
  options.forward.rect = rect;
  Upstream cut{scene::Image(37, 42, 3), scene::Image(37, 42, 1), scene::Image(37, 42, 1)};
  for (const auto& [to, from] :
       {std::pair{&cut.color, &whole.color}, {&cut.depth, &whole.depth}, {&cut.alpha, &whole.alpha}})
    for (int c = 0; c < to->channels; ++c)
      for (int y = 0; y < 42; ++y)
        for (int x = 0; x < 37; ++x) to->at(x, y, c) = from->at(x + 13, y + 7, c);
  const auto in_rect =
      zero_unless([&](int x, int y) { return x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1; });
  expect_close(gradients_of(cloud, camera, options, cut), gradients_of(cloud, camera, on(GetParam()), in_rect), 1e-6);

  options = on(GetParam());
  options.forward.tiles = {1, 5, 7, 19};
  const auto in_tiles = zero_unless([&](int x, int y) {
    const auto tile = std::uint32_t(y / tile_size * tile_columns(camera.width) + x / tile_size);
    return std::find(options.forward.tiles.begin(), options.forward.tiles.end(), tile) != options.forward.tiles.end();
  });
  expect_close(gradients_of(cloud, camera, options, whole), gradients_of(cloud, camera, on(GetParam()), in_tiles),
               1e-6);
}

TEST_P(BackwardTest, TheGradientOfARotationHasNoComponentAlongTheQuaternion) {
  const auto cloud = cloud_in_view(300, 8);
  const auto camera = off_centre_camera();
  const auto seen = gradients_of(cloud, camera, on(GetParam()), random_upstream(camera.width, camera.height, 7));
  std::size_t turned = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Quat q = cloud.rotation.get(i), v = seen.rotation.get(i);
    const double along = double(q.w) * v.w + double(q.x) * v.x + double(q.y) * v.y + double(q.z) * v.z;
    EXPECT_LE(std::abs(along), 1e-5 * glm::length(q) * glm::length(v) + 1e-12) << i;
    turned += glm::length(v) > 0;
  }
  EXPECT_GT(turned, 100u);
}

TEST_P(BackwardTest, AUsedWorkspaceGivesTheBytesOfANewOne) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 8);
  BackwardWorkspace workspace;
  for (const std::size_t n : {500u, 20u, 300u}) {
    const auto cloud = cloud_in_view(n, n);
    Gradients out;
    out.reset(n, cloud.sh_degree);
    backward(cloud, camera, on(GetParam()), upstream, all_rows(cloud), workspace, out);
    expect_same_bytes(out, gradients_of(cloud, camera, on(GetParam()), upstream));
  }
}

TEST_P(BackwardTest, FarFromTheOriginTheGradientsAreThoseAtTheOrigin) {
  // At 2^20 world units a float steps by 1/8: means are put on that grid, so that both scenes hold the same numbers.
  auto cloud = cloud_in_view(200, 9);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3 mean = cloud.mean.get(i) * 20.0f;
    cloud.mean.set(i, {std::round(mean.x * 8) / 8, std::round(mean.y * 8) / 8, std::round(mean.z * 8) / 8});
    cloud.log_scale.set(i, cloud.log_scale.get(i) + 3.0f);
  }
  const DVec3 offset(1048576, -1048576, 1048576);
  auto moved = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i) moved.mean.set(i, cloud.mean.get(i) + Vec3(offset));
  const DVec3 eye(1.125, -0.75, -3.25), target(0.25, 0.125, 40);
  const auto near = scene::look_at(eye, target, {0, -1, 0}, 1.0, 70, 50);
  const auto far = scene::look_at(eye + offset, target + offset, {0, -1, 0}, 1.0, 70, 50);
  const auto upstream = random_upstream(70, 50, 9);
  expect_close(gradients_of(moved, far, on(GetParam()), upstream), gradients_of(cloud, near, on(GetParam()), upstream),
               1e-3);
}

// Kinks --------------------------------------------------------------------------------------------------------------
// Those of projection and colour (near plane, field of view, colour, log scale, logit, quaternion guard) are in
// project_vjp_test.cc, that of alpha at 0.99 itself in blend_test.cc.

/// Gradients of the sum of the three channels at the one pixel of one_pixel_camera(), before black.
Gradients at_one_pixel(const scene::GaussianCloud& cloud, BackwardOptions options) {
  options.forward.background = Vec3(0.0f);
  return gradients_of(cloud, one_pixel_camera(), options, {.color = scene::Image(1, 1, 3, 1.0f)});
}

float sigmoid(float logit) { return 1 / (1 + std::exp(-logit)); }

TEST_P(BackwardTest, From1Over255OnTheDerivativeIsThatOfTheBlendedSideAndBelowThereIsNone) {
  const float cut = -std::log(254.0f);  // the logit whose opacity is 1/255
  scene::GaussianCloud above, below;
  add_on_axis(above, 2, cut + 1e-4f, 0.6f);
  add_on_axis(below, 2, cut - 1e-4f, 0.6f);
  const float slope = 3 * 0.6f * sigmoid(cut) * (1 - sigmoid(cut));
  EXPECT_NEAR(at_one_pixel(above, on(GetParam())).opacity_logit[0], slope, 1e-3f * slope)
      << "the jump itself is not differentiated";
  EXPECT_EQ(at_one_pixel(below, on(GetParam())).opacity_logit[0], 0.0f);
  EXPECT_EQ(at_one_pixel(below, on(GetParam())).sh[0], 0.0f);
}

TEST_P(BackwardTest, AlphaClampedAt99PercentStopsTheGradientOfOpacityAndShapeButNotOfColour) {
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 2, 6, 0.6f);
  const auto seen = at_one_pixel(cloud, on(GetParam()));
  EXPECT_EQ(seen.opacity_logit[0], 0.0f);
  EXPECT_EQ(seen.log_scale.get(0), Vec3(0.0f));
  EXPECT_EQ(seen.mean.get(0), Vec3(0.0f));
  EXPECT_NEAR(seen.sh[0], 0.99f * y0, 1e-6f);
}

TEST(BackwardReference, ToldToPassStraightThroughAClampedAlphaHasTheGradientOfTheRawOne) {
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 2, 6, 0.6f);
  BackwardOptions options = on(Backend::reference);
  options.alpha_clamp = AlphaClamp::straight_through;
  EXPECT_NEAR(at_one_pixel(cloud, options).opacity_logit[0], 3 * 0.6f * sigmoid(6) * sigmoid(-6), 1e-6f);
}

TEST_P(BackwardTest, TheSplatAtWhichARayEndsAndAllBehindItHaveNoGradientAndThoseBeforeDoNotSeeThem) {
  scene::GaussianCloud before;
  add_on_axis(before, 1, 6, 0.6f);                        // alpha 0.99
  add_on_axis(before, 2, std::log(0.98f / 0.02f), 0.7f);  // leaves T = 2e-4
  auto all = before;
  add_on_axis(all, 3, std::log(0.9f / 0.1f), 0.8f);  // would leave 2e-5
  add_on_axis(all, 4, std::log(0.3f / 0.7f), 0.9f);  // would leave 1.4e-4, had the ray not ended
  const auto expected = at_one_pixel(before, on(GetParam())), seen = at_one_pixel(all, on(GetParam()));
  for (const std::size_t i : {0u, 1u}) {
    EXPECT_EQ(seen.opacity_logit[i], expected.opacity_logit[i]);
    EXPECT_EQ(seen.mean.get(i), expected.mean.get(i));
  }
  EXPECT_NEAR(seen.opacity_logit[1], 0.01f * 3 * 0.7f * 0.98f * 0.02f, 1e-7f);
  for (const std::size_t i : {2u, 3u}) {
    EXPECT_EQ(seen.opacity_logit[i], 0.0f);
    EXPECT_EQ(seen.sh[3 * i], 0.0f);
    EXPECT_EQ(seen.mean.get(i), Vec3(0.0f));
  }
}

TEST(BackwardReference, WithoutAnEndOfRaysEvenTheFarthestSplatHasAGradient) {
  scene::GaussianCloud cloud;
  for (int i = 0; i < 30; ++i) add_on_axis(cloud, 1.0f + float(i), 6, 0.6f);  // T = 1e-60 at last
  add_on_axis(cloud, 40, 0, 0.8f);
  const auto camera = one_pixel_camera();
  const auto rows = all_rows(cloud);
  const BackwardOptions options = on(Backend::reference, Semantics::dense_nostop);
  const auto v = backward_reference<double>(cloud, camera, options, {.color = {{{1.0}, {1.0}, {1.0}}}}, rows);
  EXPECT_NEAR(v.sh[3 * 30] / (1e-60 * 0.5 * y0), 1, 1e-6);
  EXPECT_NEAR(v.sh[0], 0.99 * y0, 1e-7);
  // In float the transmittance underflows on the way; the splats before that do not suffer.
  const auto f = backward_reference<float>(cloud, camera, options, {.color = {{{1.0f}, {1.0f}, {1.0f}}}}, rows);
  EXPECT_NEAR(f.sh[0], 0.99f * y0, 1e-6f);
  EXPECT_NEAR(f.sh[3] / (0.0099f * y0), 1, 1e-5f);
}

TEST_P(BackwardTest, AtTheNearPlaneItselfThereIsNoGradientAndJustBehindItThereIs) {
  scene::GaussianCloud at, behind;
  add_on_axis(at, 0.2f, 0, 0.6f);
  add_on_axis(behind, std::nextafter(0.2f, 1.0f), 0, 0.6f);
  EXPECT_EQ(at_one_pixel(at, on(GetParam())).opacity_logit[0], 0.0f);
  EXPECT_NEAR(at_one_pixel(behind, on(GetParam())).opacity_logit[0], 3 * 0.6f * 0.25f, 1e-5f);
}

TEST_P(BackwardTest, AtTheEdgeOfWhatStoredValuesSaturateAtTheDerivativeIsTheOneFromInsideAndBeyondThereIsNone) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 10);
  const auto gradients = [&](auto&& change) {
    scene::GaussianCloud cloud;
    add_on_axis(cloud, 2, 0.3f, 0.6f, -2.0f);
    change(cloud);
    return gradients_of(cloud, camera, on(GetParam()), upstream);
  };
  const auto scale = [&](float value) {
    return gradients([&](auto& cloud) { cloud.log_scale.x[0] = value; }).log_scale.x[0];
  };
  for (const float sign : {-1.0f, 1.0f}) {
    EXPECT_NE(scale(sign * 20), 0.0f);
    EXPECT_EQ(scale(sign * std::nextafter(20.0f, 30.0f)), 0.0f);
  }
  const auto logit = [&](float value) {
    return gradients([&](auto& cloud) { cloud.opacity_logit[0] = value; }).opacity_logit[0];
  };
  EXPECT_NE(logit(30), 0.0f) << "around the pixels that are clamped at 0.99";
  EXPECT_EQ(logit(std::nextafter(30.0f, 40.0f)), 0.0f);

  float black = -0.5f / y0;  // the coefficient whose colour is exactly zero in float
  while (0.5f + black * y0 < 0) black = std::nextafter(black, 0.0f);
  while (0.5f + black * y0 > 0) black = std::nextafter(black, -9.0f);
  ASSERT_EQ(0.5f + black * y0, 0.0f);
  const auto dc = [&](float value) { return gradients([&](auto& cloud) { cloud.sh[0] = value; }).sh[0]; };
  EXPECT_NEAR(dc(black), dc(0), 1e-4f * std::abs(dc(0))) << "a black Gaussian can brighten";
  EXPECT_EQ(dc(black - 1e-3f), 0.0f);

  for (const float length : {0.0f, 1e-13f})
    EXPECT_EQ(glm::length(gradients([&](auto& cloud) {
                            cloud.log_scale.x[0] = -1;
                            cloud.rotation.set(0, {length, 0, 0.5f * length, length});
                          }).rotation.get(0)),
              0.0f);
}

TEST_P(BackwardTest, BeyondTheFieldOfViewTheShapeOfASplatDoesNotFollowItsMean) {
  // So far outside that only the clamped place of the Jacobian matters: log scales must have gradients there, too.
  const auto camera = off_centre_camera();
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 1, 2, 0.6f, 0.5f);
  cloud.mean.x[0] = 2.5f;
  const auto seen = gradients_of(cloud, camera, on(GetParam()), random_upstream(camera.width, camera.height, 11));
  const auto expected =
      gradients_of(cloud, camera, on(Backend::reference), random_upstream(camera.width, camera.height, 11));
  EXPECT_NE(seen.log_scale.x[0], 0.0f);
  EXPECT_NEAR(seen.mean.x[0], expected.mean.x[0], 1e-4f * std::abs(expected.mean.x[0]));
  EXPECT_NEAR(seen.mean.z[0], expected.mean.z[0], 1e-4f * std::abs(expected.mean.z[0]));
}

TEST_P(BackwardTest, DepthOrderIsTakenAsItIs) {
  const auto two = [](float depth_of_first, float depth_of_second) {
    scene::GaussianCloud cloud;
    add_on_axis(cloud, depth_of_first, 0, 0.9f);
    add_on_axis(cloud, depth_of_second, 0, 0.2f);
    return cloud;
  };
  const auto tie = at_one_pixel(two(2, 2), on(GetParam()));
  const auto first_nearer = at_one_pixel(two(2, 2.00001f), on(GetParam()));
  const auto second_nearer = at_one_pixel(two(2.00001f, 2), on(GetParam()));
  EXPECT_NEAR(tie.opacity_logit[0], 3 * 0.25f * (0.9f - 0.5f * 0.2f), 1e-5f) << "ties blend in row order";
  EXPECT_NEAR(tie.opacity_logit[0], first_nearer.opacity_logit[0], 1e-4f);
  EXPECT_NEAR(second_nearer.opacity_logit[0], 3 * 0.25f * 0.5f * 0.9f, 1e-4f);
  // That a step in depth would swap them, and brighten the pixel, no gradient says.
  EXPECT_NEAR(tie.mean.z[0], first_nearer.mean.z[0], 1e-4f);
}

TEST(BackwardReference, TheTilesASplatReachesAreTakenAsTheyAre) {
  // Sigma 7.9 px at x = 8.9: three sigmas, rounded up, end at tile 1, while alpha is above 1/255 up to column 35.
  auto camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 64, 16);
  camera.fx = camera.fy = 10;
  camera.cx = 8.9 + 0.5, camera.cy = 8;
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 1, 4, 0.6f, std::log(0.79f));
  Upstream beyond{.color = scene::Image(64, 16, 3)};
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 16; ++y)
      for (int x = 32; x < 64; ++x) beyond.color.at(x, y, c) = 1;
  const auto with_tiles = gradients_of(cloud, camera, on(Backend::reference, Semantics::tile16_stop), beyond);
  const auto dense = gradients_of(cloud, camera, on(Backend::reference), beyond);
  EXPECT_EQ(with_tiles.opacity_logit[0], 0.0f);
  EXPECT_EQ(with_tiles.mean.get(0), Vec3(0.0f)) << "that a step to the right would reach tile 2, no gradient says";
  EXPECT_NE(dense.opacity_logit[0], 0.0f);
  EXPECT_GT(std::abs(dense.mean.x[0]), 0.0f);
}

// Numbers that float finds hard --------------------------------------------------------------------------------------

class BackwardExtremeTest : public testing::TestWithParam<Extreme> {};
INSTANTIATE_TEST_SUITE_P(Extremes, BackwardExtremeTest, testing::ValuesIn(extremes()),
                         [](const auto& extreme) { return extreme.param.name; });

TEST_P(BackwardExtremeTest, GivesFiniteGradients) {
  auto cloud = cloud_in_view(97, 11);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i % 3 != 0) GetParam().spoil(cloud, i);
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 12);
  for (const Backend backend : {Backend::reference, Backend::simd}) {
    SCOPED_TRACE(backend == Backend::simd ? "simd" : "reference");
    expect_finite(gradients_of(cloud, camera, on(backend), upstream));
  }
}

// The SIMD backend against the reference -----------------------------------------------------------------------------

/// How far a row's gradient is from the expected one, relative to the latter and, lest tiny ones count, to the mean.
std::vector<double> row_differences(const std::vector<float>& seen, const std::vector<float>& expected,
                                    std::size_t stride = 1) {
  double mean = 0;
  for (const float value : expected) mean += std::abs(double(value)) / double(expected.size());
  std::vector<double> out;
  for (std::size_t i = 0; i < expected.size(); i += stride) {
    double worst = 0;
    for (std::size_t k = i; k < i + stride; ++k)
      worst = std::max(worst, std::abs(double(seen[k]) - double(expected[k])) / (std::abs(double(expected[k])) + mean));
    out.push_back(worst);
  }
  return out;
}

TEST(Backward, BackendsAgreeOnACrowdedSceneButForRareFlipsAtACut) {
  const auto cloud = cloud_in_view(3000, 12);
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 13);
  const auto seen = columns_of(gradients_of(cloud, camera, on(Backend::simd), upstream));
  const auto expected = columns_of(gradients_of(cloud, camera, on(Backend::reference), upstream));
  for (std::size_t c = 0; c < seen.size(); ++c) {
    // A pixel whose alpha is 1/255 to rounding is blended by one and not by the other.
    std::size_t flips = 0;
    for (const double difference :
         row_differences(seen[c].values, expected[c].values, expected[c].values.size() / cloud.size()))
      flips += difference > 1e-3;
    EXPECT_LE(flips, cloud.size() / 200) << seen[c].name;
    EXPECT_LE(relative_l2(seen[c].values, expected[c].values), 1e-2) << seen[c].name;
  }
}

TEST(Backward, ListsLongerThanManyBatchesAndRaysThatEndEarlyAgreeWithTheReference) {
  // 2000 splats over a picture of four tiles: rays end within the first hundreds; the list goes on.
  auto cloud = cloud_in_view(2000, 15, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.log_scale.set(i, {-0.5f, -1.0f, -1.5f});
  const auto camera = off_centre_camera(30, 20);
  const auto upstream = random_upstream(30, 20, 16);
  expect_close(gradients_of(cloud, camera, on(Backend::simd), upstream),
               gradients_of(cloud, camera, on(Backend::reference), upstream), 2e-3);
}

TEST(Backward, TilesWithoutUpstreamAndTilesThatNoRowReachesChangeNothing) {
  // The rows are those on the left; upstream is on the left half. Nothing of the right half may be missing or double.
  const auto cloud = cloud_in_view(800, 17);
  const auto camera = off_centre_camera(96, 64);
  Upstream upstream = random_upstream(96, 64, 18);
  for (scene::Image* image : {&upstream.color, &upstream.depth, &upstream.alpha})
    for (int c = 0; c < image->channels; ++c)
      for (int y = 0; y < 64; ++y)
        for (int x = 48; x < 96; ++x) image->at(x, y, c) = 0;
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < cloud.size(); ++i)
    if (cloud.mean.x[i] < -0.2f * cloud.mean.z[i]) rows.push_back(i);
  expect_close(gradients_of(cloud, camera, on(Backend::simd), upstream, rows),
               gradients_of(cloud, camera, on(Backend::reference), upstream, rows), 2e-3);
}

TEST(Backward, IsTheSameToTheBitForAnyNumberOfThreads) {
  const auto cloud = cloud_in_view(5000, 13);
  const auto camera = off_centre_camera(300, 200);
  const auto upstream = random_upstream(camera.width, camera.height, 14);
  std::vector<Gradients> seen(3);
  for (const std::size_t k : {0u, 1u, 2u}) {
    WorkArena arena(1 << k);
    arena.run([&] { seen[k] = gradients_of(cloud, camera, on(Backend::simd), upstream); });
  }
  expect_same_bytes(seen[1], seen[0]);
  expect_same_bytes(seen[2], seen[0]);
}

}  // namespace
}  // namespace engine::render
