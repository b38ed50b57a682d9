#include "engine/deform/rigid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "engine/core/rng.h"

namespace engine::deform {
namespace {

constexpr double pi = std::numbers::pi;

std::vector<DVec3> random_points(std::size_t n, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<DVec3> points(n);
  for (DVec3& p : points) p = {double(rng.uniform(-1, 1)), double(rng.uniform(-1, 1)), double(rng.uniform(-1, 1))};
  return points;
}

std::vector<DVec3> moved(const std::vector<DVec3>& points, const DQuat& turn, const DVec3& shift) {
  std::vector<DVec3> out;
  for (const DVec3& point : points) out.push_back(turn * point + shift);
  return out;
}

double angle_of(const DQuat& q) { return 2 * std::atan2(glm::length(DVec3(q.x, q.y, q.z)), std::abs(q.w)); }

std::vector<Drag> drags(const std::vector<DVec3>& from, const std::vector<DVec3>& to, int group = 0) {
  std::vector<Drag> out;
  for (std::size_t i = 0; i < from.size(); ++i) out.push_back({from[i], to[i], group});
  return out;
}

TEST(FitRigid, FindsTheMotionThatThereIs) {
  const auto points = random_points(7, 1);
  for (const double angle : {1e-6, 0.3, 1.5, 3.0, 3.1415}) {
    const DQuat turn = glm::angleAxis(angle, glm::normalize(DVec3(1, -2, 0.5)));
    const auto targets = moved(points, turn, DVec3(3, 4, -5));
    const RigidMotion motion = fit_rigid(points, targets);
    EXPECT_LT(motion.residual, 1e-9) << angle;
    EXPECT_NEAR(angle_of(motion.turn), angle, 1e-9);
    EXPECT_NEAR(glm::dot(motion.turn, motion.turn), 1, 1e-12);
  }
}

TEST(FitRigid, ASetThatIsNotRigidLeavesSomething) {
  auto points = random_points(7, 2);
  auto targets = moved(points, glm::angleAxis(0.4, DVec3(0, 0, 1)), DVec3(0));
  targets[3] += DVec3(0.5, 0, 0);
  EXPECT_GT(fit_rigid(points, targets).residual, 0.2);
}

TEST(FitRigid, PointsInARowTurnByTheLeastAngle) {
  const std::vector<DVec3> row{DVec3(0, 0, 0), DVec3(1, 0, 0), DVec3(2, 0, 0)};
  const std::vector<DVec3> upright{DVec3(0, 0, 0), DVec3(0, 1, 0), DVec3(0, 2, 0)};
  const RigidMotion motion = fit_rigid(row, upright);
  EXPECT_NEAR(angle_of(motion.turn), pi / 2, 1e-9);
  EXPECT_LT(motion.residual, 1e-9);
  EXPECT_LT(glm::distance(motion(DVec3(0, 0, 1)), DVec3(0, 0, 1)), 1e-9) << "nothing turns about the row";
}

TEST(TurnWholeGroups, APieceThatIsOnlyAlmostInARowIsNotTwisted) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    std::vector<DVec3> from, to;
    const auto jitter = [&] { return 0.003 * double(rng.uniform(-1, 1)); };
    for (int i = 0; i < 4; ++i) {
      from.push_back({0.5 * i, jitter(), jitter()});
      to.push_back(DVec3(0.5 * i, 1 + jitter(), jitter()));
    }
    const auto all = drags(from, to);
    EXPECT_TRUE(moves_as_one_piece(all, 0)) << seed;
    auto motions = handle_motions(all, Rotation::shortest_arc);
    turn_whole_groups(all, motions);
    EXPECT_LT(angle_of(motions[0].rotation), 0.1) << seed << ": it is a shift, by hand";
  }
}

TEST(TurnWholeGroups, HandlesThatStayAreOnePiece) {
  const std::vector<DVec3> points{DVec3(0.1, 0.2, 0.3), DVec3(0.7, 0.11, 0.13), DVec3(1e3, 0.3, 0.9)};
  EXPECT_TRUE(moves_as_one_piece(drags(points, points), 0));
}

TEST(FitRigid, WhatOnlyShiftsDoesNotTurnAtAll) {
  const auto points = random_points(5, 3);
  EXPECT_EQ(fit_rigid(points, moved(points, DQuat(1, 0, 0, 0), DVec3(1e3, -7, 0.1))).turn, DQuat(1, 0, 0, 0));
  const std::vector<DVec3> one{DVec3(1, 2, 3)}, there{DVec3(4, 5, 6)};
  EXPECT_EQ(fit_rigid(one, there).turn, DQuat(1, 0, 0, 0));
  EXPECT_EQ(fit_rigid(one, there).residual, 0);
  const std::vector<DVec3> twice{DVec3(1), DVec3(1)}, apart{DVec3(1), DVec3(2)};
  EXPECT_EQ(fit_rigid(twice, apart).turn, DQuat(1, 0, 0, 0));
  EXPECT_GT(fit_rigid(twice, apart).residual, 0.5);
  EXPECT_EQ(fit_rigid({}, {}).residual, 0);
}

TEST(FitRigid, AHalfTurnIsNoLeastOneAndLeavesSomething) {
  const auto points = random_points(6, 4);
  const auto targets = moved(points, DQuat(0, 0, 1, 0), DVec3(0));
  const RigidMotion motion = fit_rigid(points, targets);
  EXPECT_EQ(motion.turn, DQuat(1, 0, 0, 0));
  EXPECT_GT(motion.residual, 0.5);
}

TEST(FitRigid, StaysFiniteAtTheExtremes) {
  for (const double scale : {1e-150, 1e-12, 1e12, 1e70}) {
    auto points = random_points(5, 5);
    for (DVec3& point : points) point *= scale;
    const RigidMotion motion = fit_rigid(points, moved(points, glm::angleAxis(0.7, DVec3(0, 1, 0)), DVec3(0)));
    EXPECT_TRUE(std::isfinite(motion.residual)) << scale;
    EXPECT_NEAR(glm::dot(motion.turn, motion.turn), 1, 1e-9) << scale;
  }
}

TEST(TurnWholeGroups, APieceTurnsWithoutChangingItsShape) {
  const auto points = random_points(6, 6);
  const DQuat turn = glm::angleAxis(1.2, glm::normalize(DVec3(3, 1, 2)));
  const auto all = drags(points, moved(points, turn, DVec3(1, 0, 0)));
  EXPECT_TRUE(moves_as_one_piece(all, 0));
  auto motions = handle_motions(all, Rotation::shortest_arc);
  const DVec3 somewhere(0.3, -0.2, 0.4);
  const DVec3 right = turn * somewhere + DVec3(1, 0, 0);
  EXPECT_GT(glm::distance(gaussian_motion(somewhere, motions, 0, Interpolation::rigid).mean, right), 0.01)
      << "pairs do not know how the whole turns";
  turn_whole_groups(all, motions);
  EXPECT_LT(glm::distance(gaussian_motion(somewhere, motions, 0, Interpolation::rigid).mean, right), 1e-9);
}

TEST(TurnWholeGroups, LeavesOthersAndAnchorsAlone) {
  const auto points = random_points(4, 7);
  const DQuat turn = glm::angleAxis(0.8, DVec3(0, 0, 1));
  auto all = drags(points, moved(points, turn, DVec3(0)), 1);
  all.push_back({DVec3(0), DVec3(0), 1, true});  // the hinge
  const auto bent = random_points(4, 8);
  for (const Drag& drag : drags(points, bent, 2)) all.push_back(drag);
  EXPECT_TRUE(moves_as_one_piece(all, 1)) << "the hinge stays where the turn has it too";
  EXPECT_FALSE(moves_as_one_piece(all, 2));
  EXPECT_TRUE(moves_as_one_piece(all, 3)) << "nobody there";
  auto motions = handle_motions(all, Rotation::shortest_arc);
  const auto before = motions;
  turn_whole_groups(all, motions);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(angle_of(motions[i].rotation), 0.8, 1e-9);
  EXPECT_EQ(motions[4].rotation, DQuat(1, 0, 0, 0));
  for (std::size_t i = 5; i < all.size(); ++i) EXPECT_EQ(motions[i].rotation, before[i].rotation);
}

}  // namespace
}  // namespace engine::deform
