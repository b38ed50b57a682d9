// Edits that end early, and edits that go on after a restart.
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/samples.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::edit {
namespace {

constexpr int intervals = 4;
const DVec3 far_away(65536, -65536, 65536);  // floats there are 1/128 apart

struct Case {
  Mode mode = Mode::move;
  DVec3 center{0.0};
  scene::GaussianCloud scene;
  std::vector<scene::Camera> cameras;
  Request request;

  Case(Mode m, DVec3 c) : mode(m), center(c), scene(ball_before_wall(120, Vec3(c))) {
    cameras = arc_of_cameras(3, 48, center);
    request.mode = mode;
    request.handles = {{center + DVec3(-0.1, 0, 0), center + DVec3(0.5, 0.1, 0), 0.25, 0},
                       {center + DVec3(0.1, 0, 0), center + DVec3(0.6, 0.4, 0.1), 0.25, 0},
                       {center + DVec3(0, 1.7, 2), std::nullopt, 0.9, 1}};  // an anchor on the wall
    request.params.intervals = intervals;
    request.params.max_image_side = 48;
    request.params.exclude_views = {"nowhere"};  // so that there is a warning to carry along
    scene.opacity_logit[0] = -9;                 // too faint to keep
  }
};

/// A board whose corner is not selected, and goes away in the first interval.
Case with_crumbs() {
  const select::BoardOnTable board;
  Case c(Mode::move, DVec3(0));
  c.scene = board.cloud;
  c.request.handles = {{DVec3(0, 0, 0.03), DVec3(1, 0.5, 0.4), 0.3, 0}};
  c.request.selected = board.red;
  c.request.crumbs = Crumbs::remove;
  c.request.params.interpolation = Interpolation::arap;
  return c;
}

std::vector<Case> cases() {
  return {{Mode::move, DVec3(0)}, {Mode::extend, DVec3(0)}, {Mode::move, far_away}, {Mode::extend, far_away}};
}

/// All but the times, which differ from run to run.
void expect_same(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(a.overlay, b.overlay);
  EXPECT_EQ(a.stopped_early, b.stopped_early);
  EXPECT_EQ(a.masks, b.masks);
  ASSERT_EQ(a.views.size(), b.views.size());
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    EXPECT_EQ(a.views[v].name, b.views[v].name);
    EXPECT_EQ(a.views[v].translation, b.views[v].translation);
    EXPECT_EQ(a.report.views[v].mask_area, b.report.views[v].mask_area);
  }
  EXPECT_EQ(a.report.warnings, b.report.warnings);
  EXPECT_EQ(a.report.resolved.intervals, b.report.resolved.intervals);
  EXPECT_EQ(a.report.input_gaussians, b.report.input_gaussians);
  EXPECT_EQ(a.report.output_gaussians, b.report.output_gaussians);
  EXPECT_EQ(a.report.changeable, b.report.changeable);
  EXPECT_EQ(a.report.copies, b.report.copies);
  EXPECT_EQ(a.report.removed, b.report.removed);
  EXPECT_EQ(a.report.crumbs, b.report.crumbs);
  ASSERT_EQ(a.report.handles.size(), b.report.handles.size());
  for (std::size_t h = 0; h < a.report.handles.size(); ++h) {
    EXPECT_EQ(a.report.handles[h].gaussians, b.report.handles[h].gaussians);
    EXPECT_EQ(a.report.handles[h].relocated, b.report.handles[h].relocated);
  }
}

/// A run from start to end, and what it told on the way.
struct Undisturbed {
  Outcome outcome;
  std::map<int, std::string> checkpoints;
  std::map<std::string, scene::Overlay> moments;  ///< "deformed 2"
};

Undisturbed run_undisturbed(const Case& c) {
  Undisturbed told;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_TRUE(done.state.scene.check()) << done.interval;
    told.checkpoints[done.interval] = encode(done.state);
    return Result<void>{};
  };
  observer.moment = [&](const Moment& moment) {
    told.moments[moment.name + " " + std::to_string(moment.interval)] = moment.overlay;
    EXPECT_EQ(moment.intervals, intervals);
    EXPECT_EQ(moment.views.size(), 3u);
    return Result<void>{};
  };
  auto outcome = run(c.scene, c.cameras, c.request, {}, observer);
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message;
    return told;
  }
  told.outcome = std::move(*outcome);
  return told;
}

Outcome resumed(const Case& c, const std::string& bytes, bool keep) {
  auto state = decode(bytes, c.scene, c.request);
  if (!state) {
    ADD_FAILURE() << state.error().message;
    return {};
  }
  Observer observer;
  if (keep) observer.keep = [] { return true; };
  auto outcome = run(c.scene, c.cameras, c.request, {}, observer, std::move(*state));
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message;
    return {};
  }
  return std::move(*outcome);
}

TEST(Resume, FromAnyIntervalGivesTheBytesOfTheUndisturbedRun) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(::testing::Message() << (c.mode == Mode::move ? "move" : "extend") << " at " << c.center.x);
    const Undisturbed whole = run_undisturbed(c);
    ASSERT_EQ(whole.checkpoints.size(), std::size_t(intervals)) << "the last one, too";
    EXPECT_EQ(whole.outcome.report.warnings.size(), c.mode == Mode::move ? 2u : 1u);
    for (const auto& [u, bytes] : whole.checkpoints)
      for (const int threads : {1, 2, 4}) {
        SCOPED_TRACE(::testing::Message() << "after interval " << u << ", " << threads << " threads");
        WorkArena arena(threads);
        arena.run([&] { expect_same(resumed(c, bytes, false), whole.outcome); });
      }
  }
}

TEST(Resume, CrumbsThatWentAwayStayAway) {
  const Case c = with_crumbs();
  const Undisturbed whole = run_undisturbed(c);
  EXPECT_EQ(whole.outcome.report.crumbs, 16u);
  for (const auto& [u, bytes] : whole.checkpoints) {
    SCOPED_TRACE(u);
    expect_same(resumed(c, bytes, false), whole.outcome);
  }
}

TEST(Resume, FromAResumedRunsCheckpointIsTheSameAgain) {
  const Case c(Mode::extend, DVec3(0));
  const Undisturbed whole = run_undisturbed(c);
  const auto first = decode(whole.checkpoints.at(1), c.scene, c.request);
  ASSERT_TRUE(first);
  std::optional<std::string> second;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) -> Result<void> {
    second = encode(done.state);
    return fail(ErrorCode::unavailable, "the machine goes down");
  };
  const auto cut = run(c.scene, c.cameras, c.request, {}, observer, *first);
  ASSERT_FALSE(cut);
  EXPECT_EQ(cut.error().message, "the machine goes down");
  ASSERT_TRUE(second);
  EXPECT_EQ(decode(*second, c.scene, c.request)->interval, 2);
  expect_same(resumed(c, *second, false), whole.outcome);
}

TEST(Keep, EndsWithWhatTheIntervalShowed) {
  for (const Case& c : cases()) {
    const Undisturbed whole = run_undisturbed(c);
    for (int u = 1; u < intervals; ++u) {
      SCOPED_TRACE(::testing::Message() << (c.mode == Mode::move ? "move" : "extend") << " " << u);
      int asked = 0;
      Observer observer;
      observer.keep = [&] { return ++asked == u; };
      const auto kept = run(c.scene, c.cameras, c.request, {}, observer);
      ASSERT_TRUE(kept) << kept.error().message;
      EXPECT_EQ(asked, u);
      EXPECT_TRUE(kept->stopped_early);
      EXPECT_EQ(kept->overlay, whole.moments.at("deformed " + std::to_string(u)));
      EXPECT_EQ(kept->overlay, whole.moments.at("before " + std::to_string(u + 1)));
      EXPECT_EQ(kept->report.resolved.intervals, intervals);
      ASSERT_EQ(kept->report.handles[0].relocated.size(), std::size_t(u));
      EXPECT_EQ(kept->report.handles[0].relocated.back(),
                whole.outcome.report.handles[0].relocated[std::size_t(u) - 1]);
      ASSERT_EQ(kept->masks.size(), 3u);
      for (std::size_t v = 0; v < 3; ++v) {
        EXPECT_GT(kept->masks[v].area(), 0u);
        EXPECT_LT(kept->masks[v].area(), whole.outcome.masks[v].area());
      }
      expect_same(resumed(c, whole.checkpoints.at(u), true), *kept);
    }
  }
}

TEST(Keep, IsNotAskedAfterTheLastIntervalNorBeforeTheFirst) {
  const Case c(Mode::move, DVec3(0));
  int asked = 0;
  Observer observer;
  observer.keep = [&] { return ++asked > 100; };
  const auto outcome = run(c.scene, c.cameras, c.request, {}, observer);
  ASSERT_TRUE(outcome);
  EXPECT_EQ(asked, intervals - 1);
  EXPECT_FALSE(outcome->stopped_early);
  const Undisturbed whole = run_undisturbed(c);
  EXPECT_FALSE(resumed(c, whole.checkpoints.at(intervals), true).stopped_early) << "all was done already";
}

TEST(Moments, ShowTheSceneBeforeAndAfterEachDeformation) {
  const Case c(Mode::extend, DVec3(0));
  const Undisturbed whole = run_undisturbed(c);
  ASSERT_EQ(whole.moments.size(), std::size_t(2 * intervals));
  EXPECT_EQ(whole.moments.at("before 1"), scene::no_change(c.scene));
  EXPECT_EQ(whole.moments.at("deformed " + std::to_string(intervals)), whole.outcome.overlay);
  for (const auto& [name, overlay] : whole.moments) EXPECT_TRUE(scene::validate(overlay, c.scene)) << name;
  // Being watched changes nothing.
  const auto unwatched = run(c.scene, c.cameras, c.request);
  ASSERT_TRUE(unwatched);
  expect_same(*unwatched, whole.outcome);
}

TEST(Moments, AnErrorOfTheWatcherEndsTheEdit) {
  const Case c(Mode::move, DVec3(0));
  Observer observer;
  observer.moment = [](const Moment& moment) -> Result<void> {
    if (moment.name == "deformed") return fail(ErrorCode::no_space, "no room for the picture");
    return {};
  };
  const auto outcome = run(c.scene, c.cameras, c.request, {}, observer);
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::no_space);
}

TEST(Resume, RefusesACheckpointOfAnotherEditOrScene) {
  const Case c(Mode::move, DVec3(0));
  const auto state = decode(run_undisturbed(c).checkpoints.at(2), c.scene, c.request);
  ASSERT_TRUE(state);
  const auto expect_refused = [&](const scene::GaussianCloud& scene, const Request& request, const State& from,
                                  const char* what) {
    const auto read = decode(encode(from), scene, request);
    ASSERT_FALSE(read) << what;
    EXPECT_EQ(read.error().code, ErrorCode::invalid_argument) << what;
    EXPECT_EQ(read.error().where, "checkpoint") << what;
    const auto went_on = run(scene, c.cameras, request, {}, {}, from);
    ASSERT_FALSE(went_on) << what;
    EXPECT_EQ(went_on.error().where, "checkpoint") << what;
  };
  Request other = c.request;
  other.handles.pop_back();
  expect_refused(c.scene, other, *state, "fewer handles");
  other = c.request;
  other.handles.push_back(other.handles.back());
  expect_refused(c.scene, other, *state, "more handles");
  other = c.request;
  other.params.intervals = intervals + 1;
  expect_refused(c.scene, other, *state, "more intervals");
  expect_refused(ball_before_wall(0), c.request, *state, "a smaller scene");
  expect_refused(ball_before_wall(120, Vec3(0), 1), c.request, *state, "another SH degree");
  const auto refuse = [&](const char* what, auto&& spoil) {
    State bad = *state;
    spoil(bad);
    expect_refused(c.scene, c.request, bad, what);
  };
  refuse("interval 0", [](State& s) { s.interval = 0; });
  refuse("an interval too many", [](State& s) { s.interval = intervals + 1; });
  refuse("intervals of another number", [](State& s) { s.report.resolved.intervals = intervals + 1; });
  refuse("a position too few", [](State& s) { s.positions.pop_back(); });
  refuse("a handle reported too few", [](State& s) { s.report.handles.pop_back(); });
  refuse("a mask too few", [](State& s) { s.masks.pop_back(); });
  refuse("a mask of another size", [](State& s) { s.masks[0] = scene::Mask(3, 3); });
  refuse("a camera that is none", [](State& s) { s.views[0].fx = 0; });
  refuse("a handle that is not there", [&](State& s) {
    s.scene = working::WorkingScene(c.scene, s.scene.frame(), working::HandleColumn(c.scene.size(), 9));
  });
  refuse("a scene with more rows", [](State& s) {
    s.scene = working::WorkingScene(ball_before_wall(500), s.scene.frame(), working::HandleColumn(500 + 144, 1));
  });
}

}  // namespace
}  // namespace engine::edit
