#include "engine/working/working_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "engine/working/mode.h"
#include "tests/engine/edit/samples.h"

namespace engine::working {
namespace {

using edit::ball_before_wall, edit::same_row;
using Rows = std::vector<std::uint32_t>;

const DVec3 far_away(65536, -65536, 65536);  // floats there are 1/128 apart

/// Sixteen rows, of which those of the ball are held by two handles: 0, 4 and 8 by the first, 2 and 6 by the second.
constexpr std::size_t ball = 5;
HandleColumn two_handles(std::size_t rows) {
  HandleColumn handle(rows, 0);
  for (const std::size_t row : {0, 4, 8}) handle[row] = 1;
  for (const std::size_t row : {2, 6}) handle[row] = 2;
  return handle;
}

struct Begun {
  scene::GaussianCloud input;
  WorkingScene working;

  explicit Begun(DVec3 origin = DVec3(0))
      : input(ball_before_wall(ball, Vec3(origin))), working(input, Frame(origin), two_handles(input.size())) {}
  /// One row that is like row `from` of the scene.
  std::uint32_t append(Role role, std::uint32_t from) {
    return working.append(working.cloud(), std::span(&from, 1), std::span(&role, 1), std::span(&from, 1));
  }
};

/// A scene in which there is a row of every role.
Begun with_all_roles(DVec3 origin = DVec3(0)) {
  Begun begun(origin);
  for (const std::uint32_t row : {0u, 2u}) {
    begun.working.note_mean(row);
    const std::uint32_t copy = begun.append(Role::copy, row);
    begun.working.leave_behind(row);
    begun.working.gaussians().mean.set(copy, begun.working.cloud().mean.get(row) + Vec3(1, 0, 0));
    begun.working.gaussians().opacity_logit[row] = -4;
  }
  const auto first = std::uint32_t(begun.input.size());
  begun.append(Role::copy, first);
  begun.working.leave_behind(first);
  begun.append(Role::seed, 5);
  return begun;
}

void expect_same(const WorkingScene& a, const WorkingScene& b) {
  EXPECT_EQ(a.cloud(), b.cloud());
  EXPECT_EQ(a.frame(), b.frame());
  EXPECT_EQ(a.input_rows(), b.input_rows());
  EXPECT_EQ(a.role(), b.role());
  EXPECT_EQ(a.handle(), b.handle());
  EXPECT_EQ(a.parent(), b.parent());
}

TEST(WorkingScene, OfNothingHolds) {
  EXPECT_TRUE(WorkingScene().check());
  EXPECT_EQ(WorkingScene().size(), 0u);
  EXPECT_TRUE(WorkingScene().member_rows().empty());
}

TEST(WorkingScene, BeginsAsTheInputWithTheRowsOfHandlesHeld) {
  const auto [input, working] = Begun();
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.size(), input.size());
  EXPECT_EQ(working.input_rows(), input.size());
  EXPECT_EQ(working.cloud(), input);
  EXPECT_EQ(working.mean_at_deform(), input.mean);
  EXPECT_EQ(working.handle(), two_handles(input.size()));
  for (std::uint32_t row = 0; row < working.size(); ++row) {
    EXPECT_EQ(working.role()[row], working.handle()[row] != 0 ? Role::held : Role::frozen) << row;
    EXPECT_EQ(working.parent()[row], row);
  }
  EXPECT_EQ(working.dragged_rows(), (Rows{0, 2, 4, 6, 8}));
  EXPECT_EQ(working.member_rows(), working.dragged_rows());
  EXPECT_EQ(working.rows_of(Role::held), working.dragged_rows());
  EXPECT_TRUE(working.rows_of(Role::copy).empty());
}

TEST(WorkingScene, ACopyTakesTheHandleAndTheParentOfItsAncestor) {
  Begun begun;
  WorkingScene& working = begun.working;
  working.gaussians().mean.set(2, {7, 8, 9});
  working.note_mean(2);
  const std::uint32_t copy = begun.append(Role::copy, 2);
  EXPECT_EQ(copy, begun.input.size());
  EXPECT_TRUE(working.check());
  EXPECT_TRUE(same_row(working.cloud(), copy, working.cloud(), 2));
  EXPECT_EQ(working.role()[copy], Role::copy);
  EXPECT_EQ(working.handle()[copy], 2);
  EXPECT_EQ(working.parent()[copy], 2u);
  EXPECT_EQ(working.mean_at_deform().get(copy), Vec3(7, 8, 9));
  const std::uint32_t of_copy = begun.append(Role::copy, copy);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.handle()[of_copy], 2);
  EXPECT_EQ(working.parent()[of_copy], 2u) << "the input's row, not the copy";
  EXPECT_EQ(working.dragged_rows(), (Rows{0, 2, 4, 6, 8, copy, of_copy}));
}

TEST(WorkingScene, TrailsAndSeedsHaveAParentButNoHandle) {
  Begun begun;
  const WorkingScene& working = begun.working;
  const std::uint32_t trail = begun.append(Role::trail, 4), seed = begun.append(Role::seed, 3);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.parent()[trail], 4u);
  EXPECT_EQ(working.parent()[seed], 3u) << "a frozen row may be one";
  EXPECT_EQ(working.handle()[trail], 0);
  EXPECT_EQ(working.handle()[seed], 0);
  EXPECT_EQ(working.dragged_rows(), (Rows{0, 2, 4, 6, 8}));
  EXPECT_EQ(working.member_rows(), (Rows{0, 2, 4, 6, 8, trail, seed}));
  EXPECT_EQ(working.rows_of(Role::seed), Rows{seed});
  const std::uint32_t continued = begun.append(Role::continued, 3);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.parent()[continued], 3u);
  EXPECT_EQ(working.handle()[continued], 0);
}

TEST(WorkingScene, AppendsSeveralRowsOfAnotherCloudInTheirOrder) {
  Begun begun;
  WorkingScene& working = begun.working;
  scene::GaussianCloud other = begun.input;
  for (float& logit : other.opacity_logit) logit = -2.5f;
  const Rows rows{9, 1, 9}, ancestors{8, 5, 6};
  const std::vector<Role> roles{Role::copy, Role::seed, Role::trail};
  const std::size_t first = working.append(other, rows, roles, ancestors);
  EXPECT_TRUE(working.check());
  ASSERT_EQ(working.size(), begun.input.size() + 3);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_TRUE(same_row(working.cloud(), first + k, other, rows[k])) << k;
    EXPECT_EQ(working.role()[first + k], roles[k]);
    EXPECT_EQ(working.parent()[first + k], ancestors[k]);
    EXPECT_EQ(working.handle()[first + k], roles[k] == Role::copy ? 1 : 0);
  }
  for (std::size_t row = 0; row < begun.input.size(); ++row)
    EXPECT_TRUE(same_row(working.cloud(), row, begun.input, row)) << row;
  const std::size_t size = working.size();
  EXPECT_EQ(working.append(other, {}, {}, {}), size) << "nothing";
  EXPECT_TRUE(working.check());
}

TEST(WorkingScene, WhatIsLeftBehindIsAnOriginalOrATrail) {
  Begun begun;
  WorkingScene& working = begun.working;
  const std::uint32_t copy = begun.append(Role::copy, 6);
  const scene::GaussianCloud before = working.cloud();
  working.leave_behind(6);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.role()[6], Role::original);
  EXPECT_EQ(working.handle()[6], 0);
  working.leave_behind(copy);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.role()[copy], Role::trail);
  EXPECT_EQ(working.handle()[copy], 0);
  EXPECT_EQ(working.dragged_rows(), (Rows{0, 2, 4, 8}));
  EXPECT_EQ(working.member_rows(), (Rows{0, 2, 4, 6, 8, copy})) << "it stays a member of M";
  EXPECT_EQ(working.cloud(), before) << "it stays where it is, as it is";
}

TEST(WorkingScene, AFrozenRowThatIsGivenUpLeavesAsInAMove) {
  Begun begun;
  WorkingScene& working = begun.working;
  working.gaussians().opacity_logit[3] = -9;  // fainter already
  for (const std::uint32_t row : {1u, 3u}) {
    working.give_up(row);
    EXPECT_EQ(working.role()[row], Role::original);
    EXPECT_EQ(working.cloud().mean.get(row), begun.input.mean.get(row));
  }
  EXPECT_EQ(working.cloud().opacity_logit[1], keep_logit(Mode::move));
  EXPECT_EQ(working.cloud().opacity_logit[3], -9);
  EXPECT_EQ(working.rows_that_left(), (Rows{1, 3}));
  EXPECT_TRUE(working.check());
  const auto restored = restore(members_of(working), begun.input, Frame(DVec3(0)));
  ASSERT_TRUE(restored);
  expect_same(*restored, working);
}

TEST(WorkingScene, NotesTheMeanOfOneRow) {
  Begun begun;
  WorkingScene& working = begun.working;
  for (const std::uint32_t row : {0u, 2u}) working.gaussians().mean.set(row, {1, 2, 3});
  working.note_mean(0);
  EXPECT_EQ(working.mean_at_deform().get(0), Vec3(1, 2, 3));
  EXPECT_EQ(working.mean_at_deform().get(2), begun.input.mean.get(2));
}

TEST(WorkingScene, KnowsRowsOfTheInputAsTheyWere) {
  for (const DVec3 origin : {DVec3(0), far_away}) {
    const auto [input, working] = with_all_roles(origin);
    const scene::GaussianCloud begun = working.frame().edit_from_world(input);
    const Rows members = working.member_rows();
    const scene::GaussianCloud unedited = working.unedited(input, members);
    ASSERT_EQ(unedited.size(), ball) << "appended rows were not there";
    for (std::size_t k = 0; k < ball; ++k) EXPECT_TRUE(same_row(unedited, k, begun, members[k])) << k;
    EXPECT_FALSE(same_row(unedited, 0, working.cloud(), 0)) << "its opacity was lowered since";
  }
}

TEST(WorkingScene, AValueCopiedStaysAsItWas) {
  Begun begun = with_all_roles();
  const WorkingScene copy = begun.working;
  begun.append(Role::seed, 1);
  begun.working.gaussians().mean.set(0, Vec3(9));
  expect_same(copy, with_all_roles().working);
}

TEST(Members, PutBackGiveTheWorkingSceneAgain) {
  for (const DVec3 origin : {DVec3(0), far_away}) {
    const auto [input, working] = with_all_roles(origin);
    ASSERT_TRUE(working.check());
    const Members members = members_of(working);
    EXPECT_EQ(members.inputs, (Rows{0, 2, 4, 6, 8}));
    EXPECT_EQ(members.cloud.size(), ball + 4);
    const auto again = restore(members, input, working.frame());
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_TRUE(again->check());
    expect_same(*again, working);
    EXPECT_EQ(again->mean_at_deform(), working.mean_at_deform());
    EXPECT_EQ(members_of(*again), members);
  }
}

TEST(Members, OfASceneWithoutMembersAreNone) {
  const scene::GaussianCloud input = ball_before_wall(3);
  const WorkingScene working(input, Frame(), HandleColumn(input.size(), 0));
  const Members members = members_of(working);
  EXPECT_TRUE(members.inputs.empty());
  EXPECT_EQ(members.cloud.size(), 0u);
  const auto again = restore(members, input, Frame());
  ASSERT_TRUE(again);
  expect_same(*again, working);
}

TEST(Members, ThatBreakAnInvariantMakeNoScene) {
  const auto [input, working] = with_all_roles();
  const Members good = members_of(working);
  // Entries: 0 and 1 originals, 2 to 4 held; then trail, copy, copy, seed.
  ASSERT_EQ(good.role, (std::vector<Role>{Role::original, Role::original, Role::held, Role::held, Role::held,
                                          Role::trail, Role::copy, Role::copy, Role::seed}));
  ASSERT_TRUE(restore(good, input, Frame()));
  const auto rows = std::uint32_t(input.size());
  const std::vector<std::pair<const char*, std::function<void(Members&)>>> cases{
      {"rows out of order", [](Members& m) { std::swap(m.inputs[0], m.inputs[1]); }},
      {"a row twice", [](Members& m) { m.inputs[1] = m.inputs[0], m.parent[1] = m.parent[0]; }},
      {"a row beyond the input", [&](Members& m) { m.inputs[4] = m.parent[4] = rows; }},
      {"another row than its parent", [](Members& m) { m.inputs[4] = 10; }},
      {"more rows of the input than there are rows", [](Members& m) { m.inputs.resize(20, 143); }},
      {"one row of the input too many", [](Members& m) { m.inputs.push_back(m.parent[5]); }},
      {"a row of the input too few", [](Members& m) { m.inputs.pop_back(); }},
      {"an input row that is frozen", [](Members& m) { m.role[2] = Role::frozen, m.handle[2] = 0; }},
      {"an input row that is a copy", [](Members& m) { m.role[2] = Role::copy; }},
      {"an input row that is a trail", [](Members& m) { m.role[0] = Role::trail; }},
      {"an input row that is a seed", [](Members& m) { m.role[0] = Role::seed; }},
      {"an input row with another parent", [](Members& m) { m.parent[2] = 2; }},
      {"a new row that is frozen", [](Members& m) { m.role[8] = Role::frozen; }},
      {"a new row that is held", [](Members& m) { m.role[6] = Role::held; }},
      {"a new row that is an original", [](Members& m) { m.role[8] = Role::original; }},
      {"a new row without a parent", [&](Members& m) { m.parent[8] = rows; }},
      {"a new row whose parent is beyond", [](Members& m) { m.parent[6] = 1u << 30; }},
      {"a held row without a handle", [](Members& m) { m.handle[3] = 0; }},
      {"a copy without a handle", [](Members& m) { m.handle[7] = 0; }},
      {"an original with a handle", [](Members& m) { m.handle[0] = 1; }},
      {"a trail with a handle", [](Members& m) { m.handle[5] = 1; }},
      {"a seed with a handle", [](Members& m) { m.handle[8] = 2; }},
      {"roles too few", [](Members& m) { m.role.pop_back(); }},
      {"handles too few", [](Members& m) { m.handle.pop_back(); }},
      {"handles too many", [](Members& m) { m.handle.push_back(0); }},
      {"parents too few", [](Members& m) { m.parent.pop_back(); }},
      {"means at deform too few: x", [](Members& m) { m.mean_at_deform.x.pop_back(); }},
      {"means at deform too few: y", [](Members& m) { m.mean_at_deform.y.pop_back(); }},
      {"means at deform too few: z", [](Members& m) { m.mean_at_deform.z.pop_back(); }},
      {"Gaussians too few", [](Members& m) { m.cloud.resize(m.cloud.size() - 1); }},
      {"Gaussians too many", [](Members& m) { m.cloud.resize(m.cloud.size() + 1); }},
      {"a scale that is no number", [](Members& m) { m.cloud.log_scale.y[1] = std::nanf(""); }},
      {"a mean at deform that is infinite", [](Members& m) { m.mean_at_deform.z[0] = -INFINITY; }},
  };
  for (const auto& [what, spoil] : cases) {
    Members bad = good;
    spoil(bad);
    const auto restored = restore(bad, input, Frame());
    ASSERT_FALSE(restored) << what;
    EXPECT_EQ(restored.error().code, ErrorCode::invalid_argument) << what;
    EXPECT_TRUE(restored.error().where.empty()) << what;
    EXPECT_FALSE(restored.error().message.empty()) << what;
  }
}

TEST(Members, OfAnotherSceneAreRefused) {
  const auto [input, working] = with_all_roles();
  const Members members = members_of(working);
  EXPECT_FALSE(restore(members, scene::GaussianCloud{}, Frame()));
  EXPECT_FALSE(restore(members, ball_before_wall(ball, Vec3(0), 1), Frame())) << "another SH degree";
  scene::GaussianCloud fewer_bytes = input;
  fewer_bytes.extra_stride = 0, fewer_bytes.extra.clear();
  EXPECT_FALSE(restore(members, fewer_bytes, Frame()));
  scene::GaussianCloud smaller = input;
  smaller.resize(8);
  EXPECT_FALSE(restore(members, smaller, Frame())) << "row 8 is a member";
}

TEST(Roles, AreTheInputsOrTheEditsAndDraggedOrNot) {
  for (const Role role : {Role::frozen, Role::held, Role::original}) EXPECT_TRUE(is_of_input(role));
  for (const Role role : {Role::copy, Role::trail, Role::seed, Role::continued}) EXPECT_FALSE(is_of_input(role));
  for (const Role role : {Role::held, Role::copy}) EXPECT_TRUE(is_dragged(role));
  for (const Role role : {Role::frozen, Role::original, Role::trail, Role::seed, Role::continued})
    EXPECT_FALSE(is_dragged(role));
  for (const Role role : {Role::copy, Role::continued}) EXPECT_TRUE(has_arrived(role));
  for (const Role role : {Role::held, Role::original, Role::trail, Role::seed}) EXPECT_FALSE(has_arrived(role));
  for (const Role role : {Role::seed, Role::continued}) EXPECT_TRUE(is_new(role));
  for (const Role role : {Role::held, Role::original, Role::trail, Role::copy}) EXPECT_FALSE(is_new(role));
}

TEST(KeepLogit, IsOneHundredthInAMoveAndOneHalfInAnExtend) {
  EXPECT_NEAR(1 / (1 + std::exp(-double(keep_logit(Mode::move)))), 0.01, 3e-9);
  EXPECT_EQ(keep_logit(Mode::extend), 0.0f);
}

TEST(CopyRow, PutsOneRowInPlaceOfAnotherAndTouchesNoOther) {
  const scene::GaussianCloud from = ball_before_wall(4);
  scene::GaussianCloud to = ball_before_wall(9);
  const scene::GaussianCloud before = to;
  copy_row(from, 3, to, 11);
  for (std::size_t row = 0; row < to.size(); ++row)
    EXPECT_TRUE(row == 11 ? same_row(to, row, from, 3) : same_row(to, row, before, row)) << row;
}

TEST(Frame, OfTheWorldChangesNotABit) {
  scene::GaussianCloud cloud = ball_before_wall(20);
  cloud.mean.set(0, {-0.0f, 0.0f, -0.0f});
  for (const Frame& world : {Frame(), Frame(DVec3(0)), Frame(DVec3(-0.0))}) {
    EXPECT_TRUE(world.is_world());
    for (std::size_t row = 0; row < cloud.size(); ++row) {
      EXPECT_TRUE(same_row(world.edit_from_world(cloud), row, cloud, row)) << row;
      EXPECT_TRUE(same_row(world.world_from_edit(cloud), row, cloud, row)) << row;
    }
    EXPECT_TRUE(std::signbit(world.edit_from_world(cloud).mean.x[0]));
    EXPECT_TRUE(std::signbit(world.world_from_edit(cloud).mean.z[0]));
  }
  WorkingScene working(cloud, Frame(), HandleColumn(cloud.size(), 1));
  EXPECT_TRUE(same_row(working.cloud(), 0, cloud, 0));
  EXPECT_TRUE(std::signbit(working.mean_at_deform().x[0]));
}

TEST(Frame, MeansNearItGoThereAndBackExactly) {
  const Frame frame(far_away);
  EXPECT_FALSE(frame.is_world());
  const scene::GaussianCloud world = ball_before_wall(50, Vec3(far_away));
  const scene::GaussianCloud local = frame.edit_from_world(world);
  for (std::size_t row = 0; row < world.size(); ++row)
    EXPECT_EQ(DVec3(local.mean.get(row)), DVec3(world.mean.get(row)) - far_away) << row << ": nothing is rounded";
  EXPECT_EQ(frame.world_from_edit(local), world);
  scene::GaussianCloud means_back = local;
  means_back.mean = world.mean;
  EXPECT_EQ(means_back, world) << "only means change";
}

TEST(Frame, PointsAndCamerasGoWithIt) {
  const Frame frame(far_away);
  const DVec3 point = far_away + DVec3(0.25, -0.5, 3);
  EXPECT_EQ(frame.edit_from_world(point), DVec3(0.25, -0.5, 3));
  EXPECT_EQ(frame.world_from_edit(DVec3(0.25, -0.5, 3)), point);
  for (const scene::Camera& camera : edit::arc_of_cameras(3, 32, far_away)) {
    const scene::Camera local = frame.edit_from_world(camera);
    EXPECT_LT(glm::distance(local.cam_from_world(frame.edit_from_world(point)), camera.cam_from_world(point)), 1e-9);
    EXPECT_LT(glm::length(local.centre()), 3.001);
    EXPECT_EQ(local.rotation, camera.rotation);
    EXPECT_EQ(local.name, camera.name);
    EXPECT_EQ(local.fx, camera.fx);
  }
}

TEST(Frame, EqualsOneWithTheSameOrigin) {
  EXPECT_EQ(Frame(), Frame(DVec3(0)));
  EXPECT_EQ(Frame(far_away), Frame(far_away));
  EXPECT_NE(Frame(far_away), Frame());
}

}  // namespace
}  // namespace engine::working
