#include "engine/repair/stretch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "tests/engine/edit/block.h"

namespace engine::repair {
namespace {

using edit::add_gaussian, edit::block_color;
using working::Role;

constexpr int side = 15;
constexpr std::size_t discs = side * side;
constexpr float spacing = 0.1f;
const Vec3 disc(0.05f, 0.05f, 0.002f);

/// A sheet of flat discs at z = 0: frozen rows, held ones, or originals with copies, which stand where they do.
WorkingScene sheet(
    Vec3 extent = disc, const std::function<Role(std::size_t)>& role = [](std::size_t) { return Role::copy; }) {
  scene::GaussianCloud input;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      add_gaussian(input, {spacing * float(i), spacing * float(j), 0}, extent, 4, block_color);
  working::HandleColumn handle;
  std::vector<std::uint32_t> copied;
  for (std::size_t row = 0; row < input.size(); ++row) {
    handle.push_back(role(row) == Role::frozen ? 0 : 1);
    if (role(row) == Role::copy) copied.push_back(std::uint32_t(row));
  }
  WorkingScene working(input, working::Frame(), std::move(handle));
  working.append(input, copied, std::vector<Role>(copied.size(), Role::copy), copied);
  for (const std::uint32_t row : copied) working.leave_behind(row);
  EXPECT_TRUE(working.check());
  return working;
}

/// A deformation: where the means of P_h go, and how its Gaussians are turned on the way.
void move(WorkingScene& working, const std::function<Vec3(Vec3)>& to, const Quat& turn = {1, 0, 0, 0}) {
  for (const std::uint32_t row : working.dragged_rows()) {
    working.note_mean(row);
    working.gaussians().mean.set(row, to(working.cloud().mean.get(row)));
    working.gaussians().rotation.set(row, turn * working.cloud().rotation.get(row));
  }
}

/// Standard deviation of a row along a direction.
double extent_along(const WorkingScene& working, std::size_t row, DVec3 direction) {
  const DQuat rotation = glm::normalize(DQuat(working.cloud().rotation.get(row)));
  const DVec3 scale = glm::exp(DVec3(working.cloud().log_scale.get(row)));
  return glm::length(scale * (glm::conjugate(rotation) * glm::normalize(direction)));
}

TEST(DrawOut, ASheetTwiceAsWideKeepsItsGaussiansOverlapping) {
  WorkingScene working = sheet();
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  EXPECT_EQ(draw_out(working), discs);
  for (const std::uint32_t row : working.rows_of(Role::copy)) {
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
  const std::size_t middle = working.rows_of(Role::copy)[side * (side / 2) + side / 2];
  EXPECT_GT(extent_along(working, middle, {0, 0, 1}), 1.7 * double(disc.x));
  EXPECT_NEAR(extent_along(working, middle, {0, 1, 0}), double(disc.y), 1e-3);
  EXPECT_NEAR(extent_along(working, middle, {1, 0, 0}), double(disc.z), 1e-5);
}

TEST(DrawOut, TurningAndShiftingLeaveTheBytesAlone) {
  WorkingScene working = sheet();
  const Quat turn = glm::angleAxis(0.7f, glm::normalize(Vec3(1, 2, 3)));
  move(
      working, [&](Vec3 p) { return turn * p + Vec3(5, -2, 0.3f); }, turn);
  const scene::GaussianCloud before = working.cloud();
  EXPECT_EQ(draw_out(working), 0u);
  EXPECT_EQ(working.cloud().rotation, before.rotation);
  EXPECT_EQ(working.cloud().log_scale, before.log_scale);
}

TEST(DrawOut, UndoingTheStretchUndoesIt) {
  WorkingScene working = sheet();
  move(working, [](Vec3 p) { return Vec3(1.3f * p.x, p.y, p.z); });
  draw_out(working);
  for (const std::uint32_t row : working.rows_of(Role::copy))
    ASSERT_GT(extent_along(working, row, {1, 0, 0}), 1.15 * double(disc.x)) << row;
  move(working, [](Vec3 p) { return Vec3(p.x / 1.3f, p.y, p.z); });
  draw_out(working);
  for (const std::uint32_t row : working.rows_of(Role::copy))
    EXPECT_NEAR(extent_along(working, row, {1, 0, 0}), double(disc.x), 0.05 * double(disc.x)) << row;
}

TEST(DrawOut, NothingIsSmearedOverATear) {
  WorkingScene working = sheet();
  const float middle = 0.5f * spacing * side;
  move(working, [&](Vec3 p) { return p.x < middle ? p : p + Vec3(2, 0, 0); });
  EXPECT_EQ(draw_out(working), 0u);
}

TEST(DrawOut, OnlyCopiesChange) {
  WorkingScene working = sheet(disc, [](std::size_t row) { return row < side ? Role::held : Role::copy; });
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  const scene::GaussianCloud before = working.cloud();
  EXPECT_EQ(draw_out(working), discs - side);
  for (std::size_t row = 0; row < working.size(); ++row) {
    const bool same = working.cloud().log_scale.get(row) == before.log_scale.get(row);
    EXPECT_EQ(same, working.role()[row] != Role::copy) << row;
  }
}

TEST(DrawOut, TooFewCopiesSayNothing) {
  WorkingScene working = sheet(disc, [](std::size_t row) { return row < 10 ? Role::copy : Role::frozen; });
  move(working, [](Vec3 p) { return Vec3(2 * p.x, p.y, p.z); });
  EXPECT_EQ(draw_out(working), 0u);
}

TEST(DrawOut, StaysFiniteAtTheExtremes) {
  for (const Vec3& extent : {Vec3(1e-30f), Vec3(1e30f), Vec3(1e18f, 1, 1e-18f), Vec3(0.05f, 0.05f, 1e-37f)})
    for (const float stretch : {0.0f, 1e-12f, 0.5f, 2.0f, 1e12f}) {
      WorkingScene working = sheet(extent);
      working.gaussians().rotation.set(working.rows_of(Role::copy)[3], Quat(0, 0, 0, 0));
      move(working, [&](Vec3 p) { return Vec3(stretch * p.x, p.y, p.z); });
      draw_out(working);
      for (const std::uint32_t row : working.rows_of(Role::copy)) {
        const Vec3 log_scale = working.cloud().log_scale.get(row);
        const Quat rotation = working.cloud().rotation.get(row);
        ASSERT_TRUE(std::isfinite(log_scale.x + log_scale.y + log_scale.z)) << row;
        ASSERT_TRUE(std::isfinite(glm::dot(rotation, rotation))) << row;
      }
    }
}

TEST(DrawOut, CopiesInOnePlaceStayAsTheyAre) {
  WorkingScene working = sheet();
  move(working, [](Vec3) { return Vec3(1, 1, 1); });
  move(working, [](Vec3) { return Vec3(2, 1, 1); });
  const scene::GaussianCloud before = working.cloud();
  EXPECT_EQ(draw_out(working), 0u);
  EXPECT_EQ(working.cloud().log_scale, before.log_scale);
}

}  // namespace
}  // namespace engine::repair
