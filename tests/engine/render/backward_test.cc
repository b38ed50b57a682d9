#include "engine/render/backward.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/backward_stages.h"
#include "engine/render/frame.h"
#include "engine/render/reference/backward_reference.h"
#include "engine/render/reference/forward_reference.h"
#include "engine/render/splats.h"
#include "tests/engine/render/gradients.h"
#include "tests/engine/render/test_scenes.h"
#include "tests/support/gradient_matches.h"

namespace engine::render {
namespace {

using support::gradient_matches;

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

TEST(BackwardReference, MatchesCentralDifferencesOfTheWholePassInEveryStoredValue) {
  auto camera = scene::look_at({0.1, -0.2, 0}, {0.2, 0.1, 4}, {0.1, -1, 0}, 0.7, 10, 7);
  camera.cx += 0.7;
  const auto cloud = smooth_cloud();
  const auto upstream = planes_of(random_upstream(10, 7, 3));
  const BackwardOptions options = on(Backend::reference);
  for (const int count : forward_reference<double>(cloud, camera, options.forward, {}).contributions)
    ASSERT_EQ(count, 5) << "the scene is not clear of the cuts";

  const auto v = backward_reference<double>(cloud, camera, options, upstream, all_rows(cloud));
  EXPECT_TRUE(gradient_matches(
      [&](const std::vector<double>& x) {
        return loss(forward_reference<double>(with_values(cloud, x), camera, options.forward, {}), upstream);
      },
      values_of(cloud), values_of(v), {.step = 1.0 / 512}));
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

TEST_P(BackwardTest, RowsThatAViewShowsNothingOfHaveNoGradientBesideThoseItShows) {
  // At the very camera, behind it, beside the picture, and too faint to show: among rows that are seen, so that a
  // vector of rows holds both.
  auto cloud = cloud_in_view(40, 35);
  const auto camera = off_centre_camera();
  for (std::size_t i = 0; i < cloud.size(); i += 2) {
    const std::size_t kind = i / 2 % 4;
    if (kind == 0) cloud.mean.set(i, {0, 0, 0});
    if (kind == 1) cloud.mean.set(i, {0, 0, -1});
    if (kind == 2) cloud.mean.set(i, {50, 0, 2}), cloud.log_scale.set(i, Vec3(-4.0f));
    if (kind == 3) cloud.opacity_logit[i] = -7;
  }
  Gradients gradients;
  gradients.reset(cloud.size(), cloud.sh_degree);
  gradients.mean2d_x_px.assign(cloud.size(), 5.0f), gradients.mean2d_y_px.assign(cloud.size(), 5.0f);
  std::vector<std::uint32_t> rows(cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  BackwardWorkspace workspace;
  backward(cloud, camera, on(GetParam()), random_upstream(camera.width, camera.height, 36), rows, workspace, gradients);
  expect_finite(gradients);
  for (const auto& column : columns_of(gradients)) {
    const std::size_t stride = column.values.size() / cloud.size();
    for (std::size_t i = 0; i < cloud.size(); i += 2)
      for (std::size_t k = 0; k < stride; ++k)
        ASSERT_EQ(column.values[i * stride + k], 0.0f) << column.name << " " << i;
  }
  std::size_t moved = 0;
  for (std::size_t i = 1; i < cloud.size(); i += 2) moved += gradients.mean.x[i] != 0;
  EXPECT_GT(moved, cloud.size() / 4);
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
  struct Pass {
    std::size_t rows, of;  ///< Every `of`-th row may change.
    bool number = true;    ///< Is upstream one?
  };
  std::vector<Pass> passes = {{500, 1}, {20, 1}, {300, 3}, {300, 1, false}, {300, 2}};
  if (GetParam() == Backend::simd)  // several blocks of rows, and groups of tiles
    passes.insert(passes.end(),
                  {{5000, 1}, {3000, 3}, {20'500, 1}, {20'500, 1, false}, {20, 1}, {2100, 7}, {20'500, 1}});
  BackwardWorkspace workspace;
  for (const Pass& pass : passes) {
    SCOPED_TRACE(std::to_string(pass.rows) + ", every " + std::to_string(pass.of));
    const auto camera = pass.rows == 20 ? off_centre_camera(150, 33) : off_centre_camera();
    auto upstream = random_upstream(camera.width, camera.height, 8);
    const auto cloud = cloud_in_view(pass.rows, pass.rows);
    std::vector<std::uint32_t> rows;
    for (std::size_t row = 0; row < cloud.size(); row += pass.of) rows.push_back(std::uint32_t(row));
    Gradients out;
    out.reset(rows.size(), cloud.sh_degree);
    if (!pass.number) upstream.color.data.assign(upstream.color.data.size(), NAN);
    backward(cloud, camera, on(GetParam()), upstream, rows, workspace, out);
    if (pass.number) expect_same_bytes(out, gradients_of(cloud, camera, on(GetParam()), upstream, rows));
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

TEST(Backward, BackendsAgreeForEveryDegreeThatACloudStoresAndEveryDegreeThatIsUsed) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 23);
  const std::string best = simd_target();
  for (const std::string& target : simd_targets())
    for (int stored = 0; stored <= scene::max_sh_degree; ++stored) {
      const auto cloud = cloud_in_view(300, 22, stored);
      for (int used = 0; used <= stored; ++used) {
        SCOPED_TRACE(testing::Message() << target << ", degree " << used << " of " << stored);
        ASSERT_TRUE(pin_simd_target(target));
        BackwardOptions simd = on(Backend::simd), reference = on(Backend::reference);
        simd.forward.max_sh_degree = reference.forward.max_sh_degree = used;
        const Gradients seen = gradients_of(cloud, camera, simd, upstream);
        expect_close(seen, gradients_of(cloud, camera, reference, upstream), 2e-3);
        EXPECT_EQ(seen.sh.size(), cloud.sh.size());
      }
    }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(Backward, ThePlaceInThePictureIsOverwrittenAlsoForBlocksOfRowsOfWhichNothingIsSeen) {
  auto cloud = cloud_in_view(800, 37, 0);
  for (std::size_t i = 0; i < 600; ++i) cloud.mean.z[i] = -2;
  const auto camera = off_centre_camera();
  Gradients gradients;
  gradients.reset(cloud.size(), 0);
  gradients.mean2d_x_px.assign(cloud.size(), 5.0f), gradients.mean2d_y_px.assign(cloud.size(), 5.0f);
  Frame frame;
  scene::Image color(camera.width, camera.height, 3);
  frame.forward(cloud, camera, {}, color);
  frame.backward(cloud, random_upstream(camera.width, camera.height, 38).color, gradients);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_TRUE(i >= 600 || gradients.mean2d_x_px[i] == 0) << i;
    ASSERT_TRUE(i >= 600 || gradients.mean2d_y_px[i] == 0) << i;
    ASSERT_NE(gradients.mean2d_x_px[i], 5.0f) << i;
  }
}

TEST(Backward, NoNumberUpstreamIsNoNumberInTheRowsThatReachThePixelAndNothingInAllOthers) {
  // Two groups that no tile shares.
  scene::GaussianCloud cloud;
  cloud.sh_degree = 3;
  for (int i = 0; i < 20; ++i) {
    add_on_axis(cloud, 2, 0.5f, 0.6f, -4.0f);
    cloud.mean.x[std::size_t(i)] = (i % 2 == 0 ? -0.9f : 0.9f) + 0.01f * float(i);
  }
  const auto camera = off_centre_camera();
  const Upstream good = random_upstream(camera.width, camera.height, 39);
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    const auto expected = gradients_of(cloud, camera, on(Backend::simd), good);
    Upstream bad = good;  // all that the left group reaches
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width / 2; ++x) bad.color.at(x, y, 0) = std::numeric_limits<float>::quiet_NaN();
    const auto seen = gradients_of(cloud, camera, on(Backend::simd), bad);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      ASSERT_NE(expected.mean.x[i], 0.0f) << i;
      if (i % 2 == 0) {
        EXPECT_TRUE(std::isnan(seen.mean.x[i]) && std::isnan(seen.opacity_logit[i])) << i;
      } else {
        EXPECT_EQ(seen.mean.x[i], expected.mean.x[i]) << i;
      }
    }
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(Backward, ARowThatHoldsNoNumbersHasNoGradientAndChangesNoOther) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 40);
  const float none = std::numeric_limits<float>::quiet_NaN();
  auto cloud = cloud_in_view(60, 41), hidden = cloud;
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    for (std::size_t i = 0; i < cloud.size(); i += 3) {
      hidden.mean.set(i, {0, 0, -1});
      cloud.mean.set(i, Vec3(none)), cloud.log_scale.set(i, Vec3(none)),
          cloud.rotation.set(i, {none, none, none, none});
      cloud.opacity_logit[i] = none;
      for (float& value : cloud.sh_row(i)) value = none;
    }
    expect_same_bytes(gradients_of(cloud, camera, on(Backend::simd), upstream),
                      gradients_of(hidden, camera, on(Backend::simd), upstream));
  }
  ASSERT_TRUE(pin_simd_target(best));
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

TEST(Backward, ARayThroughAThousandFaintSplatsKeepsItsDigitsOnTheWayBack) {
  // The way back divides its way through them all. Transmittance falls to 2e-4: no ray ends.
  auto cloud = cloud_in_view(1400, 19, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean.set(i, {0, 0, 2 + 0.001f * float(i)});
    cloud.log_scale.set(i, Vec3(1.5f));
    cloud.opacity_logit[i] = -5.1f;  // alpha 0.006
  }
  const auto camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.3, 20, 20);
  const Upstream upstream = random_upstream(20, 20, 21);
  const BackwardOptions options = on(Backend::reference);
  for (const int count : forward_reference<double>(cloud, camera, options.forward, {}).contributions)
    ASSERT_EQ(count, 1400) << "some splat is cut";
  const auto v = backward_reference<double>(cloud, camera, options, planes_of(upstream), all_rows(cloud));
  const std::vector<float> expected(v.opacity_logit.begin(), v.opacity_logit.end());
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    ASSERT_TRUE(pin_simd_target(target));
    const std::vector<double> differences =
        row_differences(gradients_of(cloud, camera, on(Backend::simd), upstream).opacity_logit, expected);
    EXPECT_LE(*std::max_element(differences.begin(), differences.end()), 1e-4) << target;
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(Backward, RowsOfWhichThereAreManyHaveTheGradientsOfTheReferenceAcrossGroupsOfTiles) {
  const auto camera = off_centre_camera(210, 150);  // 14 x 10 tiles: the last groups of rows and columns are not whole
  auto cloud = cloud_in_view(250, 31);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < cloud.size(); i += 3) {
    cloud.log_scale.set(i, cloud.log_scale.get(i) + Vec3(1.0f));
    rows.push_back(i);
  }
  const std::size_t shown = cloud.size();
  cloud.resize(shown + 20'000);  // so many that gradients are summed over groups
  for (std::size_t i = shown; i < cloud.size(); ++i) {
    cloud.mean.set(i, {0, 0, -1});  // behind the camera
    rows.push_back(std::uint32_t(i));
  }
  ASSERT_GT(tile_group_side(rows.size()), 1);
  const auto upstream = random_upstream(camera.width, camera.height, 32);
  std::vector<std::uint32_t> some_tiles;
  for (std::uint32_t tile = 0; tile < 14 * 10; ++tile)
    if (tile % 5 == 0 || tile / 14 == 6) some_tiles.push_back(tile);
  const std::string best = simd_target();
  for (const auto& tiles : {std::vector<std::uint32_t>(), some_tiles}) {
    BackwardOptions simd = on(Backend::simd), reference = on(Backend::reference);
    simd.forward.tiles = reference.forward.tiles = tiles;
    const Gradients expected = gradients_of(cloud, camera, reference, upstream, rows);
    for (const std::string& target : simd_targets()) {
      SCOPED_TRACE(testing::Message() << target << ", " << tiles.size() << " tiles wanted, 0 for all");
      ASSERT_TRUE(pin_simd_target(target));
      expect_close(gradients_of(cloud, camera, simd, upstream, rows), expected, 2e-3);
    }
  }
  ASSERT_TRUE(pin_simd_target(best));
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

TEST(PairSums, AreZeroAtTheBeginningOfAPassWhateverBecameOfTheOneBefore) {
  const auto expect_zeros = [](const GroupGradient* sums, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i)
      for (const float value : std::bit_cast<std::array<float, 12>>(sums[i])) ASSERT_EQ(value, 0) << i;
  };
  PairSums sums;
  const auto spoil = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) sums.data()[i].along = 7, sums.data()[i].depth = NAN;
  };
  expect_zeros(sums.zeroed(6000), 6000);
  sums.all_read();
  spoil(100, 200);  // so that one sees that what is zero at the end is not zeroed again
  EXPECT_EQ(sums.zeroed(6000)[100].along, 7);
  spoil(0, 6000);  // a pass that was left by an exception
  expect_zeros(sums.zeroed(50), 50);
  sums.all_read();
  expect_zeros(sums.zeroed(6000), 6000);  // more than there were at the end
  sums.all_read();
  expect_zeros(sums.zeroed(9000), 9000);  // more than there was room for
}

TEST(Backward, IsTheSameToTheBitForAnyNumberOfThreads) {
  const auto camera = off_centre_camera(300, 200);
  const auto upstream = random_upstream(camera.width, camera.height, 14);
  for (const std::size_t rows : {5'000, 20'500}) {  // summed per tile, and over groups of tiles
    SCOPED_TRACE(rows);
    const auto cloud = cloud_in_view(rows, 13);
    std::vector<Gradients> seen(3);
    for (const std::size_t k : {0u, 1u, 2u}) {
      WorkArena arena(1 << k);
      arena.run([&] { seen[k] = gradients_of(cloud, camera, on(Backend::simd), upstream); });
    }
    expect_same_bytes(seen[1], seen[0]);
    expect_same_bytes(seen[2], seen[0]);
  }
}

}  // namespace
}  // namespace engine::render
