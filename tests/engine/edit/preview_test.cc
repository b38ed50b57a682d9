#include "engine/edit/preview.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/samples.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::edit {
namespace {

scene::LayeredCloud plain(const scene::GaussianCloud& cloud) {
  return {std::make_shared<scene::GaussianCloud>(cloud), nullptr};
}

/// Two handles of one group, one of another, an anchor.
Request four_handles(Mode mode, DVec3 center = DVec3(0)) {
  Request request;
  request.mode = mode;
  request.handles = {{center + DVec3(-0.1, 0, 0), center + DVec3(0.5, 0.1, 0), 0.15, 0},
                     {center + DVec3(0.1, 0, 0), center + DVec3(0.6, 0.4, 0.1), 0.15, 0},
                     {center + DVec3(0, 0.1, 0), center + DVec3(0, 0.9, 0), 0.15, 1},
                     {center + DVec3(0, 1.7, 2), std::nullopt, 0.9, 0}};
  request.params.max_image_side = 32;
  return request;
}

void expect_as_run(const scene::LayeredCloud& scene, const Request& request) {
  const scene::GaussianCloud flat = scene::flatten(scene);
  const auto edited = run(flat, arc_of_cameras(1, 32, request.handles[0].source), request);
  const auto seen = preview(scene, request);
  ASSERT_TRUE(edited) << edited.error().message;
  ASSERT_TRUE(seen) << seen.error().message;
  EXPECT_EQ(seen->overlay, edited->overlay);
  EXPECT_TRUE(scene::validate(seen->overlay, flat));
  EXPECT_EQ(seen->intervals, edited->report.resolved.intervals);
  EXPECT_EQ(seen->changeable, edited->report.changeable);
  EXPECT_EQ(seen->warnings, edited->report.warnings);
  ASSERT_EQ(seen->counts.size(), request.handles.size());
  for (std::size_t h = 0; h < request.handles.size(); ++h) {
    EXPECT_EQ(seen->counts[h], edited->report.handles[h].gaussians);
    EXPECT_EQ(seen->positions[h], edited->report.handles[h].relocated.back());
  }
}

/// The Gaussians that the handles' spheres hold, as a selection.
std::vector<std::uint32_t> in_spheres(const scene::GaussianCloud& cloud, const Request& request) {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < cloud.size(); ++i)
    for (const Handle& handle : request.handles)
      if (glm::distance(DVec3(cloud.mean.get(i)), handle.source) < handle.radius) {
        rows.push_back(i);
        break;
      }
  return rows;
}

/// A board of which all but a corner is selected.
Request board_without_corner(const select::BoardOnTable& scene, Crumbs crumbs) {
  Request request;
  request.handles = {{DVec3(0, 0, 0.03), DVec3(3, 0.5, 1), 0.3, 0}};
  request.selected = scene.red;
  request.crumbs = crumbs;
  request.params.interpolation = Interpolation::arap;
  request.params.max_image_side = 32;
  return request;
}

TEST(Preview, OfCrumbsIsWhatTheEditMakesOfThem) {
  const select::BoardOnTable scene;
  for (const Crumbs crumbs : {Crumbs::move, Crumbs::remove, Crumbs::keep})
    for (const Mode mode : {Mode::move, Mode::remove}) {
      SCOPED_TRACE(std::string(name_of(crumbs)) + " " + std::string(name_of(mode)));
      Request request = board_without_corner(scene, crumbs);
      request.mode = mode;
      if (mode == Mode::remove) request.handles[0].target.reset();
      const auto seen = preview(plain(scene.cloud), request);
      ASSERT_TRUE(seen) << seen.error().message;
      const auto edited = run(scene.cloud, arc_of_cameras(1, 32, request.handles[0].source), request);
      ASSERT_TRUE(edited) << edited.error().message;
      EXPECT_EQ(seen->overlay, edited->overlay);
      EXPECT_EQ(seen->crumbs, crumbs == Crumbs::keep ? 0 : scene.corner.size());
      EXPECT_EQ(seen->crumbs, edited->report.crumbs);
      EXPECT_EQ(seen->overlay.removed, crumbs == Crumbs::keep ? scene.red : scene.board);
      const auto& arrived = crumbs == Crumbs::move ? scene.board : scene.red;
      EXPECT_EQ(seen->overlay.added(), mode == Mode::remove ? 0 : arrived.size());
    }
}

TEST(Preview, CrumbsStayWhereNothingMovesOutsideOfTheRegionAndWhereThePartIsDrawnOut) {
  const select::BoardOnTable scene;
  Request request = board_without_corner(scene, Crumbs::remove);
  request.handles[0].target = request.handles[0].source;
  const auto still = preview(plain(scene.cloud), request);
  ASSERT_TRUE(still) << still.error().message;
  EXPECT_TRUE(still->overlay.removed.empty());

  request = board_without_corner(scene, Crumbs::move);
  request.mode = Mode::extend;
  const auto drawn_out = preview(plain(scene.cloud), request);
  ASSERT_TRUE(drawn_out) << drawn_out.error().message;
  EXPECT_EQ(drawn_out->crumbs, 0u);

  request.mode = Mode::move;
  request.region = Region{DVec3(1, 1, 0), DVec3(1.5, 1.5, 1)};
  const auto beside = preview(plain(scene.cloud), request);
  ASSERT_TRUE(beside) << beside.error().message;
  EXPECT_EQ(beside->crumbs, 0u);
  for (const std::uint32_t row : scene.corner) EXPECT_FALSE(std::ranges::binary_search(beside->overlay.removed, row));
}

TEST(Preview, OfAnElasticBodyIsTheEditsDeformation) {
  const auto scene = plain(ball_before_wall(400));
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const int intervals : {0, 3})
      for (const Attach attach : {Attach::automatic, Attach::held, Attach::free}) {
        SCOPED_TRACE(std::string(name_of(attach)) + " " + std::to_string(intervals));
        Request request = four_handles(mode);
        request.params.interpolation = Interpolation::arap;
        request.params.intervals = intervals;
        request.attach = attach;
        request.handles[2].rotation = DQuat(0.3, 0, 1, 0);
        request.handles[1].scale = 1.3;
        expect_as_run(scene, request);
        request.selected = in_spheres(*scene.base, request);
        expect_as_run(scene, request);
      }
}

TEST(Preview, WithAMemoryIsTheSame) {
  const auto scene = plain(ball_before_wall(400));
  Memory memory;
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const double way : {0.0, 0.1, 0.4, 0.1})
      for (const Attach attach : {Attach::automatic, Attach::held, Attach::free})
        for (const bool without_last : {false, true}) {
          Request request = four_handles(mode);
          request.params.interpolation = Interpolation::arap;
          request.attach = attach;
          request.handles[0].target = request.handles[0].source + DVec3(way, way, 0);
          request.selected = in_spheres(*scene.base, request);
          // As many rows, but others: nothing that is kept of one selection may be taken for another one's.
          request.selected->erase(without_last ? request.selected->end() - 1 : request.selected->begin());
          const auto fresh = preview(scene, request), again = preview(scene, request, memory);
          ASSERT_TRUE(fresh && again);
          EXPECT_EQ(again->overlay, fresh->overlay);
          EXPECT_EQ(again->positions, fresh->positions);
          EXPECT_EQ(again->warnings, fresh->warnings);
        }
}

// Plans are made with it: an edit has no memory, and finds all out once more.
TEST(Preview, TellsWhatItTookAsIfItHadNoMemory) {
  const auto scene = plain(ball_before_wall(400));
  Memory memory;
  Request request = four_handles(Mode::move);
  request.params.interpolation = Interpolation::arap;
  request.selected = in_spheres(*scene.base, request);
  const auto first = preview(scene, request, memory);
  ASSERT_TRUE(first);
  EXPECT_GT(first->assign_seconds, 0);
  EXPECT_GT(first->drag_seconds, 0);
  const double saved_before = memory.saved_seconds();  // by the preview itself, of several intervals
  const auto again = preview(scene, request, memory);
  ASSERT_TRUE(again);
  const double saved = memory.saved_seconds() - saved_before;
  EXPECT_GT(saved, 0) << "the body, at least, is known";
  EXPECT_GE(again->assign_seconds + again->drag_seconds, saved);
}

TEST(Preview, WithASelectionIsWhatTheEditWillBe) {
  const scene::GaussianCloud cloud = ball_before_wall(200, Vec3(0), 3);
  Request request = four_handles(Mode::move);
  request.selected = in_spheres(cloud, request);
  for (Handle& handle : request.handles) handle.radius *= 0.1;  // which says nothing of what moves any more
  request.params.intervals = 2;
  expect_as_run(plain(cloud), request);
}

TEST(Preview, ASelectionOfWhatASphereHoldsIsTheSphere) {
  const scene::GaussianCloud cloud = ball_before_wall(200, Vec3(0), 3);
  Request request = four_handles(Mode::move);
  request.handles.resize(1);
  const auto by_sphere = preview(plain(cloud), request);
  request.selected = in_spheres(cloud, request);
  const auto by_rows = preview(plain(cloud), request);
  ASSERT_TRUE(by_sphere && by_rows);
  EXPECT_EQ(by_sphere->overlay, by_rows->overlay);
  EXPECT_EQ(by_sphere->counts, by_rows->counts);
}

TEST(Preview, AnAnchorMayStandBesideTheSelectionAndAHandleThatDragsMayNot) {
  const scene::GaussianCloud cloud = ball_before_wall(200, Vec3(0), 3);
  Request request = four_handles(Mode::move);
  request.handles.resize(2);
  request.selected = in_spheres(cloud, request);
  request.handles.push_back({DVec3(0, 50, 0), std::nullopt, 0.1, 0});
  const auto anchored = preview(plain(cloud), request);
  ASSERT_TRUE(anchored) << anchored.error().message;
  EXPECT_EQ(anchored->counts[2], 0u);
  request.handles[2].target = DVec3(0, 51, 0);
  const auto refused = preview(plain(cloud), request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(refused.error().where, "handles[2].source");
}

TEST(Preview, ASelectedRowThatTheSceneDoesNotHaveIsRefused) {
  const scene::GaussianCloud cloud = ball_before_wall(200, Vec3(0), 3);
  Request request = four_handles(Mode::move);
  request.selected = {0, std::uint32_t(cloud.size())};
  const auto refused = preview(plain(cloud), request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(refused.error().where, "selection");
  EXPECT_FALSE(run(cloud, {}, request));
}

TEST(Preview, IsWhatTheEditWillBe) {
  const auto scene = plain(ball_before_wall(200, Vec3(0), 3));
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const int intervals : {0, 1, 5})
      for (const Interpolation interpolation : {Interpolation::paper, Interpolation::smooth, Interpolation::rigid}) {
        SCOPED_TRACE(::testing::Message() << int(mode) << " " << intervals << " " << int(interpolation));
        Request request = four_handles(mode);
        request.params.intervals = intervals;
        request.params.interpolation = interpolation;
        expect_as_run(scene, request);
      }
}

TEST(Preview, WithinARegion) {
  Request request = four_handles(Mode::move);
  request.region = Region{DVec3(0, 0.5, 1), DVec3(4, 4, 2.5)};
  expect_as_run(plain(ball_before_wall(200)), request);
}

TEST(Preview, FarFromTheOrigin) {
  const DVec3 away(65536, -65536, 65536);
  for (const Mode mode : {Mode::move, Mode::extend})
    expect_as_run(plain(ball_before_wall(200, Vec3(away))), four_handles(mode, away));
}

TEST(Preview, OfAVersionThatIsAnOverlayItself) {
  const auto base = std::make_shared<const scene::GaussianCloud>(ball_before_wall(200));
  for (const Mode first : {Mode::move, Mode::extend})
    for (const Mode second : {Mode::move, Mode::extend}) {
      const auto before = preview({base, nullptr}, four_handles(first));
      ASSERT_TRUE(before);
      const scene::LayeredCloud version{base, std::make_shared<scene::Overlay>(before->overlay)};
      Request request = four_handles(second);
      request.handles[0] = {DVec3(0.5, 0.2, 0), DVec3(0.2, -0.3, 0.1), 0.4, 0};  // where the ball has gone
      request.handles[1] = {DVec3(0, 0, 0), DVec3(0, 0, 0.4), 0.3, 1};           // where some of it may have stayed
      request.handles.erase(request.handles.begin() + (first == Mode::move ? 1 : 2), request.handles.begin() + 3);
      expect_as_run(version, request);
      const auto seen = preview(version, request);
      ASSERT_TRUE(seen);
      EXPECT_EQ(scene::flatten(*base, scene::compose(base->size(), *version.overlay, seen->overlay)),
                scene::flatten(scene::flatten(version), seen->overlay));
    }
}

TEST(Preview, SaysWhatTheEditWouldSay) {
  scene::GaussianCloud scene = ball_before_wall(60);
  Request still = four_handles(Mode::move);
  for (Handle& handle : still.handles) handle.target = handle.source;
  expect_as_run(plain(scene), still);
  EXPECT_EQ(preview(plain(scene), still)->overlay, scene::no_change(scene));
  for (std::size_t i = 0; i < scene.size(); i += 2) scene.opacity_logit[i] = -9;
  expect_as_run(plain(scene), four_handles(Mode::move));
  EXPECT_EQ(preview(plain(scene), four_handles(Mode::move))->warnings.size(), 1u);
}

TEST(Preview, RefusesWhatTheEditRefuses) {
  const auto scene = ball_before_wall(60);
  Request request = four_handles(Mode::move);
  request.handles[1].radius = -1;
  EXPECT_EQ(preview(plain(scene), request).error().where, "handles[1].radius");
  request = four_handles(Mode::move);
  request.handles[2].source = DVec3(0, 0, -1);
  const auto empty = preview(plain(scene), request);
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(empty.error().message, run(scene, {}, request).error().message);

  std::vector<std::uint8_t> dragged(scene.size());
  for (std::size_t i = 0; i < scene.size(); ++i) dragged[i] = glm::length(DVec3(scene.mean.get(i))) < 0.3;
  scene::GaussianCloud faint = scene::select(scene, dragged);
  std::fill(faint.opacity_logit.begin(), faint.opacity_logit.end(), -9.0f);
  request.handles = {{DVec3(0), DVec3(1, 0, 0), 0.5, 0}};
  const auto nothing_left = preview(plain(faint), request);
  ASSERT_FALSE(nothing_left);
  EXPECT_EQ(nothing_left.error().message, run(faint, {}, request).error().message);
}

TEST(Preview, GivesTheSameBytesForAnyNumberOfThreads) {
  const auto scene = plain(ball_before_wall(3000, Vec3(0), 3));
  const auto alone = preview(scene, four_handles(Mode::extend));
  ASSERT_TRUE(alone);
  for (const int threads : {1, 2, 4})
    WorkArena(threads).run([&] { EXPECT_EQ(preview(scene, four_handles(Mode::extend))->overlay, alone->overlay); });
}

/// The block, its foot as near to the floor as its rows are to each other, and dragged to the right and up by 0.03.
BlockScene lifted_by_slip() {
  BlockScene block;
  block.request.selected.emplace();
  for (auto row = std::uint32_t(block.floor_rows); row < block.cloud.size(); ++row)
    block.request.selected->push_back(row);
  block.request.region.reset();
  block.request.params.interpolation = Interpolation::arap;
  *block.request.handles[0].target += DVec3(0, -0.03, 0);
  return block;
}

/// How far the rows that arrive are from where they were, on average.
DVec3 way_of(const BlockScene& block, const PreviewOutcome& outcome) {
  const scene::GaussianCloud& added = outcome.overlay.rows;
  DVec3 before(0.0), after(0.0);
  const std::size_t rows = block.request.selected->size(), first = added.size() - rows;
  for (const std::uint32_t row : *block.request.selected) before += DVec3(block.cloud.mean.get(row)) / double(rows);
  for (std::size_t k = first; k < added.size(); ++k) after += DVec3(added.mean.get(k)) / double(rows);
  return after - before;
}

TEST(Preview, SetsDownWhatAHandleLiftsBySlip) {
  BlockScene block = lifted_by_slip();
  const auto outcome = preview(plain(block.cloud), block.request);
  ASSERT_TRUE(outcome);
  ASSERT_EQ(outcome->parts.size(), 1u);
  EXPECT_NEAR(outcome->parts[0].settled, 0.03, 1e-4);
  EXPECT_NEAR(glm::distance(way_of(block, *outcome), DVec3(0.9, 0, 0)), 0, 1e-4);
  EXPECT_NEAR(glm::distance(outcome->positions[0], block.middle + DVec3(0.9, 0, 0)), 0, 1e-4);

  block.request.settle = Settle::off;
  const auto as_asked = preview(plain(block.cloud), block.request);
  ASSERT_TRUE(as_asked);
  EXPECT_EQ(as_asked->parts[0].settled, 0);
  EXPECT_NEAR(glm::distance(way_of(block, *as_asked), DVec3(0.9, -0.03, 0)), 0, 1e-5);
}

TEST(Preview, SetsDownTheSameInSeveralIntervals) {
  BlockScene block = lifted_by_slip();
  block.request.params.intervals = 3;
  const auto outcome = preview(plain(block.cloud), block.request);
  ASSERT_TRUE(outcome);
  EXPECT_NEAR(glm::distance(way_of(block, *outcome), DVec3(0.9, 0, 0)), 0, 1e-4);
  block.request.params.iterations = 0;
  for (const int intervals : {1, 3}) {
    block.request.params.intervals = intervals;
    expect_as_run(plain(block.cloud), block.request);
  }
}

TEST(Preview, SetsDownTheSameWhatItRemembers) {
  BlockScene block = lifted_by_slip();
  Memory memory;
  const auto first = preview(plain(block.cloud), block.request, memory);
  *block.request.handles[0].target += DVec3(0.1, 0.01, 0);
  const auto second = preview(plain(block.cloud), block.request, memory),
             alone = preview(plain(block.cloud), block.request);
  ASSERT_TRUE(first && second && alone);
  EXPECT_EQ(second->overlay, alone->overlay);
  EXPECT_NE(second->overlay, first->overlay);
}

TEST(Preview, LeavesInTheAirWhatIsLifted) {
  BlockScene block = lifted_by_slip();
  block.request.handles[0].target = block.middle + DVec3(0.3, -0.4, 0);
  const auto outcome = preview(plain(block.cloud), block.request);
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->parts[0].settled, 0);
  EXPECT_NEAR(glm::distance(way_of(block, *outcome), DVec3(0.3, -0.4, 0)), 0, 1e-5);
}

}  // namespace
}  // namespace engine::edit
