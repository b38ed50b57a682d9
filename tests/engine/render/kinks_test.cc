// Every kink of the rasteriser, one test each: on either side of it the gradient is the one that numbers give, and at
// the kink itself it is the one that engine/render/backward.h documents. Both backends.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "engine/render/backward.h"
#include "engine/render/project.h"
#include "engine/render/reference/backward_reference.h"
#include "engine/render/reference/forward_reference.h"
#include "tests/engine/render/gradients.h"
#include "tests/engine/render/test_scenes.h"
#include "tests/support/gradient_matches.h"

namespace engine::render {
namespace {

using scene::Camera;
using scene::GaussianCloud;

class KinkTest : public testing::TestWithParam<Backend> {
 protected:
  [[nodiscard]] Gradients gradients(const GaussianCloud& cloud, const Camera& camera, const Upstream& upstream) const {
    return gradients_of(cloud, camera, on(GetParam()), upstream);
  }
  [[nodiscard]] Rendering picture(const GaussianCloud& cloud, const Camera& camera) const {
    return forward(cloud, camera, on(GetParam()).forward);
  }

  /// The backend's gradient of every stored value is that of central differences. The scene is more than two steps away
  /// from every kink, on whichever side.
  void expect_gradients_of_numbers(GaussianCloud cloud, const Camera& camera, const Upstream& upstream,
                                   double step = 1.0 / 512) const {
    // A grid on which steps are exact in float.
    auto x = values_of(cloud);
    for (double& value : x) value = std::round(value * 32768) / 32768;
    cloud = with_values(cloud, x);
    const auto planes = planes_of(upstream);
    const BackwardOptions options = on(Backend::reference);
    const auto exact = values_of(backward_reference<double>(cloud, camera, options, planes, all_rows(cloud)));
    const auto loss_at = [&](const std::vector<double>& values) {
      return loss(forward_reference<double>(with_values(cloud, values), camera, options.forward, {}), planes);
    };
    EXPECT_TRUE(support::gradient_matches(loss_at, x, exact, {.step = step, .rtol = 1e-5}));
    const auto seen = values_of(gradients(cloud, camera, upstream));
    ASSERT_EQ(seen.size(), exact.size());
    double largest = 0;
    for (const double value : exact) largest = std::max(largest, std::abs(value));
    for (std::size_t i = 0; i < seen.size(); ++i)
      EXPECT_NEAR(seen[i], exact[i], 2e-4 * std::abs(exact[i]) + 1e-5 * largest) << "value " << i;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, KinkTest, testing::Values(Backend::reference, Backend::simd),
                         [](const auto& backend) { return backend.param == Backend::simd ? "simd" : "reference"; });

/// Two neighbouring floats in [low, high]: `holds` is true of the first and false of the second.
std::pair<float, float> last_and_first(float low, float high, const std::function<bool(float)>& holds) {
  EXPECT_TRUE(holds(low)) << low;
  EXPECT_FALSE(holds(high)) << high;
  for (float middle = low + (high - low) / 2; middle != low && middle != high; middle = low + (high - low) / 2)
    (holds(middle) ? low : high) = middle;
  return {low, high};
}

/// Row `row` has no gradient at all.
void expect_nothing(const Gradients& seen, std::size_t row) {
  EXPECT_EQ(seen.mean.get(row), Vec3(0.0f));
  EXPECT_EQ(seen.log_scale.get(row), Vec3(0.0f));
  EXPECT_EQ(glm::length(seen.rotation.get(row)), 0.0f);
  EXPECT_EQ(seen.opacity_logit[row], 0.0f);
  const std::size_t stride = seen.sh.size() / seen.size();
  for (std::size_t k = row * stride; k < (row + 1) * stride; ++k) EXPECT_EQ(seen.sh[k], 0.0f);
}

Upstream one_pixel_upstream() {
  return {scene::Image(1, 1, 3, 1.0f), scene::Image(1, 1, 1, 0.5f), scene::Image(1, 1, 1, 0.25f)};
}

/// A picture that a Gaussian of one world unit at depth 1 covers, at alphas well within their cuts.
Camera small_camera() {
  Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 8, 6);
  camera.cx += 0.4;
  return camera;
}

float logit(float opacity) { return std::log(opacity / (1 - opacity)); }

// 1/255 --------------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, From1Over255OnTheDerivativeIsThatOfTheBlendedSideAndBelowThereIsNone) {
  const float cut = -std::log(254.0f);  // the logit whose opacity is 1/255
  const auto cloud = [](float x) {
    GaussianCloud one;
    add_on_axis(one, 2, x, 0.6f);
    return one;
  };
  for (const float x : {cut - 0.05f, cut + 0.05f})
    expect_gradients_of_numbers(cloud(x), one_pixel_camera(), one_pixel_upstream());

  // The very floats between which the picture jumps: the backward pass decides as the forward pass does.
  const auto [below, from] = last_and_first(
      cut - 0.05f, cut + 0.05f, [&](float x) { return picture(cloud(x), one_pixel_camera()).alpha.data[0] == 0; });
  EXPECT_NEAR(from, cut, 1e-5f);
  expect_nothing(at_one_pixel(cloud(below), on(GetParam())), 0);
  const float slope = 3 * 0.6f * sigmoid(cut) * (1 - sigmoid(cut));
  EXPECT_NEAR(at_one_pixel(cloud(from), on(GetParam())).opacity_logit[0], slope, 1e-3f * slope)
      << "the jump itself is not differentiated";
}

// 0.99 ---------------------------------------------------------------------------------------------------------------
// No stored logit has exactly this opacity: for alpha at the clamp itself see blend_test.cc.

TEST_P(KinkTest, AlphaClampedAt99PercentStopsTheGradientOfOpacityAndShapeButNotOfColour) {
  const float clamp = logit(0.99f);
  const auto cloud = [](float x) {
    GaussianCloud two;
    add_on_axis(two, 2, x, 0.6f);
    add_on_axis(two, 3, 0, 0.9f);
    return two;
  };
  for (const float x : {clamp - 0.05f, clamp + 0.05f})
    expect_gradients_of_numbers(cloud(x), one_pixel_camera(), one_pixel_upstream());

  const auto slope = [&](float x) { return at_one_pixel(cloud(x), on(GetParam())).opacity_logit[0]; };
  const auto [below, from] = last_and_first(clamp - 0.05f, clamp + 0.05f, [&](float x) { return slope(x) != 0; });
  EXPECT_NEAR(sigmoid(from), 0.99f, 2e-6f) << "it ends at the clamp";
  EXPECT_NEAR(slope(below), slope(clamp - 1e-3f), 2e-3f * std::abs(slope(below))) << "and is whole until there";
  const auto clamped = at_one_pixel(cloud(from), on(GetParam()));
  EXPECT_EQ(clamped.log_scale.get(0), Vec3(0.0f));
  EXPECT_EQ(clamped.mean.get(0), Vec3(0.0f));
  EXPECT_NEAR(clamped.sh[0], 0.99f * y0, 1e-6f);
}

TEST(Kink, ToldToPassStraightThroughAClampedAlphaHasTheGradientOfTheRawOne) {
  GaussianCloud cloud;
  add_on_axis(cloud, 2, 6, 0.6f);
  BackwardOptions options = on(Backend::reference);
  options.alpha_clamp = AlphaClamp::straight_through;
  EXPECT_NEAR(at_one_pixel(cloud, options).opacity_logit[0], 3 * 0.6f * sigmoid(6) * sigmoid(-6), 1e-6f);
}

// Early stop ---------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, TheSplatAtWhichARayEndsAndAllBehindItHaveNoGradientAndThoseBeforeDoNotSeeThem) {
  const auto before = [](float x) {
    GaussianCloud two;
    add_on_axis(two, 1, 6, 0.6f);  // alpha 0.99
    add_on_axis(two, 2, x, 0.7f);
    return two;
  };
  const auto cloud = [&](float x) {
    GaussianCloud all = before(x);
    add_on_axis(all, 3, logit(0.9f), 0.8f);  // leaves 1e-4 where the second one has alpha 0.9
    add_on_axis(all, 4, logit(0.3f), 0.9f);  // never blended: behind the end, or the end itself
    return all;
  };
  const float kink = logit(0.9f);
  for (const float x : {kink - 0.05f, kink + 0.05f})
    expect_gradients_of_numbers(cloud(x), one_pixel_camera(), one_pixel_upstream());

  const auto blends_third = [&](float x) {
    return picture(cloud(x), one_pixel_camera()).alpha.data[0] > picture(before(x), one_pixel_camera()).alpha.data[0];
  };
  const auto [goes_on, ends] = last_and_first(kink - 0.05f, kink + 0.05f, blends_third);
  EXPECT_NEAR(sigmoid(ends), 0.9f, 1e-5f);
  const auto seen = at_one_pixel(cloud(goes_on), on(GetParam()));
  EXPECT_NEAR(seen.sh[3 * 2] / (0.01f * 0.1f * 0.9f * y0), 1, 1e-3f)
      << "the last splat that leaves enough has its gradient";
  expect_nothing(seen, 3);
  const auto stopped = at_one_pixel(cloud(ends), on(GetParam())), expected = at_one_pixel(before(ends), on(GetParam()));
  for (const std::size_t i : {0u, 1u}) {
    EXPECT_EQ(stopped.opacity_logit[i], expected.opacity_logit[i]);
    EXPECT_EQ(stopped.mean.get(i), expected.mean.get(i));
  }
  EXPECT_NE(stopped.opacity_logit[1], 0.0f);
  for (const std::size_t i : {2u, 3u}) expect_nothing(stopped, i);
}

TEST(Kink, WithoutAnEndOfRaysEvenTheFarthestSplatHasAGradient) {
  GaussianCloud cloud;
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

// Near plane ---------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, AtTheNearPlaneItselfThereIsNoGradientAndJustBehindItThereIs) {
  const auto cloud = [](float z) {
    GaussianCloud two;
    add_on_axis(two, z, 0.25f, 0.6f, -1);
    add_on_axis(two, 2, 0, 0.9f);
    return two;
  };
  const auto camera = small_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 21);
  for (const float z : {0.18f, 0.22f}) expect_gradients_of_numbers(cloud(z), camera, upstream, 1.0 / 4096);

  expect_nothing(gradients(cloud(0.2f), camera, upstream), 0);
  const auto behind = gradients(cloud(std::nextafter(0.2f, 1.0f)), camera, upstream),
             farther = gradients(cloud(0.2f + 1e-5f), camera, upstream);
  for (const auto& [a, b] : {std::pair{behind.mean.z[0], farther.mean.z[0]},
                             {behind.log_scale.x[0], farther.log_scale.x[0]},
                             {behind.opacity_logit[0], farther.opacity_logit[0]}}) {
    EXPECT_NE(a, 0.0f);
    EXPECT_NEAR(a, b, 2e-3f * std::abs(b));
  }
}

// Field of view ------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, AtTheFieldOfViewClampTheShapeStillFollowsTheMeanAndBeyondItDoesNot) {
  const Camera camera = small_camera();
  const auto view = view_params<float>(camera);
  ASSERT_EQ(view.rotation, (std::array<float, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1})) << "x / z of the mean at z = 1 is its x";
  const auto upstream = random_upstream(camera.width, camera.height, 22);
  struct Bound {
    const char* name;
    float at;
    int axis;
  };
  for (const Bound& bound : {Bound{"left", view.min_x_over_z, 0},
                             {"right", view.max_x_over_z, 0},
                             {"top", view.min_y_over_z, 1},
                             {"bottom", view.max_y_over_z, 1}}) {
    SCOPED_TRACE(bound.name);
    const auto cloud = [&](float part) {  // of the way from the axis to the bound
      GaussianCloud one;
      add_on_axis(one, 1, 0.5f, 0.6f, -0.25f);
      Vec3 mean = one.mean.get(0);
      mean[1 - bound.axis] = 0.125f;
      mean[bound.axis] = part == 1 ? bound.at : part * bound.at;
      one.mean.set(0, mean);
      return one;
    };
    for (const float part : {0.95f, 1.05f}) expect_gradients_of_numbers(cloud(part), camera, upstream);

    const auto slope = [&](float part) { return gradients(cloud(part), camera, upstream).mean.get(0)[bound.axis]; };
    const float inside = slope(1 - 1e-5f), at = slope(1), outside = slope(1 + 1e-5f);
    EXPECT_GT(std::abs(inside - outside), 0.01f * std::abs(inside)) << "there is a kink";
    EXPECT_NEAR(at, inside, 1e-3f * std::abs(inside)) << "the derivative is the one from inside";
  }
}

// Colour -------------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, ABlackColourHasTheDerivativeFromAboveAndBelowThereIsNone) {
  const auto cloud = [](float dc) {
    GaussianCloud two;
    two.sh_degree = 1;
    add_on_axis(two, 2, 0, 0.6f);
    add_on_axis(two, 3, 0, 0.9f);
    two.sh[0] = dc;  // red; towards the Gaussian only the constant counts, but its gradient turns the others
    two.sh[1] = 0.25f, two.sh[3] = -0.5f;
    return two;
  };
  float black = -0.5f / y0;  // the coefficient whose colour is exactly zero in float
  while (0.5f + black * y0 < 0) black = std::nextafter(black, 0.0f);
  while (0.5f + black * y0 > 0) black = std::nextafter(black, -9.0f);
  ASSERT_EQ(0.5f + black * y0, 0.0f);
  for (const float dc : {black - 0.05f, black + 0.05f})
    expect_gradients_of_numbers(cloud(dc), one_pixel_camera(), one_pixel_upstream());

  const auto at = at_one_pixel(cloud(black), on(GetParam())), above = at_one_pixel(cloud(-1), on(GetParam())),
             below = at_one_pixel(cloud(black - 1e-3f), on(GetParam()));
  EXPECT_NEAR(at.sh[0], above.sh[0], 1e-6f) << "a black Gaussian can brighten";
  EXPECT_NEAR(above.sh[0], 0.5f * y0, 1e-6f);
  EXPECT_NEAR(at.mean.x[0], above.mean.x[0], 1e-6f);
  EXPECT_NE(above.mean.x[0], 0.0f);
  EXPECT_EQ(below.sh[0], 0.0f);
  EXPECT_EQ(below.mean.get(0), Vec3(0.0f)) << "the other channels are the same from everywhere";
}

TEST_P(KinkTest, TheLargestColourHasTheDerivativeFromBelowAndAboveThereIsNone) {
  const auto slope = [&](float dc) {
    GaussianCloud one;
    add_on_axis(one, 2, 0, 0.6f);
    one.sh[0] = dc;
    return at_one_pixel(one, on(GetParam())).sh[0];
  };
  const auto largest = float(max_color);
  float at = largest / y0;
  while (0.5f + at * y0 < largest) at = std::nextafter(at, 1e9f);
  while (0.5f + at * y0 > largest) at = std::nextafter(at, 0.0f);
  ASSERT_EQ(0.5f + at * y0, largest);
  for (const float dc : {0.0f, 0.9f * at, at}) EXPECT_NEAR(slope(dc), 0.5f * y0, 1e-6f) << dc;
  EXPECT_EQ(slope(1.001f * at), 0.0f);
}

// Depth order --------------------------------------------------------------------------------------------------------

TEST_P(KinkTest, DepthOrderIsTakenAsItIsAndTiesAreInTheOrderOfRows) {
  const auto cloud = [](float z) {
    GaussianCloud two;
    add_on_axis(two, 2, 0.5f, 0.9f);
    add_on_axis(two, z, -0.5f, 0.2f, 0.75f);
    return two;
  };
  const Camera camera = small_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 23);
  for (const float z : {1.95f, 2.05f}) expect_gradients_of_numbers(cloud(z), camera, upstream);

  const auto nearer = gradients(cloud(std::nextafter(2.0f, 1.0f)), camera, upstream),
             tie = gradients(cloud(2), camera, upstream),
             farther = gradients(cloud(std::nextafter(2.0f, 3.0f)), camera, upstream);
  for (const std::size_t row : {0u, 1u}) {
    const float jump = std::abs(nearer.opacity_logit[row] - farther.opacity_logit[row]);
    EXPECT_GT(jump, 0.05f * std::abs(farther.opacity_logit[row])) << "the order matters";
    EXPECT_NEAR(tie.opacity_logit[row], farther.opacity_logit[row], 1e-3f * jump);
    // That a step in depth would swap them, and change every pixel at once, no gradient says.
    EXPECT_NEAR(tie.mean.z[row], farther.mean.z[row], 1e-4f * std::abs(farther.mean.z[row]));
  }
}

// Tile edges ---------------------------------------------------------------------------------------------------------

/// A splat of 3 pixels whose mean is at column x, beside the edge between tile 0 and tile 1, which is at 15.5.
GaussianCloud beside_the_edge(float x) {
  GaussianCloud one;
  add_on_axis(one, 1, 0.5f, 0.6f, std::log(0.3f));
  one.mean.x[0] = x * 0.1f;
  return one;
}
Camera camera_of_two_tiles() {
  Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 32, 16);
  camera.fx = camera.fy = 10;
  camera.cx = 0.5, camera.cy = 8.5;
  return camera;
}
/// One beside which there is nothing.
Upstream upstream_at(int x, int y) {
  Upstream upstream{.color = scene::Image(32, 16, 3)};
  for (int c = 0; c < 3; ++c) upstream.color.at(x, y, c) = 1;
  return upstream;
}

TEST_P(KinkTest, ASplatHasTheGradientOfAPixelBeyondATileEdgeFrom1Over255On) {
  const Camera camera = camera_of_two_tiles();
  const auto shows = [&](float x) { return picture(beside_the_edge(x), camera).alpha.at(16, 8) > 0; };
  const auto [without, with] = last_and_first(4.0f, 12.0f, [&](float x) { return !shows(x); });
  EXPECT_GT(with, 5.0f);
  for (const float x : {with - 0.1f, with + 0.1f})
    expect_gradients_of_numbers(beside_the_edge(x), camera, upstream_at(16, 8), 1.0 / 4096);
  expect_nothing(gradients(beside_the_edge(without), camera, upstream_at(16, 8)), 0);
  const auto at = gradients(beside_the_edge(with), camera, upstream_at(16, 8)),
             after = gradients(beside_the_edge(with + 1e-3f), camera, upstream_at(16, 8));
  EXPECT_GT(at.mean.x[0], 0.0f);
  EXPECT_NEAR(at.mean.x[0], after.mean.x[0], 2e-3f * after.mean.x[0]);
  EXPECT_NEAR(at.opacity_logit[0], after.opacity_logit[0], 2e-3f * after.opacity_logit[0]);
}

TEST_P(KinkTest, AMeanThatCrossesATileEdgeMeetsNoKink) {
  const Camera camera = camera_of_two_tiles();
  Upstream upstream{.color = scene::Image(32, 16, 3)};
  Rng rng(24);
  for (int y = 6; y < 11; ++y)
    for (int x = 12; x < 20; ++x)
      for (int c = 0; c < 3; ++c) upstream.color.at(x, y, c) = rng.normal();
  expect_gradients_of_numbers(beside_the_edge(15.5f), camera, upstream, 1.0 / 4096);
  const auto before = values_of(gradients(beside_the_edge(15.499f), camera, upstream)),
             after = values_of(gradients(beside_the_edge(15.501f), camera, upstream));
  double largest = 0;
  for (const double value : after) largest = std::max(largest, std::abs(value));
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(before[i], after[i], 5e-3 * largest) << i;
}

TEST(Kink, TheTilesThatTile16StopReachesAreTakenAsTheyAre) {
  // Sigma 7.9 px at x = 8.9: three sigmas, rounded up, end at tile 1, while alpha is above 1/255 up to column 35.
  auto camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 64, 16);
  camera.fx = camera.fy = 10;
  camera.cx = 8.9 + 0.5, camera.cy = 8;
  GaussianCloud cloud;
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

// Stored values that saturate ----------------------------------------------------------------------------------------

TEST_P(KinkTest, AtTheEdgeOfWhatStoredValuesSaturateAtTheDerivativeIsTheOneFromInsideAndBeyondThereIsNone) {
  const auto camera = off_centre_camera();
  const auto upstream = random_upstream(camera.width, camera.height, 10);
  const auto changed = [&](auto&& change) {
    GaussianCloud cloud;
    add_on_axis(cloud, 2, 0.3f, 0.6f, -2.0f);
    change(cloud);
    return gradients(cloud, camera, upstream);
  };
  const auto scale = [&](float value) {
    return changed([&](auto& cloud) { cloud.log_scale.x[0] = value; }).log_scale.x[0];
  };
  for (const float sign : {-1.0f, 1.0f}) {
    EXPECT_NE(scale(sign * 20), 0.0f);
    EXPECT_EQ(scale(sign * std::nextafter(20.0f, 30.0f)), 0.0f);
  }
  const auto of_logit = [&](float value) {
    return changed([&](auto& cloud) { cloud.opacity_logit[0] = value; }).opacity_logit[0];
  };
  EXPECT_NE(of_logit(30), 0.0f) << "around the pixels that are clamped at 0.99";
  EXPECT_EQ(of_logit(std::nextafter(30.0f, 40.0f)), 0.0f);
  for (const float length : {0.0f, 1e-13f})
    EXPECT_EQ(glm::length(changed([&](auto& cloud) {
                            cloud.log_scale.x[0] = -1;
                            cloud.rotation.set(0, {length, 0, 0.5f * length, length});
                          }).rotation.get(0)),
              0.0f);
}

}  // namespace
}  // namespace engine::render
