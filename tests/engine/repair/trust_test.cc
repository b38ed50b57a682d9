#include "engine/repair/trust.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/samples.h"

namespace engine::repair {
namespace {

using edit::add_gaussian, edit::arc_of_cameras, edit::ball_before_wall, edit::block_color, edit::floor_color;
using working::Role;

/// An opaque wall at z = 0 without a gap, and one Gaussian each before it, behind it, beside the pictures.
struct Wall {
  scene::GaussianCloud cloud;
  std::uint32_t before = 0, behind = 0, beside = 0;

  Wall() {
    for (int i = -30; i <= 30; ++i)
      for (int j = -30; j <= 30; ++j)
        add_gaussian(cloud, {0.1f * float(i), 0.1f * float(j), 0}, {0.08f, 0.08f, 0.01f}, 4, floor_color);
    before = add({0, 0, -0.5f}), behind = add({0, 0, 0.5f}), beside = add({0, -9, 0});
  }
  std::uint32_t add(Vec3 mean) {
    add_gaussian(cloud, mean, Vec3(0.1f), 2, block_color);
    return std::uint32_t(cloud.size() - 1);
  }
};

TEST(ObservedRows, CountWhatIsSeenAndNotWhatIsHiddenOrOutside) {
  const Wall wall;
  const auto observed = observed_rows(shown_rows(wall.cloud, arc_of_cameras(3, 64)));
  ASSERT_EQ(observed.size(), wall.cloud.size());
  EXPECT_EQ(observed[wall.before], 1);
  EXPECT_LT(observed[wall.behind], 0.05f);
  EXPECT_EQ(observed[wall.beside], 0);
  EXPECT_EQ(observed[61 * 30 + 30], 1) << "the middle of the wall";
}

TEST(ObservedRows, OneCameraThatSeesItIsEnough) {
  const Wall wall;
  auto cameras = arc_of_cameras(3, 64);
  cameras.push_back(scene::look_at(DVec3(0, 0, 3), DVec3(0), DVec3(0, -1, 0), 0.9, 64, 64));
  const auto observed = observed_rows(shown_rows(wall.cloud, cameras));
  EXPECT_EQ(observed[wall.before], 1);
  EXPECT_EQ(observed[wall.behind], 1);
}

TEST(ObservedRows, WithoutCamerasNothingIs) {
  const Wall wall;
  EXPECT_EQ(observed_rows(shown_rows(wall.cloud, {})), std::vector<float>(wall.cloud.size(), 0.0f));
}

TEST(ObservedRows, AFaintGaussianInFullViewIs) {
  Wall wall;
  wall.cloud.opacity_logit[wall.before] = -4;  // opacity 0.018
  EXPECT_EQ(observed_rows(shown_rows(wall.cloud, arc_of_cameras(3, 64)))[wall.before], 1);
}

/// The working scene of `scene` in which rows [0, dragged) have copies at `at(row's mean)`.
WorkingScene with_copies(const scene::GaussianCloud& scene, std::size_t dragged, const std::function<Vec3(Vec3)>& at) {
  working::HandleColumn handle(scene.size(), 0);
  std::fill_n(handle.begin(), dragged, std::uint16_t(1));
  WorkingScene working(scene, working::Frame(), std::move(handle));
  std::vector<std::uint32_t> rows(dragged);
  for (std::uint32_t row = 0; row < dragged; ++row) rows[row] = row;
  working.append(scene, rows, std::vector<Role>(dragged, Role::copy), rows);
  for (const std::uint32_t row : rows) {
    working.gaussians().mean.set(scene.size() + row, at(scene.mean.get(row)));
    working.leave_behind(row);
  }
  EXPECT_TRUE(working.check());
  return working;
}

/// A copy of the row's Gaussian, of this role.
std::uint32_t append_one(WorkingScene& working, Role role, std::uint32_t row) {
  return working.append(working.cloud(), std::span(&row, 1), std::span(&role, 1), std::span(&row, 1));
}

std::vector<float> some_observed(std::size_t rows) {
  std::vector<float> observed(rows);
  for (std::size_t row = 0; row < rows; ++row) observed[row] = float(row % 11) / 10;
  return observed;
}

TEST(TrustOfRows, CopiesInheritAndOriginalsOfAMoveHaveNone) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  const std::size_t n = scene.size();
  const auto observed = some_observed(n);
  const Quat turn = glm::angleAxis(1.1f, glm::normalize(Vec3(1, 2, -1)));
  const WorkingScene working = with_copies(scene, 50, [&](Vec3 mean) { return turn * mean + Vec3(3, 1, 2); });
  for (const Mode mode : {Mode::move, Mode::extend}) {
    const auto trust = trust_of_rows(working, observed, mode);
    ASSERT_EQ(trust.size(), n + 50);
    for (std::size_t row = 0; row < n; ++row)
      EXPECT_EQ(trust[row], row < 50 && mode == Mode::move ? 0 : observed[row]) << row;
    for (std::size_t row = 0; row < 50; ++row) EXPECT_EQ(trust[n + row], observed[row]) << row << ": rigidly moved";
  }
}

TEST(TrustOfRows, CopiesAreTrustedTheLessTheMoreTheyAreDrawnApart) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  const std::vector<float> observed(scene.size(), 0.8f);
  // Stretched evenly by f, each is f times as far from its neighbours: trusted fully to 1.6, not at all from 3 on.
  for (const auto& [factor, expected] :
       {std::pair{0.2f, 1.0f}, {1.5f, 1.0f}, {2.3f, 0.5f}, {2.86f, 0.1f}, {3.1f, 0.0f}}) {
    const float f = factor;
    const auto trust = trust_of_rows(with_copies(scene, 50, [f](Vec3 mean) { return f * mean; }), observed, Mode::move);
    for (std::size_t row = scene.size(); row < trust.size(); ++row)
      EXPECT_NEAR(trust[row], 0.8f * expected, 1e-3) << factor << ", " << row;
  }
}

TEST(TrustOfRows, ChildrenOfACopyFareAsItDoes) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  WorkingScene working = with_copies(scene, 50, [](Vec3 mean) { return 2.3f * mean; });
  const std::uint32_t copy = std::uint32_t(scene.size()) + 7;
  const std::uint32_t child = append_one(working, Role::copy, copy);
  working.gaussians().mean.set(child, {5, 5, 5});
  const auto trust = trust_of_rows(working, std::vector<float>(scene.size(), 1.0f), Mode::move);
  EXPECT_EQ(trust.back(), trust[copy]);
  EXPECT_NEAR(trust.back(), 0.5f, 1e-3);
}

TEST(TrustOfRows, SeedsAreTrustedAndTooFewCopiesAreNotJudged) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  WorkingScene working = with_copies(scene, 16, [](Vec3 mean) { return 9.0f * mean; });
  append_one(working, Role::seed, 3);
  const auto trust = trust_of_rows(working, std::vector<float>(scene.size(), 0.5f), Mode::move);
  EXPECT_EQ(trust.back(), 1);
  for (std::size_t row = scene.size(); row < scene.size() + 16; ++row) EXPECT_EQ(trust[row], 0.5f) << row;
}

TEST(TrustOfRows, WithoutCopiesItIsWhatWasObserved) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  const auto observed = some_observed(scene.size());
  EXPECT_EQ(trust_of_rows(with_copies(scene, 0, [](Vec3 mean) { return mean; }), observed, Mode::move), observed);
}

}  // namespace
}  // namespace engine::repair
