#include "engine/io/scene_loss.h"

#include <gtest/gtest.h>

#include "engine/io/quantised.h"
#include "tests/engine/io/samples.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

SceneFile file_of(scene::GaussianCloud cloud) {
  const int degree = cloud.sh_degree;
  return {std::move(cloud), inria_layout(degree)};
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

TEST(SceneLoss, TellsWhatIsClippedFromWhatIsRounded) {
  SceneFile before = file_of(random_cloud(100, 0, 64));
  for (std::size_t i = 0; i < before.cloud.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) before.cloud.sh_row(i)[c] = float(double(i) / 100 - 0.5);  // within 0..1
  before.cloud.sh_row(7)[1] = float(0.75 / sh_c0);                                                 // displayed as 1.25
  before.cloud.log_scale.x[3] = -12.5f;
  const support::TempDir folder;
  const auto losses_of = [&](SceneFormat format) {
    const auto path = folder.path() / "scene";
    EXPECT_TRUE(write_scene(path, before, format));
    const auto after = read_scene(path);
    EXPECT_TRUE(after);
    return scene_loss(before, *after, format);
  };
  const auto splat = losses_of(SceneFormat::splat), spz = losses_of(SceneFormat::spz);
  EXPECT_NEAR(splat[4].clipped_part, 1.0 / 300, 1e-9);
  EXPECT_NEAR(splat[4].most_clipped, 0.25, 1e-6);
  EXPECT_LT(splat[4].largest, 0.51 / 255) << "half a step of rounding is all that is left";
  EXPECT_EQ(splat[1].clipped_part, 0) << "its scales are floats";
  EXPECT_EQ(spz[4].clipped_part, 0) << "it has room for that colour";
  EXPECT_NEAR(spz[1].clipped_part, 1.0 / 300, 1e-9);
  EXPECT_NEAR(spz[1].most_clipped, 2.5, 1e-6);
  EXPECT_LE(spz[1].largest, 1.0 / 32 + 1e-6);
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
