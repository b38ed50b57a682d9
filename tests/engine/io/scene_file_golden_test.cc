// Real captures through the readers and writers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/io/ply.h"
#include "engine/io/scene_file.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

float opacity(float logit) { return 1.0f / (1.0f + std::exp(-logit)); }

/// What any trained scene of a few units across looks like.
void expect_plausible(const scene::GaussianCloud& cloud) {
  EXPECT_FALSE(scene::first_not_finite(cloud));
  const auto box = scene::bounds(cloud);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(box.high[axis] - box.low[axis], 0.1f);
    EXPECT_LT(box.high[axis] - box.low[axis], 1000.0f);
  }
  std::vector<float> scales = cloud.log_scale.x, opacities = cloud.opacity_logit;
  std::ranges::nth_element(scales, scales.begin() + std::ptrdiff_t(scales.size() / 2));
  std::ranges::nth_element(opacities, opacities.begin() + std::ptrdiff_t(opacities.size() / 2));
  EXPECT_GT(scales[scales.size() / 2], -9.0f);
  EXPECT_LT(scales[scales.size() / 2], 0.0f);
  EXPECT_GT(opacity(opacities[opacities.size() / 2]), 0.05f);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    ASSERT_GT(glm::dot(cloud.rotation.get(i), cloud.rotation.get(i)), 1e-6f) << i;
}

TEST(RealScene, FoxComesBackByteForByte) {
  const auto path = support::data_dir() / "fox" / "point_cloud.ply";
  REQUIRE_SHARED(path);
  const auto scene = read_scene(path);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.size(), 62'298u);
  EXPECT_EQ(scene->cloud.sh_degree, 3);
  EXPECT_EQ(scene->cloud.extra_stride, 0u);
  expect_plausible(scene->cloud);
  const support::TempDir folder;
  ASSERT_TRUE(write_scene(folder.path() / "out.ply", *scene, SceneFormat::ply));
  EXPECT_TRUE(support::read_file(folder.path() / "out.ply") == support::read_file(path));
}

TEST(RealScene, FoxSurvivesSpzAndSplat) {
  const auto path = support::data_dir() / "fox" / "point_cloud.ply";
  REQUIRE_SHARED(path);
  const auto scene = read_scene(path);
  ASSERT_TRUE(scene) << scene.error().message;
  const support::TempDir folder;
  for (const char* name : {"out.spz", "out.splat"}) {
    ASSERT_TRUE(write_scene(folder.path() / name, *scene, *format_for(name)));
    const auto back = read_scene(folder.path() / name);
    ASSERT_TRUE(back) << back.error().message;
    ASSERT_EQ(back->cloud.size(), scene->cloud.size());
    for (std::size_t i = 0; i < back->cloud.size(); ++i) {
      ASSERT_LT(glm::length(back->cloud.mean.get(i) - scene->cloud.mean.get(i)), 3e-4f) << i;
      ASSERT_NEAR(opacity(back->cloud.opacity_logit[i]), opacity(scene->cloud.opacity_logit[i]), 0.0021f) << i;
    }
  }
}

TEST(RealScene, CompressedPlyOfAGuitarLoads) {
  const auto path = support::data_dir() / "scenes" / "guitar.compressed.ply";
  REQUIRE_SHARED(path);
  const auto scene = read_scene(path);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.size(), 90'854u);
  EXPECT_EQ(scene->cloud.sh_degree, 0);
  expect_plausible(scene->cloud);
}

TEST(RealScene, SpzOfABikerLoads) {
  const auto path = support::data_dir() / "scenes" / "biker.spz";
  REQUIRE_SHARED(path);
  const auto scene = read_scene(path);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.size(), 152'746u);
  EXPECT_EQ(scene->cloud.sh_degree, 0);
  expect_plausible(scene->cloud);
}

TEST(RealScene, APointCloudIsSentToATrainer) {
  const auto path = support::data_dir() / "garden" / "sparse" / "0" / "points3D.ply";
  REQUIRE_SHARED(path);
  const auto scene = read_scene(path);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::unsupported);
  EXPECT_EQ(scene.error().where, "points3D.ply:header");
  EXPECT_NE(scene.error().message.find("point cloud or mesh, not a trained Gaussian scene"), std::string::npos);
}

}  // namespace
}  // namespace engine::io
