// The plan of an edit, and what a running edit makes of it.
#include "engine/edit/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "engine/edit/handles.h"
#include "tests/engine/edit/samples.h"
#include "tests/engine/edit/student.h"

namespace engine::edit {
namespace {

/// A stage of an interval, by name so that a difference can be read.
using Entry = std::pair<std::string_view, int>;

/// Leaves pictures as they are.
class Identity final : public correct::Corrector {
 public:
  Result<void> fine_tune(std::span<const correct::Example>, int) override { return {}; }
  Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask> views, double,
                                            std::uint64_t) override {
    std::vector<scene::Image> pictures;
    for (const correct::CorrectionTask& flawed : views) pictures.push_back(flawed.picture);
    return pictures;
  }
};

struct Case {
  const char* name;
  Mode mode = Mode::move;
  int intervals = 1, corrections = 1, iterations = 0;
  bool corrected = false, repainted = false, shown = false, kept = false;

  [[nodiscard]] Workload workload() const {
    Workload work;
    work.gaussians = 40, work.dragged = 10, work.candidates = 2, work.views = 2, work.view_pixels = 32 * 32;
    work.intervals = intervals, work.corrections = corrections, work.iterations = iterations;
    work.corrected = corrected, work.repainted = repainted, work.vacates = mode == Mode::move;
    work.shown = shown, work.kept = kept;
    return work;
  }
};

const std::vector<Case> cases{
    {.name = "deformation alone"},
    {.name = "several intervals", .intervals = 3},
    {.name = "an extend", .mode = Mode::extend, .intervals = 3},
    {.name = "watched", .intervals = 2, .shown = true},
    {.name = "kept", .intervals = 2, .kept = true},
    {.name = "optimised", .intervals = 2, .iterations = 4},
    {.name = "optimised twice", .intervals = 2, .corrections = 2, .iterations = 4, .shown = true, .kept = true},
    {.name = "corrected", .intervals = 2, .iterations = 3, .corrected = true},
    {.name = "all of it",
     .intervals = 2,
     .corrections = 3,
     .iterations = 3,
     .corrected = true,
     .shown = true,
     .kept = true},
    {.name = "all of it in an extend",
     .mode = Mode::extend,
     .intervals = 2,
     .corrections = 2,
     .iterations = 3,
     .corrected = true,
     .shown = true,
     .kept = true},
    {.name = "repainted",
     .intervals = 2,
     .corrections = 2,
     .iterations = 3,
     .corrected = true,
     .repainted = true,
     .shown = true,
     .kept = true},
    {.name = "a corrector that has nothing to do", .intervals = 2, .corrected = true, .shown = true},
};

/// Runs the edit of a case, and notes what it tells.
struct Told {
  std::vector<Progress> progress;
  std::map<int, std::string> checkpoints;
  Request request;
  bool finished = false, stopped_early = false;

  Told(const Case& c, std::optional<std::string> from = std::nullopt, int keep_after = 0, bool moves = true) {
    const scene::GaussianCloud scene = ball_before_wall(40);
    const auto cameras = arc_of_cameras(2, 32);
    request.mode = c.mode;
    request.handles = {{DVec3(0), DVec3(moves ? 0.5 : 0, 0, 0), 0.25, 0}};
    request.params.intervals = c.intervals;
    request.params.max_image_side = 32;
    request.params.annealing_steps = c.corrections;
    request.params.iterations = c.iterations;
    Identity corrector;
    Student student;
    Observer observer;
    observer.progress = [&](const Progress& at) { progress.push_back(at); };
    if (c.shown) observer.moment = [](const Moment&) { return Result<void>{}; };
    if (c.kept)
      observer.interval_done = [&](const IntervalDone& done) {
        checkpoints[done.interval] = encode(done.state);
        return Result<void>{};
      };
    int asked = 0;
    observer.keep = [&] { return ++asked == keep_after; };
    std::optional<State> state;
    if (from) state = decode(*from, scene, request).value();
    const Tools tools{.corrector = c.corrected ? &corrector : nullptr, .repainter = c.repainted ? &student : nullptr};
    const auto outcome = run(scene, cameras, request, tools, observer, std::move(state));
    finished = outcome.has_value();
    stopped_early = finished && outcome->stopped_early;
  }

  /// The stages in the order in which they were entered. Those that tell how far they are do so many times; the others
  /// once, each time.
  [[nodiscard]] std::vector<Entry> entered() const {
    const std::set<Stage> gradual{Stage::views,   Stage::mask,   Stage::tune,    Stage::correct,
                                  Stage::repaint, Stage::set_up, Stage::optimise};
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < progress.size(); ++i) {
      const Progress& now = progress[i];
      const Progress* before = i > 0 ? &progress[i - 1] : nullptr;
      const bool goes_on = before != nullptr && now.stage == before->stage && now.interval == before->interval &&
                           now.iteration >= before->iteration &&
                           (gradual.contains(now.stage) || now.stage == Stage::finish);
      if (!goes_on) entries.emplace_back(name_of(now.stage), now.interval);
    }
    return entries;
  }
  /// What holds of the progress of every edit that is finished.
  void expect_sound() const {
    ASSERT_TRUE(finished);
    ASSERT_FALSE(progress.empty());
    EXPECT_GE(progress.front().fraction, 0);
    for (std::size_t i = 1; i < progress.size(); ++i) {
      EXPECT_GE(progress[i].fraction, progress[i - 1].fraction) << i;
      EXPECT_LE(progress[i].fraction, 1) << i;
      EXPECT_EQ(progress[i].intervals, resolved_intervals(request)) << i;
    }
    EXPECT_EQ(progress.back().fraction, 1);
    EXPECT_EQ(progress.back().stage, Stage::finish);
  }
};

std::vector<Entry> entries_of(const std::vector<PlannedStage>& plan, int after_interval = 0) {
  std::vector<Entry> entries;
  for (const PlannedStage& planned : plan)
    if (after_interval == 0 || planned.interval > after_interval || planned.stage == Stage::finish)
      entries.emplace_back(name_of(planned.stage), planned.interval);
  return entries;
}

/// Was this entered as it was planned? What is planned for no interval in particular may come in any.
bool matches(const Entry& entered, const Entry& planned) {
  return entered.first == planned.first && (planned.second == 0 || entered.second == planned.second);
}

/// An edit enters what was planned, in that order. One that does not optimise may pass over the mask of a place before
/// the part leaves it, where that was united when the part came; nothing else is ever passed over.
void expect_follows(const Case& c, const std::vector<Entry>& entered, const std::vector<Entry>& planned) {
  std::size_t next = 0;
  for (std::size_t k = 0; k < planned.size(); ++k) {
    if (next < entered.size() && matches(entered[next], planned[k])) {
      ++next;
      continue;
    }
    ASSERT_EQ(planned[k].first, name_of(Stage::mask)) << k << ": passed over";
    EXPECT_GT(planned[k].second, 1) << k << ": in the first interval nothing is known yet";
    EXPECT_EQ(planned.at(k - 1).first, name_of(Stage::deform)) << k;
    EXPECT_EQ(c.iterations, 0) << k << ": an optimisation may have moved what is there";
  }
  EXPECT_EQ(next, entered.size()) << "something that was not planned, or not there";
}

TEST(Stages, HaveTheirNamesOnTheWire) {
  std::vector<std::string_view> names;
  for (std::size_t stage = 0; stage < stage_count; ++stage) names.push_back(name_of(Stage(stage)));
  EXPECT_EQ(names,
            (std::vector<std::string_view>{"assign", "views", "deform", "mask", "observe", "tune", "correct", "repaint",
                                           "set_up", "optimise", "relocate", "pictures", "checkpoint", "finish"}));
  EXPECT_EQ(name_of(Stage::finish), "finish") << "the last one";
}

TEST(Plan, IsTheOrderInWhichAnEditEntersItsStages) {
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    const Told told(c);
    told.expect_sound();
    expect_follows(c, told.entered(), entries_of(plan_of(c.workload())));
  }
}

TEST(Plan, OfAnEditThatGoesOnIsWhatIsLeftOfIt) {
  for (const Case& c : cases) {
    if (!c.kept) continue;
    SCOPED_TRACE(c.name);
    const Told whole(c);
    ASSERT_EQ(whole.checkpoints.size(), std::size_t(c.intervals));
    for (const auto& [interval, bytes] : whole.checkpoints) {
      SCOPED_TRACE(interval);
      const Told resumed(c, bytes);
      resumed.expect_sound();
      std::vector<Entry> entered = resumed.entered();
      ASSERT_FALSE(entered.empty());
      EXPECT_EQ(entered.front(), Entry(name_of(Stage::assign), interval));
      entered.erase(entered.begin());
      Workload rest = c.workload();
      rest.finished = interval;
      expect_follows(c, entered, entries_of(plan_of(rest), interval));
      // It begins about where the undisturbed one was at that point: what it has to do again moves it a little.
      const int after = interval;
      const auto same_point = std::find_if(whole.progress.begin(), whole.progress.end(), [&](const Progress& at) {
        return at.interval > after || at.stage == Stage::finish;
      });
      EXPECT_NEAR(resumed.progress.front().fraction, same_point->fraction, 0.2);
      EXPECT_GT(resumed.progress.front().fraction, 0);
    }
  }
}

TEST(Plan, IsLeftByAnEditThatEndsEarly) {
  const Case c{.name = "", .intervals = 3, .iterations = 2};
  const Told told(c, std::nullopt, /*keep_after=*/1);
  told.expect_sound();
  EXPECT_TRUE(told.stopped_early);
  std::vector<Entry> planned;
  for (const PlannedStage& stage : plan_of(c.workload()))
    if (stage.interval <= 1) planned.emplace_back(name_of(stage.stage), stage.interval);
  expect_follows(c, told.entered(), planned);
}

TEST(Plan, OfADragThatMovesNothingIsPassedOverWhereThereIsNothingToDo) {
  const Case c{
      .name = "", .intervals = 2, .corrections = 2, .iterations = 5, .corrected = true, .shown = true, .kept = true};
  const Told told(c, std::nullopt, 0, /*moves=*/false);
  told.expect_sound();
  const std::vector<Entry> entered = told.entered(), planned = entries_of(plan_of(c.workload()));
  std::size_t next = 0;
  for (const Entry& entry : planned) next += next < entered.size() && matches(entered[next], entry);
  EXPECT_EQ(next, entered.size()) << "in the order of the plan";
  for (const Stage stage : {Stage::observe, Stage::correct, Stage::set_up, Stage::optimise})
    for (const Entry& entry : entered) EXPECT_NE(entry.first, name_of(stage));
  EXPECT_LT(entered.size(), planned.size());
}

TEST(Plan, CostsNoLessThanNothingAndMoreTheMoreThereIsToDo) {
  const auto seconds = [](const Workload& work) {
    double sum = 0;
    for (const PlannedStage& stage : plan_of(work)) {
      EXPECT_GE(stage.seconds, 0);
      sum += stage.seconds;
    }
    return sum;
  };
  for (const Case& c : cases) {
    const Workload work = c.workload();
    const double of_it = seconds(work);
    EXPECT_GT(of_it, 0) << c.name;
    Workload more = work;
    ++more.intervals;
    EXPECT_GT(seconds(more), of_it) << c.name << ": one more interval";
    more = work, more.iterations += 100;
    EXPECT_GT(seconds(more), of_it) << c.name << ": more iterations";
    if (work.iterations > 0) {
      more = work, ++more.corrections;
      EXPECT_GT(seconds(more), of_it) << c.name << ": one more correction";
    }
  }
}

TEST(Plan, HasTheTimeOfAPerceptualLossInEachIterationForThePixelsOfTheBox) {
  for (const Case& c : cases) {
    Workload work = c.workload();
    const double without = seconds_of(plan_of(work));
    work.perceptual_pixel_seconds = 1e-3, work.slowness = 1;
    const double box = work.covered * double(work.view_pixels);
    const int times = (work.intervals - work.finished) * work.corrections * work.iterations;
    EXPECT_NEAR(seconds_of(plan_of(work)) - without, 1e-3 * box * times, 1e-6 * (1 + box * times)) << c.name;
  }
}

// No count of rows tells how long an elastic body is solved for.
TEST(Plan, HasWhatAPreviewOfTheDragTookWhereTheEditDragsAndAssigns) {
  Workload work = cases[1].workload();
  ASSERT_EQ(work.intervals, 3);
  work.dragged = 0;  // of which the plan's own figures would be
  const auto before = plan_of(work);
  work.assign_seconds = 5, work.drag_seconds = 30;
  const auto after = plan_of(work);
  ASSERT_EQ(after.size(), before.size());
  std::map<Stage, double> more;
  for (std::size_t k = 0; k < after.size(); ++k) more[after[k].stage] += after[k].seconds - before[k].seconds;
  EXPECT_NEAR(more[Stage::assign], 5, 1e-9);
  EXPECT_NEAR(more[Stage::views], 30, 1e-9) << "the drag is tried once before views are chosen";
  EXPECT_NEAR(more[Stage::deform], 30, 1e-9) << "a third of it in each interval";
  EXPECT_NEAR(more[Stage::mask], 0, 1e-9);
}

}  // namespace
}  // namespace engine::edit
