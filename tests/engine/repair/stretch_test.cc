#include "engine/edit/stretch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/engine/edit/block.h"

namespace engine::edit {
namespace {

constexpr int side = 15;
constexpr float spacing = 0.1f;
const Vec3 disc(0.05f, 0.05f, 0.002f);

/// A sheet of flat discs at z = 0, all of them copies that stood there before the deformation.
WorkingScene sheet(Vec3 extent = disc) {
  WorkingScene working;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      add_gaussian(working.cloud, {spacing * float(i), spacing * float(j), 0}, extent, 4, block_color);
  const std::size_t rows = working.cloud.size();
  working.input_rows = rows;
  working.handle.assign(rows, 1);
  working.role.assign(rows, Role::copy);
  for (std::size_t row = 0; row < rows; ++row) working.parent.push_back(std::uint32_t(row));
  working.mean_at_deform = working.cloud.mean;
  return working;
}

/// A deformation: where means go, and how Gaussians are turned on the way.
void move(WorkingScene& working, const std::function<Vec3(Vec3)>& to, const Quat& turn = {1, 0, 0, 0}) {
  working.mean_at_deform = working.cloud.mean;
  for (std::size_t row = 0; row < working.cloud.size(); ++row) {
    working.cloud.mean.set(row, to(working.cloud.mean.get(row)));
    working.cloud.rotation.set(row, turn * working.cloud.rotation.get(row));
  }
}

/// Standard deviation of a row along a direction.
double extent_along(const WorkingScene& working, std::size_t row, DVec3 direction) {
  const DQuat rotation = glm::normalize(DQuat(working.cloud.rotation.get(row)));
  const DVec3 scale = glm::exp(DVec3(working.cloud.log_scale.get(row)));
  return glm::length(scale * (glm::conjugate(rotation) * glm::normalize(direction)));
}

TEST(DrawOut, ASheetTwiceAsWideKeepsItsGaussiansOverlapping) {
  WorkingScene working = sheet();
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  EXPECT_EQ(draw_out(working), working.cloud.size());
  for (std::size_t row = 0; row < working.cloud.size(); ++row) {
    EXPECT_GT(extent_along(working, row, {1, 0, 0}), 1.7 * double(disc.x)) << row;
    EXPECT_LT(extent_along(working, row, {1, 0, 0}), 2.01 * double(disc.x)) << row;
    EXPECT_NEAR(extent_along(working, row, {0, 1, 0}), double(disc.y), 1e-3) << row;
    EXPECT_NEAR(extent_along(working, row, {0, 0, 1}), double(disc.z), 1e-5) << row;
  }
}

TEST(DrawOut, WhatIsTurnedAsWellIsDrawnOutAlongItsNewDirection) {
  WorkingScene working = sheet();
  const Quat quarter = glm::angleAxis(1.5707963f, Vec3(0, 1, 0));
  move(
      working, [&](Vec3 p) { return quarter * Vec3(2 * p.x, p.y, p.z) + Vec3(3, 0, 1); }, quarter);
  draw_out(working);
  const std::size_t middle = side * (side / 2) + side / 2;
  EXPECT_GT(extent_along(working, middle, {0, 0, 1}), 1.7 * double(disc.x));
  EXPECT_NEAR(extent_along(working, middle, {0, 1, 0}), double(disc.y), 1e-3);
  EXPECT_NEAR(extent_along(working, middle, {1, 0, 0}), double(disc.z), 1e-5);
}

TEST(DrawOut, TurningAndShiftingLeaveTheBytesAlone) {
  WorkingScene working = sheet();
  const Quat turn = glm::angleAxis(0.7f, glm::normalize(Vec3(1, 2, 3)));
  move(
      working, [&](Vec3 p) { return turn * p + Vec3(5, -2, 0.3f); }, turn);
  const scene::GaussianCloud before = working.cloud;
  EXPECT_EQ(draw_out(working), 0u);
  EXPECT_EQ(working.cloud.rotation, before.rotation);
  EXPECT_EQ(working.cloud.log_scale, before.log_scale);
}

TEST(DrawOut, UndoingTheStretchUndoesIt) {
  WorkingScene working = sheet();
  move(working, [](Vec3 p) { return Vec3(1.3f * p.x, p.y, p.z); });
  draw_out(working);
  for (std::size_t row = 0; row < working.cloud.size(); ++row)
    ASSERT_GT(extent_along(working, row, {1, 0, 0}), 1.15 * double(disc.x)) << row;
  move(working, [](Vec3 p) { return Vec3(p.x / 1.3f, p.y, p.z); });
  draw_out(working);
  for (std::size_t row = 0; row < working.cloud.size(); ++row)
    EXPECT_NEAR(extent_along(working, row, {1, 0, 0}), double(disc.x), 0.05 * double(disc.x)) << row;
}

TEST(DrawOut, NothingIsSmearedOverATear) {
  WorkingScene working = sheet();
  const float middle = 0.5f * spacing * side;
  move(working, [&](Vec3 p) { return p.x < middle ? p : p + Vec3(2, 0, 0); });
  EXPECT_EQ(draw_out(working), 0u);
}

TEST(DrawOut, OnlyCopiesChange) {
  WorkingScene working = sheet();
  for (std::size_t row = 0; row < side; ++row) working.role[row] = Role::held;
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  const scene::GaussianCloud before = working.cloud;
  EXPECT_EQ(draw_out(working), working.cloud.size() - side);
  for (std::size_t row = 0; row < side; ++row) EXPECT_EQ(working.cloud.log_scale.get(row), before.log_scale.get(row));
}

TEST(DrawOut, TooFewCopiesSayNothing) {
  WorkingScene working = sheet();
  for (std::size_t row = 10; row < working.role.size(); ++row) working.role[row] = Role::frozen;
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  EXPECT_EQ(draw_out(working), 0u);
}

TEST(DrawOut, StaysFiniteAtTheExtremes) {
  for (const Vec3& extent : {Vec3(1e-30f), Vec3(1e30f), Vec3(1e18f, 1, 1e-18f), Vec3(0.05f, 0.05f, 1e-37f)})
    for (const float stretch : {0.0f, 1e-12f, 0.5f, 2.0f, 1e12f}) {
      WorkingScene working = sheet(extent);
      working.cloud.rotation.set(3, Quat(0, 0, 0, 0));
      move(working, [&](Vec3 p) { return Vec3(stretch * p.x, p.y, p.z); });
      draw_out(working);
      for (std::size_t row = 0; row < working.cloud.size(); ++row) {
        const Vec3 log_scale = working.cloud.log_scale.get(row);
        const Quat rotation = working.cloud.rotation.get(row);
        ASSERT_TRUE(std::isfinite(log_scale.x + log_scale.y + log_scale.z)) << row;
        ASSERT_TRUE(std::isfinite(glm::dot(rotation, rotation))) << row;
      }
    }
}

TEST(DrawOut, CopiesInOnePlaceStayAsTheyAre) {
  WorkingScene working = sheet();
  move(working, [](Vec3) { return Vec3(1, 1, 1); });
  move(working, [](Vec3) { return Vec3(2, 1, 1); });
  const scene::GaussianCloud before = working.cloud;
  EXPECT_EQ(draw_out(working), 0u);
  EXPECT_EQ(working.cloud.log_scale, before.log_scale);
}

}  // namespace
}  // namespace engine::edit
