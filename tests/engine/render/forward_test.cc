#include "engine/render/forward.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/render/project.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

/// One Gaussian, grey with a given brightness (SH degree 0).
scene::GaussianCloud one_gaussian(Vec3 mean, float log_scale, float opacity_logit, float brightness) {
  scene::GaussianCloud cloud;
  cloud.resize(1);
  cloud.mean.set(0, mean);
  cloud.log_scale.set(0, Vec3(log_scale));
  cloud.rotation.set(0, {1, 0, 0, 0});
  cloud.opacity_logit[0] = opacity_logit;
  for (float& value : cloud.sh) value = (brightness - 0.5f) / 0.28209479177387814f;
  return cloud;
}

ForwardOptions everything(Backend backend = Backend::simd) {
  return {.background = {0.1f, 0.5f, 0.9f}, .depth = true, .backend = backend};
}

void expect_finite(const Rendering& seen) {
  for (const scene::Image* image : {&seen.color, &seen.alpha, &seen.depth, &seen.median_depth, &seen.weight}) {
    const auto bad = first_not_finite(image->data);
    EXPECT_FALSE(bad) << "value " << bad.value_or(0);
  }
  for (const float alpha : seen.alpha.data) {
    EXPECT_GE(alpha, 0.0f);
    EXPECT_LE(alpha, 1.0f);
  }
}

bool same_pictures(const Rendering& a, const Rendering& b) {
  return a.color == b.color && a.alpha == b.alpha && a.depth == b.depth && a.median_depth == b.median_depth &&
         a.weight == b.weight;
}

class BackendTest : public testing::TestWithParam<Backend> {};
INSTANTIATE_TEST_SUITE_P(Backends, BackendTest, testing::Values(Backend::reference, Backend::simd),
                         [](const auto& backend) { return backend.param == Backend::simd ? "simd" : "reference"; });

TEST_P(BackendTest, AnEmptySceneShowsTheBackground) {
  const Rendering seen = forward(scene::GaussianCloud{}, off_centre_camera(), everything(GetParam()));
  for (int c = 0; c < 3; ++c)
    for (const float value : seen.color.plane(c)) EXPECT_EQ(value, everything().background[c]);
  for (const float alpha : seen.alpha.data) EXPECT_EQ(alpha, 0.0f);
}

TEST_P(BackendTest, OneWideOpaqueGaussianHidesAllButOnePercent) {
  const auto seen = forward(one_gaussian({0, 0, 2}, 5, 30, 1.0f), off_centre_camera(), everything(GetParam()));
  EXPECT_NEAR(seen.alpha.at(35, 25), 0.99f, 1e-6f);
  EXPECT_NEAR(seen.color.at(35, 25, 0), 0.99f * 1.0f + 0.01f * 0.1f, 1e-6f);
  EXPECT_NEAR(seen.depth.at(35, 25), 0.99f * 2.0f, 1e-5f);
  EXPECT_EQ(seen.median_depth.at(35, 25), 2.0f);
}

TEST_P(BackendTest, MedianDepthIsWhereTransmittanceFallsBelowOneHalf) {
  // Three sheets of alpha 0.354: T is 0.646 after the first, 0.417 after the second.
  auto cloud = one_gaussian({0, 0, 2}, 5, -0.6f, 0.5f);
  for (const float z : {3.0f, 4.0f}) {
    const auto next = one_gaussian({0, 0, z}, 5, -0.6f, 0.5f);
    scene::append_rows(cloud, next, std::vector<std::uint32_t>{0});
  }
  const auto seen = forward(cloud, off_centre_camera(), everything(GetParam()));
  EXPECT_EQ(seen.median_depth.at(35, 25), 3.0f);
  cloud = one_gaussian({0, 0, 2}, 5, -0.6f, 0.5f);
  EXPECT_EQ(forward(cloud, off_centre_camera(), everything(GetParam())).median_depth.at(35, 25), 0.0f)
      << "never below one half";
}

TEST_P(BackendTest, WhiteOnWhiteStaysWhite) {
  auto cloud = cloud_in_view(300, 3, 0);
  for (float& value : cloud.sh) value = 0.5f / 0.28209479177387814f;
  ForwardOptions options = everything(GetParam());
  options.background = Vec3(1.0f);
  for (const float value : forward(cloud, off_centre_camera(), options).color.data) EXPECT_NEAR(value, 1.0f, 2e-6f);
}

TEST_P(BackendTest, AWeightOfOneBlendsToAlphaAndTheSumOfMasksIsTheirUnion) {
  const auto cloud = cloud_in_view(200, 4);
  std::vector<float> one(cloud.size(), 1.0f), odd(cloud.size()), even(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) odd[i] = float(i % 2), even[i] = 1 - odd[i];
  const auto all = forward(cloud, off_centre_camera(), everything(GetParam()), one);
  const auto a = forward(cloud, off_centre_camera(), everything(GetParam()), odd);
  const auto b = forward(cloud, off_centre_camera(), everything(GetParam()), even);
  for (std::size_t i = 0; i < all.alpha.data.size(); ++i) {
    EXPECT_NEAR(all.weight.data[i], all.alpha.data[i], 2e-6f);
    EXPECT_NEAR(a.weight.data[i] + b.weight.data[i], all.alpha.data[i], 2e-6f);
  }
}

TEST_P(BackendTest, ATintBlendsTheColoursOfItsRowsAndNothingElse) {
  const auto cloud = cloud_in_view(200, 4);
  std::vector<std::uint8_t> odd(cloud.size());
  std::vector<float> share(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) odd[i] = i % 2, share[i] = float(i % 2);
  ForwardOptions options = everything(GetParam());
  const auto plain = forward(cloud, off_centre_camera(), options, share);
  options.tint = {.rows = odd, .color = {1.0f, 0.25f, 0.0f}, .strength = 1.0f};
  const auto tinted = forward(cloud, off_centre_camera(), options, share);
  options.tint.strength = 0.5f;
  const auto half = forward(cloud, off_centre_camera(), options, share);
  EXPECT_EQ(tinted.alpha, plain.alpha);
  EXPECT_EQ(tinted.depth, plain.depth);
  EXPECT_NE(tinted.color, plain.color);
  for (std::size_t i = 0; i < plain.color.data.size(); ++i)
    EXPECT_NEAR(half.color.data[i], (plain.color.data[i] + tinted.color.data[i]) / 2, 2e-6f);

  const std::vector<std::uint8_t> all(cloud.size(), 1);
  options.background = Vec3(0.0f);
  options.tint = {.rows = all, .color = {1.0f, 0.25f, 0.0f}, .strength = 1.0f};
  const auto whole = forward(cloud, off_centre_camera(), options);
  for (std::size_t i = 0; i < whole.alpha.data.size(); ++i) {
    EXPECT_NEAR(whole.color.plane(0)[i], whole.alpha.data[i], 2e-6f);
    EXPECT_NEAR(whole.color.plane(1)[i], 0.25f * whole.alpha.data[i], 2e-6f);
    EXPECT_NEAR(whole.color.plane(2)[i], 0.0f, 1e-6f);
  }
}

TEST_P(BackendTest, ARectangleIsACutOutOfTheWholePicture) {
  const auto cloud = cloud_in_view(400, 5);
  const std::vector<float> weight(cloud.size(), 0.7f);
  const auto whole = forward(cloud, off_centre_camera(), everything(GetParam()), weight);
  ForwardOptions options = everything(GetParam());
  options.rect = scene::Rect{13, 7, 50, 49};
  const auto part = forward(cloud, off_centre_camera(), options, weight);
  ASSERT_EQ(part.color.width, 37);
  ASSERT_EQ(part.color.height, 42);
  for (int y = 0; y < part.color.height; ++y)
    for (int x = 0; x < part.color.width; ++x) {
      for (int c = 0; c < 3; ++c) ASSERT_EQ(part.color.at(x, y, c), whole.color.at(x + 13, y + 7, c)) << x << ' ' << y;
      ASSERT_EQ(part.depth.at(x, y), whole.depth.at(x + 13, y + 7));
      ASSERT_EQ(part.weight.at(x, y), whole.weight.at(x + 13, y + 7));
    }
}

TEST_P(BackendTest, WantedTilesAreThoseOfTheWholePictureAndTheRestIsZero) {
  const auto cloud = cloud_in_view(400, 6);
  const auto whole = forward(cloud, off_centre_camera(), everything(GetParam()));
  ForwardOptions options = everything(GetParam());
  options.tiles = {1, 7, 19};  // of 5 columns and 4 rows; 19 is cut by the picture's corner
  const auto part = forward(cloud, off_centre_camera(), options);
  for (int y = 0; y < 50; ++y)
    for (int x = 0; x < 70; ++x) {
      const int tile = y / tile_size * tile_columns(70) + x / tile_size;
      const bool wanted = tile == 1 || tile == 7 || tile == 19;
      ASSERT_EQ(part.color.at(x, y, 2), wanted ? whole.color.at(x, y, 2) : 0.0f) << x << ' ' << y;
      ASSERT_EQ(part.alpha.at(x, y), wanted ? whole.alpha.at(x, y) : 0.0f) << x << ' ' << y;
    }
}

TEST_P(BackendTest, AFrameIntoUsedMemoryIsTheSameFrame) {
  Workspace workspace;
  Rendering out;
  forward(cloud_in_view(900, 7), off_centre_camera(64, 80), everything(GetParam()), {}, workspace, out);
  const auto cloud = cloud_in_view(300, 8);
  forward(cloud, off_centre_camera(), everything(GetParam()), {}, workspace, out);
  EXPECT_TRUE(same_pictures(out, forward(cloud, off_centre_camera(), everything(GetParam()))));
  ForwardOptions options = everything(GetParam());
  options.tiles = {3};
  forward(cloud, off_centre_camera(), options, {}, workspace, out);
  EXPECT_TRUE(same_pictures(out, forward(cloud, off_centre_camera(), options)));
}

TEST_P(BackendTest, EqualDepthsBlendInRowOrder) {
  auto cloud = one_gaussian({0, 0, 2}, 3, 0, 1.0f);
  scene::append_rows(cloud, one_gaussian({0, 0, 2}, 3, 0, 0.0f), std::vector<std::uint32_t>{0});
  ForwardOptions options{.backend = GetParam()};
  EXPECT_NEAR(forward(cloud, off_centre_camera(), options).color.at(35, 25), 0.5f, 1e-3f);
  cloud.sh_row(0)[0] = cloud.sh_row(0)[1] = cloud.sh_row(0)[2] = -0.5f / 0.28209479177387814f;  // now black is first
  cloud.sh_row(1)[0] = cloud.sh_row(1)[1] = cloud.sh_row(1)[2] = 0.5f / 0.28209479177387814f;
  EXPECT_NEAR(forward(cloud, off_centre_camera(), options).color.at(35, 25), 0.25f, 1e-3f);
}

TEST_P(BackendTest, FarFromTheOriginThePictureIsThatAtTheOrigin) {
  // At 2^20 world units a float steps by 1/8: means are put on that grid, so that both scenes hold the same numbers.
  auto cloud = cloud_in_view(300, 9);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3 mean = cloud.mean.get(i) * 20.0f;
    cloud.mean.set(i, {std::round(mean.x * 8) / 8, std::round(mean.y * 8) / 8, std::round(mean.z * 8) / 8});
    cloud.log_scale.set(i, cloud.log_scale.get(i) + 3.0f);
  }
  const DVec3 offset(1048576, -1048576, 1048576);
  auto moved = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i) moved.mean.set(i, cloud.mean.get(i) + Vec3(offset));
  const auto near = scene::look_at({1.1, -0.7, -3.3}, {0.3, 0.1, 40}, {0, -1, 0}, 1.0, 70, 50);
  const auto far =
      scene::look_at(DVec3(1.1, -0.7, -3.3) + offset, DVec3(0.3, 0.1, 40) + offset, {0, -1, 0}, 1.0, 70, 50);
  const auto expected = forward(cloud, near, everything(GetParam())),
             seen = forward(moved, far, everything(GetParam()));
  for (std::size_t i = 0; i < expected.color.data.size(); ++i)
    ASSERT_NEAR(seen.color.data[i], expected.color.data[i], 1e-4f) << i;
}

// What design section 5 lists, and more: each must give finite pictures on both backends. See docs/numerics.md.
class ExtremeTest : public testing::TestWithParam<Extreme> {
 protected:
  /// A cloud of which every row is spoilt.
  static scene::GaussianCloud spoilt_cloud(std::size_t n, std::uint64_t seed) {
    auto cloud = cloud_in_view(n, seed);
    for (std::size_t i = 0; i < n; ++i) GetParam().spoil(cloud, i);
    return cloud;
  }
};

INSTANTIATE_TEST_SUITE_P(Extremes, ExtremeTest, testing::ValuesIn(extremes()),
                         [](const auto& extreme) { return extreme.param.name; });

TEST_P(ExtremeTest, GivesFinitePicturesThatBothBackendsAgreeOn) {
  const auto cloud = spoilt_cloud(97, 11);
  const std::vector<float> weight(cloud.size(), 1.0f);
  const auto expected = forward(cloud, off_centre_camera(), everything(Backend::reference), weight);
  const auto seen = forward(cloud, off_centre_camera(), everything(), weight);
  expect_finite(expected);
  expect_finite(seen);
  // Splats so close to a cut that rounding decides flip whole contributions; they must stay rare.
  std::size_t flips = 0;
  for (std::size_t i = 0; i < seen.alpha.data.size(); ++i)
    flips += std::abs(seen.alpha.data[i] - expected.alpha.data[i]) > 1e-3f;
  EXPECT_LE(flips, seen.alpha.data.size() / 200) << "of " << seen.alpha.data.size();
}

TEST_P(ExtremeTest, ASmallRectangleIsACutOutOfTheWholePicture) {
  // What a small rectangle does not need is left out by a bound on its extent, which must never leave out too much.
  const auto cloud = spoilt_cloud(197, 17);
  const std::vector<float> weight(cloud.size(), 0.7f);
  const auto whole = forward(cloud, off_centre_camera(), everything(), weight);
  for (int y0 = 0; y0 + 9 <= 50; y0 += 8)
    for (int x0 = 0; x0 + 11 <= 70; x0 += 10) {
      ForwardOptions options = everything();
      options.rect = scene::Rect{x0, y0, x0 + 11, y0 + 9};
      const auto part = forward(cloud, off_centre_camera(), options, weight);
      for (int y = 0; y < 9; ++y)
        for (int x = 0; x < 11; ++x) {
          ASSERT_EQ(part.color.at(x, y, 1), whole.color.at(x0 + x, y0 + y, 1)) << x0 + x << ", " << y0 + y;
          ASSERT_EQ(part.alpha.at(x, y), whole.alpha.at(x0 + x, y0 + y)) << x0 + x << ", " << y0 + y;
          ASSERT_EQ(part.median_depth.at(x, y), whole.median_depth.at(x0 + x, y0 + y)) << x0 + x << ", " << y0 + y;
        }
    }
}

TEST(Forward, ASmallRectangleOfACrowdedSceneIsACutOutOfTheWholePicture) {
  const auto cloud = cloud_in_view(4000, 18);
  const auto whole = forward(cloud, off_centre_camera(), everything());
  for (int y = 0; y < 50; y += 7)
    for (int x = 0; x < 70; x += 3) {
      ForwardOptions options = everything();
      options.rect = scene::Rect{x, y, x + 1, y + 1};
      const auto part = forward(cloud, off_centre_camera(), options);
      ASSERT_EQ(part.alpha.at(0, 0), whole.alpha.at(x, y)) << x << ", " << y;
      ASSERT_EQ(part.color.at(0, 0, 2), whole.color.at(x, y, 2)) << x << ", " << y;
    }
}

TEST(Forward, BackendsAgreeOnACrowdedScene) {
  const auto cloud = cloud_in_view(3000, 12);
  const auto expected = forward(cloud, off_centre_camera(), everything(Backend::reference));
  const auto seen = forward(cloud, off_centre_camera(), everything());
  double sum = 0;
  for (std::size_t i = 0; i < seen.color.data.size(); ++i) {
    const double difference = std::abs(double(seen.color.data[i]) - double(expected.color.data[i]));
    ASSERT_LT(difference, 8e-3) << i;
    sum += difference;
  }
  EXPECT_LT(sum / double(seen.color.data.size()), 2e-6);
}

TEST(Forward, BackendsAgreeOnDepthsOfRaysThatEndWithinABatch) {
  // Wide and nearly opaque: every ray ends within a dozen of the first 64 splats.
  auto cloud = cloud_in_view(500, 31, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.log_scale.set(i, Vec3(-0.3f));
    cloud.opacity_logit[i] = 2.0f;
  }
  const auto camera = off_centre_camera(61, 45);
  const auto expected = forward(cloud, camera, everything(Backend::reference));
  const auto seen = forward(cloud, camera, everything());
  ASSERT_GT(*std::min_element(seen.alpha.data.begin(), seen.alpha.data.end()), 0.999f) << "some ray goes on";
  std::size_t others = 0;
  for (std::size_t i = 0; i < seen.depth.data.size(); ++i) {
    EXPECT_NEAR(seen.depth.data[i], expected.depth.data[i], 3e-2f) << i;  // a flip at 1/255 moves it that far
    others += seen.median_depth.data[i] != expected.median_depth.data[i];
  }
  EXPECT_LE(others, seen.depth.data.size() / 500) << "median depths differ where half is passed to rounding";
}

TEST(Forward, AlphaKeepsItsDigitsFromTheCutToTheClampWithEveryInstructionSet) {
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    // One pixel in the middle of one splat: alpha is the opacity. All 32nds of an octave, and between.
    for (float logit = -5.53f; logit < 4.5f; logit += 0.0037f) {
      scene::GaussianCloud cloud;
      add_on_axis(cloud, 2, logit, 0.5f);
      const double opacity = std::min(0.99, 1 / (1 + std::exp(-double(logit))));
      ASSERT_NEAR(forward(cloud, one_pixel_camera(), everything()).alpha.at(0, 0), opacity, 5e-7 * opacity + 6e-8)
          << logit;
    }
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(Forward, IsTheSameToTheBitForAnyNumberOfThreads) {
  const auto cloud = cloud_in_view(5000, 13);
  const std::vector<float> weight(cloud.size(), 0.3f);
  std::vector<Rendering> seen(3);
  for (const std::size_t k : {0u, 1u, 2u}) {
    WorkArena arena(1 << k);
    arena.run([&] { seen[k] = forward(cloud, off_centre_camera(300, 200), everything(), weight); });
  }
  EXPECT_TRUE(same_pictures(seen[0], seen[1]));
  EXPECT_TRUE(same_pictures(seen[0], seen[2]));
}

TEST(Forward, APinnedInstructionSetStaysPinnedWhenItsNameIsAsked) {
  const std::string best = simd_target();
  const std::string plainest = simd_targets().back();
  const auto cloud = cloud_in_view(500, 14);
  const auto with_best = forward(cloud, off_centre_camera(), everything());
  ASSERT_TRUE(pin_simd_target(plainest));
  const auto pinned = forward(cloud, off_centre_camera(), everything());
  EXPECT_EQ(simd_target(), plainest);
  EXPECT_TRUE(same_pictures(forward(cloud, off_centre_camera(), everything()), pinned));
  // Instruction sets round differently: had the pin not held, these would be equal to the bit.
  EXPECT_EQ(same_pictures(pinned, with_best), plainest == best);
  ASSERT_TRUE(pin_simd_target(best));
  EXPECT_TRUE(same_pictures(forward(cloud, off_centre_camera(), everything()), with_best));
}

TEST(Forward, PinningAnUnknownInstructionSetNamesTheKnownOnes) {
  const auto pinned = pin_simd_target("AVX1024");
  ASSERT_FALSE(pinned);
  EXPECT_EQ(pinned.error().where, "simd");
  EXPECT_NE(pinned.error().message.find(simd_targets().front()), std::string::npos) << pinned.error().message;
}

TEST(Project, AZeroQuaternionIsTheIdentity) {
  const auto r = rotation_matrix(0.0f, 0.0f, 0.0f, 0.0f);
  EXPECT_EQ(r, (std::array<float, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
}

TEST(Project, ALongNeedleKeepsItsThicknessInFloat) {
  // 1000 pixels long at 45 degrees and as thin as the low pass leaves it: float must agree with double along it.
  const auto camera = off_centre_camera(1280, 1280);
  const std::array<float, 3> mean{0, 0, 2}, log_scale{2.0f, -12.0f, -12.0f};
  const std::array<float, 4> rotation{0.92387953f, 0, 0, 0.38268343f};
  const auto f = project<float>(view_params<float>(camera), mean, log_scale, rotation);
  const auto d =
      project<double>(view_params<double>(camera), {0, 0, 2}, {2.0, -12.0, -12.0}, {0.92387953, 0, 0, 0.38268343});
  for (double t = -500; t <= 500; t += 50) {
    const double along = d.l1 * t + d.l2 * (t + 1), across = d.l3 * (t + 1);
    const float along_f = f.l1 * float(t) + f.l2 * float(t + 1), across_f = f.l3 * float(t + 1);
    EXPECT_NEAR(along_f * along_f + across_f * across_f, along * along + across * across, 5e-3) << t;
  }
}

}  // namespace
}  // namespace engine::render
