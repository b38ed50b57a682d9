#include "engine/deform/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace engine::deform {
namespace {

void expect_near(DVec3 found, DVec3 expected, double tolerance = 1e-9) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(found[axis], expected[axis], tolerance) << axis;
}

std::vector<Drag> turned(double angle, DVec3 shift) {
  const DQuat turn = glm::angleAxis(angle, DVec3(0, 0, 1));
  std::vector<Drag> drags;
  for (const DVec3 source : {DVec3(1, 0, 0), DVec3(2, 0, 0), DVec3(1, 1, 0)})
    drags.push_back({source, turn * source + shift});
  return drags;
}

TEST(Path, OfOneHandleIsStraight) {
  const std::vector<Drag> drags{{DVec3(1, 2, 3), DVec3(3, 2, 3)}};
  expect_near(Path(drags).position(0, 0.25), DVec3(1.5, 2, 3));
}

TEST(Path, OfAPieceThatTurnsGoesRound) {
  const auto drags = turned(0.5 * std::numbers::pi, DVec3(0, 0, 4));
  const Path path(drags);
  const double half = std::sqrt(0.5);
  expect_near(path.position(0, 0.5), DVec3(half, half, 2));
  expect_near(path.position(1, 0.5), DVec3(2 * half, 2 * half, 2));
  EXPECT_NEAR(path.farthest_turn(), 0.5 * std::numbers::pi, 1e-9);
}

TEST(Path, GoesHalfRoundAndTheLongWayWhereHandlesSaySo) {
  auto drags = turned(std::numbers::pi, DVec3(0.0));
  EXPECT_NEAR(glm::length(Path(drags).position(1, 0.5)), 2, 1e-9) << "round, not through the middle";
  const double angle = 1.5 * std::numbers::pi;
  drags = turned(angle, DVec3(0.0));
  for (Drag& drag : drags) drag.turn = DQuat(std::cos(angle / 2), 0, 0, std::sin(angle / 2));
  const double half = std::sqrt(0.5);
  expect_near(Path(drags).position(0, 0.5), DVec3(-half, half, 0));
}

TEST(Path, EndsWhereAskedExactly) {
  auto drags = turned(1.0, DVec3(0.3, -0.1, 0.2));
  drags[1].target += DVec3(0.05, 0, 0);
  const Path path(drags);
  for (std::size_t i = 0; i < drags.size(); ++i) {
    EXPECT_EQ(path.position(i, 0), drags[i].source);
    EXPECT_EQ(path.position(i, 1), drags[i].target);
  }
}

TEST(Path, LeavesAnchorsWhereTheyAre) {
  auto drags = turned(1.0, DVec3(0.0));
  drags.push_back({DVec3(7, 7, 7), DVec3(9, 9, 9), 0, true});
  EXPECT_EQ(Path(drags).position(3, 0.5), DVec3(7, 7, 7));
}

TEST(Path, OfAnotherGroupIsItsOwn) {
  auto drags = turned(1.0, DVec3(0.0));
  drags.push_back({DVec3(0.0), DVec3(1, 0, 0), 1});
  expect_near(Path(drags).position(3, 0.5), DVec3(0.5, 0, 0));
}

TEST(PartOfTurn, GoesTheLongWayWhereAsked) {
  const double angle = 1.5 * std::numbers::pi;  // as a quaternion with w < 0
  const DQuat turn(std::cos(angle / 2), 0, 0, std::sin(angle / 2));
  ASSERT_LT(turn.w, 0);
  const DQuat half = part_of_turn(turn, 0.5);
  expect_near(half * DVec3(1, 0, 0), DVec3(std::cos(angle / 2), std::sin(angle / 2), 0));
  EXPECT_EQ(part_of_turn(turn, 1), turn);
}

TEST(PartOfTurn, OfNoneIsNone) {
  EXPECT_EQ(part_of_turn(DQuat(1, 0, 0, 0), 0.3), DQuat(1, 0, 0, 0));
  EXPECT_EQ(part_of_turn(DQuat(-1, 0, 0, 0), 0.3), DQuat(1, 0, 0, 0)) << "a full turn about no axis";
}

TEST(Path, GrowsEvenly) {
  Drag drag{DVec3(0.0), DVec3(0.0)};
  drag.scale = 100;
  EXPECT_NEAR(Path(std::vector<Drag>{drag}).scale(0, 0.5), 10, 1e-12);
}

}  // namespace
}  // namespace engine::deform
