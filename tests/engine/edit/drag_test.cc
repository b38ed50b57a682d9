// Copy and paste, relocation and publishing, without pictures.
#include "engine/edit/drag.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "engine/core/parallel.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/paste.h"
#include "engine/edit/publish.h"
#include "engine/render/project.h"
#include "tests/engine/edit/drags.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

using working::Role;

Request drag(DVec3 by, int intervals, Mode mode = Mode::move, DVec3 center = DVec3(0)) {
  Request request;
  request.mode = mode;
  request.handles = {{center, center + by, 0.3, 0}};
  request.params.intervals = intervals;
  return request;
}

/// What was published, merged into one cloud.
struct Merged {
  scene::GaussianCloud cloud;
  std::vector<std::uint32_t> parent;  ///< Input row of each row.
  std::size_t survivors = 0, changeable = 0;
};

Merged merged(const WorkingScene& working, const scene::GaussianCloud& scene, Mode mode) {
  const Published published = publish(working, scene, mode);
  EXPECT_TRUE(scene::validate(published.overlay, scene));
  Merged out{scene::flatten(scene, published.overlay), survivors_of(scene.size(), published.overlay), 0,
             published.changeable};
  out.survivors = out.parent.size();
  for (std::size_t i = scene.size(); i < working.size(); ++i)
    if (mode == Mode::extend || render::opacity<double>(working.cloud().opacity_logit[i]) >= render::min_alpha)
      out.parent.push_back(working.parent()[i]);
  EXPECT_EQ(out.parent.size(), out.cloud.size());
  return out;
}

struct Dragged {
  WorkingScene working;
  Merged published;
  std::size_t assigned = 0;
  std::vector<std::uint32_t> copies;
};

Dragged carry_out(const scene::GaussianCloud& scene, const Request& request) {
  Dragged out;
  out.working = begun(scene, request);
  out.assigned = out.working.dragged_rows().size();
  out.copies = carry_out(out.working, request, resolved_intervals(request)).copies;
  out.published = merged(out.working, scene, request.mode);
  return out;
}

TEST(Move, OneHandleTranslatesItsGaussiansAndLeavesTheRestToTheByte) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  const Dragged result = carry_out(scene, drag(DVec3(0.5, -0.25, 0.125), 1));
  const Merged& out = result.published;
  EXPECT_EQ(result.assigned, 60u);
  ASSERT_EQ(out.cloud.size(), scene.size());
  ASSERT_EQ(out.survivors, scene.size() - 60);
  for (std::size_t i = 0; i < out.survivors; ++i) {
    EXPECT_TRUE(same_row(out.cloud, i, scene, out.parent[i])) << i;
    if (i > 0) {
      EXPECT_LT(out.parent[i - 1], out.parent[i]);
    }
  }
  for (std::size_t i = out.survivors; i < out.cloud.size(); ++i) {
    const std::size_t from = out.parent[i];
    const Vec3 expected(DVec3(scene.mean.get(from)) + DVec3(0.5, -0.25, 0.125));
    EXPECT_EQ(out.cloud.mean.get(i), expected) << i;
    scene::GaussianCloud moved_back = out.cloud;
    moved_back.mean.set(i, scene.mean.get(from));
    EXPECT_TRUE(same_row(moved_back, i, scene, from)) << i;  // opaque bytes, colour and quaternion included
  }
  EXPECT_EQ(out.changeable, 60u);
}

TEST(Move, SeveralIntervalsLeaveExactlyOneCopyOfEveryDraggedGaussian) {
  const scene::GaussianCloud scene = ball_before_wall(40);
  for (const int intervals : {1, 2, 5, 20}) {
    const Dragged result = carry_out(scene, drag(DVec3(1, 0.5, 0), intervals));
    const Merged& out = result.published;
    ASSERT_EQ(out.cloud.size() - out.survivors, 40u) << intervals;
    std::vector<std::uint32_t> parents(out.parent.begin() + std::ptrdiff_t(out.survivors), out.parent.end());
    std::sort(parents.begin(), parents.end());
    EXPECT_EQ(std::unique(parents.begin(), parents.end()), parents.end()) << intervals;
    for (std::size_t i = out.survivors; i < out.cloud.size(); ++i) {
      const Vec3 moved = out.cloud.mean.get(i) - scene.mean.get(out.parent[i]);
      EXPECT_LT(glm::distance(moved, Vec3(1, 0.5f, 0)), 2e-6f) << intervals << ": " << i;
    }
  }
}

TEST(Extend, LeavesTheOriginalAndTheTrailAtHalfOpacity) {
  const scene::GaussianCloud scene = ball_before_wall(30);
  const Dragged result = carry_out(scene, drag(DVec3(0.9, 0, 0), 3, Mode::extend));
  const Merged& out = result.published;
  ASSERT_EQ(out.survivors, scene.size());
  ASSERT_EQ(out.cloud.size(), scene.size() + 3 * 30);
  std::size_t lowered = 0;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const bool dragged = result.working.role()[i] == Role::original;
    const float before = scene.opacity_logit[i];
    EXPECT_EQ(out.cloud.opacity_logit[i], dragged ? std::min(before, 0.0f) : before) << i;
    lowered += dragged && before > 0;
    scene::GaussianCloud restored = out.cloud;
    restored.opacity_logit[i] = before;
    EXPECT_TRUE(same_row(restored, i, scene, i)) << i;
  }
  EXPECT_GT(lowered, 10u);
  std::size_t at_end = 0;
  for (std::size_t i = scene.size(); i < out.cloud.size(); ++i) {
    const float parents = scene.opacity_logit[out.parent[i]];
    const float moved = out.cloud.mean.x[i] - scene.mean.x[out.parent[i]];
    const bool last = std::abs(moved - 0.9f) < 1e-5f;
    at_end += last;
    EXPECT_EQ(out.cloud.opacity_logit[i], last ? parents : std::min(parents, 0.0f)) << i;
    EXPECT_TRUE(last || std::abs(moved - 0.3f) < 1e-5f || std::abs(moved - 0.6f) < 1e-5f) << moved;
  }
  EXPECT_EQ(at_end, 30u);
  EXPECT_EQ(out.changeable, 4 * 30u);
}

TEST(CopyAndPaste, AnOriginalFainterThanKeepKeepsItsBytes) {
  scene::GaussianCloud scene = ball_before_wall(2);
  const float keep = working::keep_logit(Mode::move);
  EXPECT_NEAR(render::opacity<double>(keep), 0.01, 3e-9);
  EXPECT_EQ(render::opacity<double>(working::keep_logit(Mode::extend)), 0.5);
  scene.opacity_logit[0] = -7.5f;
  scene.opacity_logit[2] = 2.0f;
  const Dragged result = carry_out(scene, drag(DVec3(1, 0, 0), 1));
  EXPECT_EQ(result.working.cloud().opacity_logit[0], -7.5f);
  EXPECT_EQ(result.working.cloud().opacity_logit[2], keep);
}

TEST(Publish, LeavesOutFaintCopiesOfAMoveButNoRowThatDidNotMove) {
  scene::GaussianCloud scene = ball_before_wall(3);
  scene.opacity_logit[0] = -6.0f;  // 0.0025, in the ball
  scene.opacity_logit[1] = -9.0f;  // in the wall
  const Dragged move = carry_out(scene, drag(DVec3(1, 0, 0), 1));
  EXPECT_EQ(move.published.cloud.size(), scene.size() - 1);
  EXPECT_TRUE(same_row(move.published.cloud, 0, scene, 1));
  const Dragged extend = carry_out(scene, drag(DVec3(1, 0, 0), 1, Mode::extend));
  EXPECT_EQ(extend.published.cloud.size(), scene.size() + 3);
}

TEST(Publish, AnOriginalWhoseOpacityHasRisenStays) {
  const scene::GaussianCloud scene = ball_before_wall(3);
  Dragged result = carry_out(scene, drag(DVec3(1, 0, 0), 1));
  result.working.gaussians().opacity_logit[2] = 0.25f;  // as an optimisation might
  const Merged out = merged(result.working, scene, Mode::move);
  ASSERT_EQ(out.cloud.size(), scene.size() + 1);
  const auto row = std::size_t(std::find(out.parent.begin(), out.parent.end(), 2u) - out.parent.begin());
  EXPECT_LT(row, out.survivors);
  EXPECT_EQ(out.cloud.opacity_logit[row], 0.25f);
}

TEST(CopyAndPaste, WhatDoesNotMoveIsNotCopiedAndMayMoveLater) {
  scene::GaussianCloud scene = ball_before_wall(0);
  scene.resize(scene.size() + 2);
  const std::size_t still = scene.size() - 2, pulled = scene.size() - 1;
  for (const std::size_t i : {still, pulled}) scene.rotation.set(i, {1, 0, 0, 0}), scene.opacity_logit[i] = 1;
  scene.mean.set(still, {0, 0, 0});
  scene.mean.set(pulled, {1, 0, 0});
  Request request;
  request.handles = {{DVec3(0), std::nullopt, 0.2, 0}, {DVec3(1, 0, 0), DVec3(1, 1, 0), 0.2, 0}};
  WorkingScene working = begun(scene, request);
  const std::vector<DVec3> positions = handle_sources(working.frame(), request);
  Memory memory;
  const PlannedMotion motion = plan_motion(working, request, {}, positions, 1, 2, memory);
  EXPECT_EQ(motion.rows, (std::vector<std::uint32_t>{std::uint32_t(still), std::uint32_t(pulled)}));
  EXPECT_EQ(motion.moving, (std::vector<std::uint32_t>{std::uint32_t(pulled)}));
  const auto copies = copy_and_paste(working, motion, request.mode, true);
  EXPECT_TRUE(working.check());
  EXPECT_EQ(copies, (std::vector<std::uint32_t>{std::uint32_t(scene.size())}));
  EXPECT_EQ(working.role()[still], Role::held);
  EXPECT_EQ(working.handle()[still], 1);
  EXPECT_EQ(working.handle()[pulled], 0);
  EXPECT_EQ(working.handle().back(), 2);
  const Merged out = merged(working, scene, request.mode);
  EXPECT_EQ(out.survivors, scene.size() - 1);
  EXPECT_EQ(out.changeable, 2u);
}

TEST(DragAlone, IsTheDragOfTheWholeSceneWithoutItsOtherRows) {
  for (const DVec3 center : {DVec3(0), DVec3(65536, 0, -65536)})
    for (const Mode mode : {Mode::move, Mode::extend}) {
      const scene::GaussianCloud scene = ball_before_wall(40, Vec3(center));
      Request request = drag(DVec3(1, 0, 0), 3, mode, center);
      request.handles.push_back({center + DVec3(0, 1.7, 2), std::nullopt, 0.9, 1});  // holds a part of the wall
      const WorkingScene begun = edit::begun(scene, request);
      WorkingScene whole = begun;
      const CarriedOut carried = carry_out(whole, request, 3);

      const std::vector<std::uint32_t> rows = rows_in_use(begun.handle(), {});
      EXPECT_EQ(rows, begun.dragged_rows());
      scene::GaussianCloud gaussians;
      gaussians.sh_degree = scene.sh_degree, gaussians.extra_stride = scene.extra_stride;
      scene::append_rows(gaussians, scene, rows);
      Memory memory;
      const auto alone = [&] { return drag_alone(rows, gaussians, begun.handle(), request, {}, 3, true, memory); };
      const DraggedAlone first = alone(), again = alone();
      EXPECT_TRUE(first.working.check());
      EXPECT_EQ(first.positions, carried.positions);
      EXPECT_TRUE(first.warnings.empty());
      ASSERT_EQ(first.working.size() - rows.size(), whole.size() - scene.size());
      for (std::size_t k = 0; k < first.working.size(); ++k) {
        const std::size_t row = k < rows.size() ? rows[k] : scene.size() + (k - rows.size());
        EXPECT_TRUE(same_row(first.working.cloud(), k, whole.cloud(), row)) << k;
        EXPECT_EQ(first.working.role()[k], whole.role()[row]) << k;
        EXPECT_EQ(first.working.handle()[k], whole.handle()[row]) << k;
        EXPECT_EQ(first.working.mean_at_deform().get(k), whole.mean_at_deform().get(row)) << k;
        EXPECT_EQ(rows[first.working.parent()[k]], whole.parent()[row]) << k;
      }
      EXPECT_EQ(again.working.cloud(), first.working.cloud()) << "nothing is left of the first one";
      EXPECT_EQ(working::members_of(again.working), working::members_of(first.working));
    }
}

TEST(DragAlone, TellsWhichHandlesHaveLostTheirGaussians) {
  const scene::GaussianCloud scene = ball_before_wall(2);
  const Request request = drag(DVec3(1, 0, 0), 2);
  Memory memory;
  const DraggedAlone alone = drag_alone({}, scene::select(scene, std::vector<std::uint8_t>(scene.size(), 0)),
                                        working::HandleColumn(scene.size(), 0), request, {}, 2, true, memory);
  EXPECT_EQ(alone.warnings, (std::vector<std::string>{handle_lost(0, 1), handle_lost(0, 2)}));
  EXPECT_EQ(alone.positions, (std::vector<DVec3>{DVec3(0)}));
}

TEST(Relocate, FollowsTheOpacityWeightedMotionOfItsGaussians) {
  scene::GaussianCloud scene = ball_before_wall(2);
  const Request request = drag(DVec3(1, 0, 0), 1);
  WorkingScene working = begun(scene, request);
  scene::GaussianCloud& gaussians = working.gaussians();
  gaussians.opacity_logit[0] = 0.0f;                            // 1/2
  gaussians.opacity_logit[2] = float(-std::log(3.0));           // 1/4
  gaussians.mean.set(0, scene.mean.get(0) + Vec3(0.3f, 0, 0));  // as deformation and optimisation might
  gaussians.mean.set(2, scene.mean.get(2) + Vec3(0, 0.6f, 0));
  std::vector<DVec3> positions{DVec3(5)};
  EXPECT_TRUE(relocate(working, request, positions).empty());
  EXPECT_LT(glm::distance(positions[0], DVec3(5.2, 5.2, 5)), 1e-6);
}

TEST(Relocate, WithoutSurvivorsTheHandleStaysAndIsReported) {
  const scene::GaussianCloud scene = ball_before_wall(2);
  const Request request = drag(DVec3(1, 0, 0), 1);
  const WorkingScene working(scene, working::Frame(), working::HandleColumn(scene.size(), 0));
  std::vector<DVec3> positions{DVec3(5)};
  EXPECT_EQ(relocate(working, request, positions), (std::vector<std::size_t>{0}));
  EXPECT_EQ(positions[0], DVec3(5));
}

TEST(Relocate, WithOneHandleItIsWhereItsTargetWas) {
  const scene::GaussianCloud scene = ball_before_wall(25);
  const Request request = drag(DVec3(0.7, -0.4, 0.2), 2);
  WorkingScene working = begun(scene, request);
  std::vector<DVec3> positions = handle_sources(working.frame(), request);
  Memory memory;
  for (int u = 1; u <= 2; ++u) {
    copy_and_paste(working, plan_motion(working, request, {}, positions, u, 2, memory), request.mode, true);
    relocate(working, request, positions);
    EXPECT_LT(glm::distance(positions[0], (u / 2.0) * DVec3(0.7, -0.4, 0.2)), 1e-7) << u;
  }
}

TEST(LocalFrame, AFarSceneIsDraggedLikeOneAtTheOrigin) {
  // At 1e6 a float step is 1/16, so this scene's positions are whole sixteenths. The same handles, radii and drags.
  const DVec3 away(1e6, -1e6, 1e6);
  scene::GaussianCloud near = ball_before_wall(200), far = near;
  for (std::size_t i = 0; i < near.size(); ++i) {
    near.mean.set(i, glm::round(near.mean.get(i) * 16.0f * 4.0f) / 16.0f);  // a ball of radius 0.8
    far.mean.set(i, Vec3(DVec3(near.mean.get(i)) + away));
    ASSERT_EQ(DVec3(far.mean.get(i)) - away, DVec3(near.mean.get(i)));
  }
  for (const Interpolation interpolation : {Interpolation::paper, Interpolation::smooth, Interpolation::rigid}) {
    Request request;
    request.params.intervals = 4;
    request.params.interpolation = interpolation;
    request.handles = {{DVec3(-0.4, 0, 0), DVec3(-0.3, 0.9, 0.2), 0.7, 0},
                       {DVec3(0.4, 0, 0), DVec3(0.5, 0.3, 0.4), 0.7, 0},
                       {DVec3(0, 0.3, 0.1), DVec3(0.1, 0.9, 0), 0.7, 0}};
    const Dragged at_origin = carry_out(near, request);
    for (Handle& handle : request.handles) handle.source += away, *handle.target += away;
    const Dragged far_away = carry_out(far, request);
    const DVec3 origin = far_away.working.frame().origin();
    EXPECT_NE(origin, DVec3(0));
    EXPECT_TRUE(at_origin.working.frame().is_world());
    ASSERT_EQ(at_origin.published.parent, far_away.published.parent);
    for (std::size_t i = 0; i < at_origin.published.cloud.size(); ++i) {
      const DVec3 here = DVec3(at_origin.published.cloud.mean.get(i)) + away;
      const DVec3 there(far_away.published.cloud.mean.get(i));
      for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(here[axis], there[axis], 0.5 / 16 + 1e-5) << i;
    }
    for (std::size_t k = 0; k < at_origin.copies.size(); ++k) {  // before they are stored in the world's floats
      const DVec3 here(at_origin.working.cloud().mean.get(at_origin.copies[k]));
      const DVec3 there = DVec3(far_away.working.cloud().mean.get(far_away.copies[k])) + origin - away;
      EXPECT_LT(glm::distance(here, there), 5e-6) << k;
    }
  }
}

TEST(Drag, DegenerateHandlesKeepEveryNumberFinite) {
  const scene::GaussianCloud scene = ball_before_wall(80);
  const DVec3 on_gaussian(scene.mean.get(0));
  std::vector<std::vector<Handle>> cases{
      {{DVec3(-0.1, 0, 0), DVec3(0.1, 0, 0), 0.3, 0}, {DVec3(0.1, 0, 0), DVec3(-0.1, 0, 0), 0.3, 0}},  // reversal
      {{DVec3(-0.1, 0, 0), DVec3(0.4, 0, 0), 0.3, 0}, {DVec3(0.1, 0, 0), DVec3(0.4, 0, 0), 0.3, 0}},   // to one point
      {{on_gaussian, on_gaussian + DVec3(0.5, 0, 0), 0.3, 0}, {DVec3(0.1), DVec3(0.1), 0.3, 0}},       // zero length
      {{DVec3(0), DVec3(1, 0, 0), 0.3, 0}, {DVec3(1e-13, 1e-13, 0), DVec3(0, 1, 0), 0.3, 0}}};         // coincident
  for (std::size_t c = 0; c < cases.size(); ++c)
    for (const Rotation rotation : {Rotation::shortest_arc, Rotation::paper, Rotation::none})
      for (const Interpolation interpolation : {Interpolation::paper, Interpolation::smooth, Interpolation::rigid}) {
        Request request;
        request.handles = cases[c];
        request.params.intervals = 4;
        request.params.rotation = rotation;
        request.params.interpolation = interpolation;
        const Dragged result = carry_out(scene, request);
        EXPECT_FALSE(scene::first_not_finite(result.published.cloud)) << c;
      }
}

TEST(Drag, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud scene = ball_before_wall(3000, Vec3(0), 3);
  Request request = drag(DVec3(0.5, 0.2, 0.1), 3, Mode::extend);
  request.handles.push_back({DVec3(0.1, 0, 0), DVec3(0.3, 0.6, 0), 0.3, 0});
  const Dragged alone = carry_out(scene, request);
  for (const int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] { EXPECT_EQ(carry_out(scene, request).published.cloud, alone.published.cloud) << threads; });
  }
}

}  // namespace
}  // namespace engine::edit
