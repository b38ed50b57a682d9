#include "engine/select/crumbs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

scene::LayeredCloud shared(scene::GaussianCloud cloud) {
  return {std::make_shared<const scene::GaussianCloud>(std::move(cloud)), nullptr};
}

TEST(CrumbsOf, AreACornerOfAnotherColour) {
  const BoardOnTable scene;
  EXPECT_EQ(crumbs_of(shared(scene.cloud), scene.red), scene.corner);
}

TEST(CrumbsOf, AreNoneWhereAllIsSelected) {
  const BoardOnTable scene;
  EXPECT_TRUE(crumbs_of(shared(scene.cloud), scene.board).empty());
}

TEST(CrumbsOf, AreNoneOfASurfaceThatGoesOn) {
  scene::GaussianCloud cloud;  // half of a wall
  add_sheet(cloud, {0, 0, 0}, 24, 0.1f, {0.6f, 0.4f, 0.2f});
  std::vector<std::uint32_t> half;
  for (std::uint32_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x > 0) half.push_back(row);
  EXPECT_TRUE(crumbs_of(shared(std::move(cloud)), half).empty());
}

TEST(CrumbsOf, AreSmall) {
  const BoardOnTable scene(8);  // 64 rows beside 512
  EXPECT_TRUE(crumbs_of(shared(scene.cloud), scene.red).empty());
}

TEST(CrumbsOf, AreNotBlownUp) {
  BoardOnTable scene;
  scene.cloud.log_scale.set(scene.corner[5], Vec3(std::log(3.0f)));  // it would cover the board
  const auto crumbs = crumbs_of(shared(scene.cloud), scene.red);
  EXPECT_FALSE(std::ranges::binary_search(crumbs, scene.corner[5]));
}

TEST(CrumbsOf, TouchThePart) {
  BoardOnTable scene;
  for (const std::uint32_t row : scene.corner)  // an island in the table
    scene.cloud.mean.set(row, scene.cloud.mean.get(row) + Vec3(-0.6f, -0.6f, -0.12f));
  EXPECT_TRUE(crumbs_of(shared(scene.cloud), scene.red).empty());
}

TEST(CrumbsOf, ASelectionOfNothingOrOfTheOnlyRowHasNone) {
  const auto one = shared(cloud_at({{1, 2, 3}}));
  EXPECT_TRUE(crumbs_of(one, {}).empty());
  EXPECT_TRUE(crumbs_of(one, std::vector<std::uint32_t>{0}).empty());
}

TEST(CrumbsOf, AreTheSameFarAwayAndAtAnySize) {
  for (const float size : {1e-6f, 1e6f}) {
    BoardOnTable scene;
    for (std::uint32_t row = 0; row < scene.cloud.size(); ++row) {
      scene.cloud.mean.set(row, scene.cloud.mean.get(row) * size);
      scene.cloud.log_scale.set(row, scene.cloud.log_scale.get(row) + Vec3(std::log(size)));
    }
    EXPECT_EQ(crumbs_of(shared(scene.cloud), scene.red), scene.corner) << size;
  }
}

}  // namespace
}  // namespace engine::select
