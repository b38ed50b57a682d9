#include "engine/edit/edit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stop_token>

#include "engine/core/parallel.h"
#include "engine/edit/handles.h"
#include "engine/edit/views.h"
#include "tests/engine/edit/drags.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

Request drag_right(int intervals = 2) {
  Request request;
  request.handles = {{DVec3(0), DVec3(0.7, 0, 0), 0.3, 0}};
  request.params.intervals = intervals;
  request.params.max_image_side = 64;
  return request;
}

Outcome run_well(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras, const Request& request,
                 const Observer& observer = {}) {
  auto outcome = run(scene, cameras, request, {}, observer);
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  return std::move(*outcome);
}

TEST(Edit, MovesTheBallAndMasksWhereItWasAndWhereItIs) {
  const scene::GaussianCloud scene = ball_before_wall(150);
  const auto cameras = arc_of_cameras(5, 96);
  const Outcome outcome = run_well(scene, cameras, drag_right());
  ASSERT_EQ(outcome.views.size(), 5u);
  ASSERT_EQ(outcome.masks.size(), 5u);
  EXPECT_EQ(outcome.views[0].width, 64);
  for (std::size_t v = 0; v < outcome.views.size(); ++v) {
    const scene::Camera& view = outcome.views[v];
    const scene::Mask& mask = outcome.masks[v];
    const auto pixel = [&](DVec3 point) { return view.pixel_from_cam(view.cam_from_world(point)); };
    for (const DVec3 inside : {DVec3(0), DVec3(0.35, 0, 0), DVec3(0.7, 0, 0)})
      EXPECT_EQ(mask.at(int(pixel(inside).x), int(pixel(inside).y)), 1) << v;
    for (const DVec3 outside : {DVec3(-0.6, 0, 0), DVec3(0.3, 0.7, 0)})
      EXPECT_EQ(mask.at(int(pixel(outside).x), int(pixel(outside).y)), 0) << v;
    EXPECT_DOUBLE_EQ(outcome.report.views[v].mask_area, double(mask.area()) / (64 * 64));
    EXPECT_EQ(outcome.report.views[v].name, view.name);
  }
  EXPECT_EQ(outcome.report.handles.at(0).gaussians, 150u);
  ASSERT_EQ(outcome.report.handles[0].relocated.size(), 2u);
  EXPECT_LT(glm::distance(outcome.report.handles[0].relocated[1], DVec3(0.7, 0, 0)), 1e-6);
  EXPECT_EQ(outcome.report.copies, 150u);
  EXPECT_EQ(outcome.report.removed, 150u);
  EXPECT_EQ(outcome.report.changeable, 150u);
  EXPECT_EQ(outcome.report.input_gaussians, scene.size());
  EXPECT_EQ(outcome.report.output_gaussians, scene::flatten(scene, outcome.overlay).size());
  EXPECT_TRUE(scene::validate(outcome.overlay, scene));
  EXPECT_FALSE(outcome.stopped_early);
  EXPECT_TRUE(outcome.report.warnings.empty());
}

TEST(Edit, PixelsOfHeldGaussiansStayOutsideTheMask) {
  const scene::GaussianCloud scene = ball_before_wall(150);
  Request request = drag_right();
  request.params.intervals = 1;
  const Outcome alone = run_well(scene, arc_of_cameras(1, 64), request);
  request.handles.push_back({DVec3(0, 1.7, 2), std::nullopt, 0.9, 1});  // an anchor on the wall, in a group of its own
  const Outcome with_anchor = run_well(scene, arc_of_cameras(1, 64), request);
  EXPECT_EQ(with_anchor.masks, alone.masks);
  EXPECT_GT(with_anchor.report.changeable, alone.report.changeable);
  EXPECT_EQ(with_anchor.overlay, alone.overlay);
}

TEST(Edit, AZeroDragGivesBackTheInput) {
  scene::GaussianCloud scene = ball_before_wall(50);
  scene.opacity_logit[0] = -8.0f;  // below 1/255: invisible, but not ours to remove
  scene.rotation.set(4, {0, -0.0f, 2, 0});
  for (const Mode mode : {Mode::move, Mode::extend}) {
    Request request = drag_right(0);
    request.mode = mode;
    request.handles[0].target = request.handles[0].source;
    request.handles.push_back({DVec3(0.1, 0.1, 0), std::nullopt, 0.2, 0});
    request.handles.push_back({DVec3(-0.1, 0.1, 0.05), DVec3(-0.1, 0.1, 0.05), 0.2, 0});
    const Outcome outcome = run_well(scene, arc_of_cameras(2, 32), request);
    EXPECT_EQ(outcome.overlay, scene::no_change(scene));
    EXPECT_EQ(outcome.report.resolved.intervals, 1);
    EXPECT_EQ(outcome.report.warnings,
              (std::vector<std::string>{"nothing moves: every target is where its handle is"}));
  }
}

TEST(Edit, CountsDraggedGaussiansThatAreTooFaintToKeep) {
  scene::GaussianCloud scene = ball_before_wall(150);
  std::size_t dimmed = 0;
  for (std::size_t i = 0; i < scene.size() && dimmed < 7; ++i)
    if (glm::length(DVec3(scene.mean.get(i))) < 0.3) scene.opacity_logit[i] = -9, ++dimmed;
  const Outcome outcome = run_well(scene, arc_of_cameras(3, 64), drag_right());
  EXPECT_EQ(outcome.report.copies, 150u - 7u);
  ASSERT_EQ(outcome.report.warnings.size(), 1u);
  EXPECT_NE(outcome.report.warnings[0].find("7 dragged Gaussians"), std::string::npos) << outcome.report.warnings[0];
}

TEST(Edit, RefusesToLeaveAnEmptyScene) {
  const scene::GaussianCloud all = ball_before_wall(150);
  std::vector<std::uint8_t> dragged(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) dragged[i] = glm::length(DVec3(all.mean.get(i))) < 0.3;
  scene::GaussianCloud scene = scene::select(all, dragged);
  std::fill(scene.opacity_logit.begin(), scene.opacity_logit.end(), -9.0f);
  const auto outcome = run(scene, arc_of_cameras(3, 64), drag_right());
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(outcome.error().where, "handles");
}

TEST(Edit, WithoutADatasetItMakesItsOwnViews) {
  const scene::GaussianCloud scene = ball_before_wall(100);
  Request request = drag_right(1);
  request.params.views = 6;
  const Outcome outcome = run_well(scene, {}, request);
  EXPECT_GE(outcome.views.size(), 3u);
  EXPECT_LE(outcome.views.size(), 6u);
  EXPECT_GT(outcome.masks[0].area(), 0u);
}

TEST(Edit, LeavesOutExcludedViewsAndSaysWhenThereIsNoSuchView) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  Request request = drag_right(1);
  request.params.exclude_views = {"view_1", "view_9"};
  const Outcome outcome = run_well(scene, arc_of_cameras(3, 32), request);
  ASSERT_EQ(outcome.views.size(), 2u);
  for (const scene::Camera& view : outcome.views) EXPECT_NE(view.name, "view_1");
  EXPECT_EQ(outcome.report.warnings, (std::vector<std::string>{"there is no view \"view_9\" to exclude"}));
}

TEST(ChooseViews, LeavesTheSceneAsItWasAndChoosesTheSameAgain) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  for (const Mode mode : {Mode::move, Mode::extend}) {
    Request request = drag_right(3);
    request.mode = mode;
    request.params.views = 3;
    const WorkingScene working = begun(scene, request);
    const working::Members before = working::members_of(working);
    std::vector<double> told;
    const auto choose = [&] {
      return choose_views(working, scene, arc_of_cameras(5, 64), request, {}, 3, [&](double part) {
        told.push_back(part);
        return Result<void>{};
      });
    };
    const auto first = choose(), again = choose();
    ASSERT_TRUE(first && again);
    EXPECT_FALSE(first->moved.empty());
    ASSERT_EQ(first->views.size(), 3u);
    for (std::size_t v = 0; v < 3; ++v) EXPECT_EQ(first->views[v].name, again->views[v].name);
    EXPECT_EQ(working::members_of(working), before);
    EXPECT_EQ(working.cloud(), scene);
    ASSERT_EQ(told.size(), 20u) << "two pictures per camera, twice";
    EXPECT_TRUE(std::is_sorted(told.begin(), told.begin() + 10));
    EXPECT_EQ(told[9], 1.0);
  }
}

TEST(Edit, SaysWhenNoViewSeesIt) {
  const scene::GaussianCloud scene = ball_before_wall(60);
  auto cameras = arc_of_cameras(1, 32);
  cameras[0] = scene::look_at(DVec3(0, 0, -3), DVec3(0, 0, -9), DVec3(0, -1, 0), 0.9, 32, 32);
  const Outcome outcome = run_well(scene, cameras, drag_right(1));
  EXPECT_TRUE(outcome.views.empty());
  EXPECT_EQ(outcome.report.copies, 60u);
  EXPECT_EQ(outcome.report.warnings, (std::vector<std::string>{"no view sees the edited part"}));
}

TEST(Edit, ChoosesTheNumberOfIntervalsFromTheDrag) {
  const scene::GaussianCloud scene = ball_before_wall(30);
  const Outcome outcome = run_well(scene, arc_of_cameras(1, 32), drag_right(0));
  EXPECT_EQ(outcome.report.resolved.intervals, 3);  // 0.7 / 0.3, rounded up
}

TEST(Edit, InAnExtendAnIntervalReachesAsFarAsThePartIsWide) {
  Request request = drag_right(0);
  request.mode = Mode::extend;
  EXPECT_EQ(resolved_intervals(request), 2);  // 0.7 / 0.6, rounded up
  request.params.intervals = 5;
  EXPECT_EQ(resolved_intervals(request), 5);
}

TEST(Edit, AGroupWithoutAnchorsMayMoveAsOnePiece) {
  Request request;
  request.params.interpolation = Interpolation::rigid;
  EXPECT_FALSE(one_interval_is_exact(request));
  request.handles = {{DVec3(0), DVec3(0.3, 0, 0), 0.1, 1}, {DVec3(1), DVec3(1.3, 1, 1), 0.1, 1}};
  EXPECT_TRUE(one_interval_is_exact(request)) << "0.3 and 1.3 - 1 differ in their last digits";
  request.handles.push_back({DVec3(2), DVec3(2, 9, 2), 0.1, 2});
  EXPECT_TRUE(one_interval_is_exact(request)) << "each group by itself";
  request.handles.push_back({DVec3(3), std::nullopt, 0.1, 2});
  EXPECT_FALSE(one_interval_is_exact(request)) << "an anchor holds what the other carries off";
  request.handles = {{DVec3(3), std::nullopt, 0.1, 0}};
  EXPECT_TRUE(one_interval_is_exact(request));
  request.params.interpolation = Interpolation::paper;
  EXPECT_FALSE(one_interval_is_exact(request));
  request.params.interpolation = Interpolation::rigid, request.params.rotation = Rotation::none;
  EXPECT_FALSE(one_interval_is_exact(request));
}

TEST(Edit, WhatIsTurnedAsOnePieceKeepsItsShape) {
  const scene::GaussianCloud scene = ball_before_wall(100);
  const DQuat turn = glm::angleAxis(1.1, glm::normalize(DVec3(1, 2, -1)));
  Request request;
  for (const DVec3& at : {DVec3(0.1, 0, 0), DVec3(0, 0.1, 0), DVec3(0, 0, 0.1), DVec3(-0.1, -0.1, 0.05)})
    request.handles.push_back({at, turn * at + DVec3(0.5, 0, 0), 0.3, 0});
  request.params.intervals = 1, request.params.interpolation = Interpolation::rigid;
  ASSERT_TRUE(one_interval_is_exact(request));
  const Outcome outcome = run_well(scene, arc_of_cameras(1, 32), request);
  ASSERT_EQ(outcome.overlay.removed.size(), 100u);
  ASSERT_EQ(outcome.overlay.added(), 100u);
  for (std::size_t k = 0; k < 100; ++k) {
    const DVec3 was(scene.mean.get(outcome.overlay.removed[k]));
    const DVec3 is(outcome.overlay.rows.mean.get(outcome.overlay.changed.size() + k));
    EXPECT_LT(glm::distance(is, turn * was + DVec3(0.5, 0, 0)), 1e-5) << k;
  }
}

TEST(Edit, ReportsProgressThatNeverFallsAndEveryInterval) {
  const scene::GaussianCloud scene = ball_before_wall(30);
  std::vector<Progress> seen;
  std::vector<std::size_t> sizes;
  Observer observer;
  observer.progress = [&](const Progress& progress) { seen.push_back(progress); };
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_EQ(done.interval, int(sizes.size()) + 1);
    EXPECT_EQ(done.intervals, 3);
    sizes.push_back(working::members_of(done.state.scene).cloud.size());
    EXPECT_EQ(done.positions.size(), 1u);
    EXPECT_LT(glm::distance(done.positions[0], DVec3(0.7 * done.interval / 3, 0, 0)), 1e-6);
    EXPECT_GT(done.seconds, 0);
    return Result<void>{};
  };
  Request request = drag_right(3);
  request.mode = Mode::extend;
  const Outcome outcome = run_well(scene, arc_of_cameras(2, 32), request, observer);
  EXPECT_EQ(sizes, (std::vector<std::size_t>{60, 90, 120})) << "the originals, and a copy of each per interval";
  EXPECT_EQ(outcome.overlay.added(), 90u);
  EXPECT_TRUE(outcome.overlay.removed.empty());
  ASSERT_FALSE(seen.empty());
  for (std::size_t i = 1; i < seen.size(); ++i) {
    EXPECT_GE(seen[i].fraction, seen[i - 1].fraction);
    EXPECT_GE(seen[i].interval, seen[i - 1].interval);
  }
  EXPECT_EQ(seen.front().stage, Stage::assign);
  EXPECT_EQ(seen.back().fraction, 1.0);
  for (const Stage stage :
       {Stage::assign, Stage::views, Stage::deform, Stage::mask, Stage::relocate, Stage::checkpoint, Stage::finish})
    EXPECT_EQ(std::count_if(outcome.report.times.begin(), outcome.report.times.end(),
                            [&](const StageTime& time) { return time.stage == stage && time.seconds >= 0; }),
              1)
        << name_of(stage);
}

TEST(Edit, StopsWhenAsked) {
  const scene::GaussianCloud scene = ball_before_wall(30);
  for (const Stage stage : {Stage::assign, Stage::views, Stage::deform, Stage::mask, Stage::relocate, Stage::finish}) {
    std::stop_source source;
    Observer observer;
    observer.stop = source.get_token();
    observer.progress = [&](const Progress& progress) {
      if (progress.stage == stage) source.request_stop();
    };
    const auto outcome = run(scene, arc_of_cameras(1, 32), drag_right(2), {}, observer);
    if (stage == Stage::finish) {
      EXPECT_TRUE(outcome);  // nothing is left to stop
    } else {
      ASSERT_FALSE(outcome) << name_of(stage);
      EXPECT_EQ(outcome.error().code, ErrorCode::cancelled);
    }
  }
}

TEST(Edit, NamesWhatIsWrongWithItsInput) {
  const scene::GaussianCloud scene = ball_before_wall(30);
  auto cameras = arc_of_cameras(2, 32);
  cameras[1].fx = -1;
  EXPECT_EQ(run(scene, cameras, drag_right()).error().where, "cameras[1].fx");
  Request request = drag_right();
  request.handles[0].source = DVec3(0, 0, -1);
  request.handles[0].radius = 0.02;
  const auto empty = run(scene, {}, request);
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(empty.error().where, "handles[0].radius");
  request.handles[0].radius = 0;
  EXPECT_EQ(run(scene, {}, request).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(run(scene::GaussianCloud{}, {}, drag_right()).error().code, ErrorCode::unprocessable);
}

TEST(Edit, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud scene = ball_before_wall(300);
  const auto cameras = arc_of_cameras(3, 48);
  const Outcome alone = run_well(scene, cameras, drag_right());
  for (const int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const Outcome outcome = run_well(scene, cameras, drag_right());
      EXPECT_EQ(outcome.overlay, alone.overlay) << threads;
      EXPECT_EQ(outcome.masks, alone.masks) << threads;
    });
  }
}

TEST(Edit, AFarSceneHasTheMasksOfOneAtTheOrigin) {
  const DVec3 away(65536, -65536, 65536);  // floats there are 1/128 apart
  scene::GaussianCloud near = ball_before_wall(150), far = near;
  for (std::size_t i = 0; i < near.size(); ++i) {
    near.mean.set(i, glm::round(near.mean.get(i) * 128.0f) / 128.0f);
    far.mean.set(i, Vec3(DVec3(near.mean.get(i)) + away));
  }
  Request request = drag_right();
  const Outcome at_origin = run_well(near, arc_of_cameras(2, 64), request);
  for (Handle& handle : request.handles) handle.source += away, *handle.target += away;
  const Outcome far_away = run_well(far, arc_of_cameras(2, 64, away), request);
  ASSERT_EQ(far_away.masks.size(), at_origin.masks.size());
  for (std::size_t v = 0; v < far_away.masks.size(); ++v) {
    std::size_t differing = 0;
    for (std::size_t i = 0; i < far_away.masks[v].data.size(); ++i)
      differing += far_away.masks[v].data[i] != at_origin.masks[v].data[i];
    EXPECT_LE(differing, 4u) << v;  // pixels whose share is one half to within rounding
  }
}

}  // namespace
}  // namespace engine::edit
