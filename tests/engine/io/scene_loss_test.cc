#include "engine/io/scene_loss.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "engine/io/compressed_ply.h"
#include "engine/io/quantised.h"
#include "engine/io/splat.h"
#include "engine/io/spz.h"
#include "tests/engine/io/samples.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

SceneFile file_of(scene::GaussianCloud cloud) {
  const int degree = cloud.sh_degree;
  return {std::move(cloud), inria_layout(degree)};
}

/// Its SH within what all formats hold.
SceneFile tame(scene::GaussianCloud cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (float& value : cloud.sh_row(i)) value = std::clamp(value, -0.9f, 0.9f);
  return file_of(std::move(cloud));
}

TEST(SceneLoss, IsNothingOfTheSameScene) {
  const SceneFile scene = file_of(random_cloud(50, 2, 61));
  for (const AttributeLoss& loss : scene_loss(scene, scene, SceneFormat::ply))
    EXPECT_LT(loss.largest, 1e-6) << loss.attribute;
}

TEST(SceneLoss, HasTheLargestAndTheMeanOfEachAttribute) {
  const SceneFile before = file_of(random_cloud(4, 1, 62));
  SceneFile after = before;
  after.cloud.mean.x[1] += 0.5f;
  after.cloud.log_scale.z[2] -= 0.25f;
  after.cloud.rotation.set(3, before.cloud.rotation.get(3) * Quat(std::cos(0.05f), 0, std::sin(0.05f), 0));
  after.cloud.rotation.set(0, before.cloud.rotation.get(0) * Quat(0, 0, 0, 1));  // a half turn changes nothing
  after.cloud.sh_row(1)[5] += 0.125f;
  const auto losses = scene_loss(before, after, SceneFormat::ply);
  ASSERT_EQ(losses.size(), 6u);
  EXPECT_NEAR(losses[0].largest, 0.5, 1e-6);
  EXPECT_NEAR(losses[0].mean, 0.125, 1e-6);
  EXPECT_NEAR(losses[1].largest, 0.25, 1e-6);
  EXPECT_NEAR(losses[1].mean, 0.25 / 12, 1e-6);
  EXPECT_NEAR(losses[2].largest, 0.1 * 180 / 3.14159265, 1e-4);
  EXPECT_NEAR(losses[5].largest, 0.125, 1e-6);
  EXPECT_NEAR(losses[5].mean, 0.125 / 36, 1e-6);
}

/// What a scene loses by being written and read again.
auto losses_of(const SceneFile& before, SceneFormat format) {
  const support::TempDir folder;
  const auto path = folder.path() / "scene";
  EXPECT_TRUE(write_scene(path, before, format));
  const auto after = read_scene(path);
  EXPECT_TRUE(after);
  return scene_loss(before, *after, format);
}

TEST(SceneLoss, TellsWhatIsClippedFromWhatIsRounded) {
  SceneFile before = file_of(random_cloud(100, 0, 64));
  for (std::size_t i = 0; i < before.cloud.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) before.cloud.sh_row(i)[c] = float(double(i) / 100 - 0.5);  // within 0..1
  before.cloud.sh_row(7)[1] = float(0.75 / sh_c0);                                                 // displayed as 1.25
  before.cloud.log_scale.x[3] = -12.5f;
  const auto splat = losses_of(before, SceneFormat::splat), spz = losses_of(before, SceneFormat::spz);
  EXPECT_NEAR(splat[4].clipped_part, 1.0 / 300, 1e-9);
  EXPECT_NEAR(splat[4].most_clipped, 0.25, 1e-6);
  EXPECT_LT(splat[4].largest, 0.51 / 255) << "half a step of rounding is all that is left";
  EXPECT_EQ(splat[1].clipped_part, 0) << "its scales are floats";
  EXPECT_EQ(spz[4].clipped_part, 0) << "it has room for that colour";
  EXPECT_NEAR(spz[1].clipped_part, 1.0 / 300, 1e-9);
  EXPECT_NEAR(spz[1].most_clipped, 2.5, 1e-6);
  EXPECT_LE(spz[1].largest, 1.0 / 32 + 1e-6);
}

TEST(SceneLoss, IsNoClippingWhereOnlyTheEndIsRounded) {
  const SceneFile drawn = tame(random_cloud(200, 1, 65));
  const support::TempDir folder;
  for (const SceneFormat format : {SceneFormat::splat, SceneFormat::spz, SceneFormat::compressed_ply}) {
    SceneFile before = drawn;
    // To the ends of what the format holds, and half a step farther.
    for (std::size_t i = 0; i < before.cloud.size(); ++i) {
      const float sign = i % 2 == 0 ? 1.0f : -1.0f;
      const std::size_t pair = i / 2;
      const double share = double(pair) / 99;  // of that half step
      const auto reach = [&](const StoredRange& range) {
        return float(sign * (std::min(range.high, -range.low) + 0.999 * share * range.step / 2));
      };
      if (format != SceneFormat::compressed_ply)
        before.cloud.sh_row(i)[0] = reach(format == SceneFormat::splat ? splat_f_dc : spz_f_dc);
      if (format != SceneFormat::splat)
        before.cloud.sh_row(i)[2] = reach(format == SceneFormat::spz ? spz_sh : compressed_ply_sh);
    }
    const auto path = folder.path() / "scene";
    ASSERT_TRUE(write_scene(path, before, format));
    const auto after = read_scene(path);
    ASSERT_TRUE(after);
    for (const AttributeLoss& loss : scene_loss(before, *after, format))
      EXPECT_EQ(loss.clipped_part, 0) << extension_of(format) << ": " << loss.attribute;
  }
}

TEST(SceneLoss, IsNothingOfASplatFileWithBlackAndWhite) {
  SceneFile black_and_white = file_of(random_cloud(30, 0, 66));
  for (std::size_t i = 0; i < 30; ++i)
    for (std::size_t c = 0; c < 3; ++c) black_and_white.cloud.sh_row(i)[c] = (i + c) % 3 == 0 ? 1.0f : i % 2 ? 2 : -2;
  const support::TempDir folder;
  const auto first = folder.path() / "first", second = folder.path() / "second";
  ASSERT_TRUE(write_scene(first, black_and_white, SceneFormat::splat));
  const auto before = read_scene(first);
  ASSERT_TRUE(before);
  ASSERT_TRUE(write_scene(second, *before, SceneFormat::splat));
  const auto after = read_scene(second);
  ASSERT_TRUE(after);
  for (const AttributeLoss& loss : scene_loss(*before, *after, SceneFormat::splat)) {
    EXPECT_EQ(loss.clipped_part, 0) << loss.attribute;
    EXPECT_EQ(loss.largest, 0) << loss.attribute;
  }
}

TEST(SceneLoss, TellsWhatIsClippedOfShAndOfLogScales) {
  SceneFile before = tame(random_cloud(100, 1, 67));
  before.cloud.sh_row(5)[3] = 6.5f;
  before.cloud.log_scale.y[8] = -25;
  const auto spz = losses_of(before, SceneFormat::spz), compressed = losses_of(before, SceneFormat::compressed_ply);
  EXPECT_NEAR(spz[5].most_clipped, 6.5 - 127.0 / 128, 1e-6);
  EXPECT_LE(spz[5].largest, 0.5 / 128 + 1e-6);
  EXPECT_NEAR(compressed[5].most_clipped, 2.5, 1e-6);
  EXPECT_NEAR(compressed[5].clipped_part, 1.0 / 900, 1e-9);
  EXPECT_LE(compressed[5].largest, 1.0 / 32 + 1e-6);
  for (const SceneFormat format : {SceneFormat::splat, SceneFormat::glb, SceneFormat::compressed_ply}) {
    const auto losses = losses_of(before, format);
    EXPECT_NEAR(losses[1].most_clipped, 5, 1e-5) << extension_of(format);
    EXPECT_NEAR(losses[1].clipped_part, 1.0 / 300, 1e-9) << extension_of(format);
    EXPECT_LT(losses[1].largest, 1) << extension_of(format) << ": what is left is rounded";
  }
}

TEST(SceneLoss, FollowsTheOrderInWhichRowsWereWritten) {
  const SceneFile before = file_of(random_cloud(900, 1, 63));
  const support::TempDir folder;
  for (const SceneFormat format :
       {SceneFormat::sog, SceneFormat::compressed_ply, SceneFormat::spz, SceneFormat::splat}) {
    const auto path = folder.path() / "scene";
    ASSERT_TRUE(write_scene(path, before, format));
    const auto after = read_scene(path);
    ASSERT_TRUE(after);
    const auto losses = scene_loss(before, *after, format);
    EXPECT_LT(losses[0].largest, 0.01) << extension_of(format);
    EXPECT_GT(losses[3].largest, 1e-4) << "a byte of opacity is not nothing";
    EXPECT_LT(losses[3].mean, losses[3].largest);
  }
}

}  // namespace
}  // namespace engine::io
