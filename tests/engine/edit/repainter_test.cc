// Edits with a repainter, from end to end.
#include "engine/correct/repainter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/correct/pyramid.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/student.h"

namespace engine::edit {
namespace {

using correct::HistoryPicture;
using correct::Origin;

/// The block scene in few, small pictures and iterations.
BlockScene small_block(Mode mode = Mode::move) {
  BlockScene block(0, mode);
  block.cameras.resize(3);
  block.request.params.iterations = 3;
  return block;
}

Result<Outcome> attempt(const BlockScene& block, Student& student, const Observer& observer = {},
                        std::optional<State> from = std::nullopt) {
  correct::SceneCorrector corrector;
  return run(block.cloud, block.cameras, block.request, {.corrector = &corrector, .repainter = &student}, observer,
             std::move(from));
}

Outcome repainted(const BlockScene& block, Student& student, const Observer& observer = {},
                  std::optional<State> from = std::nullopt) {
  auto outcome = attempt(block, student, observer, std::move(from));
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  return std::move(*outcome);
}

TEST(EditWithARepainter, LearnsBeforeEachIntervalAndRepaintsAllViewsInOneCall) {
  BlockScene block = small_block();
  Params& params = block.request.params;
  params.intervals = 2, params.annealing_steps = 3, params.strength_initial = 0.75, params.strength_final = 0.25;
  Student student;
  repainted(block, student);
  ASSERT_EQ(student.lessons.size(), 2u);
  EXPECT_EQ(student.lessons[0].steps, 200);
  EXPECT_EQ(student.lessons[1].steps, 50);
  ASSERT_EQ(student.asked.size(), 6u) << "two intervals of three corrections";
  std::set<std::uint64_t> seeds{student.lessons[0].seed, student.lessons[1].seed};
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(student.asked[k].tasks.size(), 3u) << "all views at a time";
    EXPECT_EQ(student.asked[k].strength, 0.75 - 0.25 * double(k % 3)) << k;
    seeds.insert(student.asked[k].seed);
  }
  EXPECT_EQ(seeds.size(), 8u) << "each call has a seed of its own";
}

TEST(EditWithARepainter, TheHistoryIsTheViewsBeforeTheEditAndWhatIntervalsMadeOfThem) {
  BlockScene block = small_block();
  block.request.params.intervals = 3, block.request.params.annealing_steps = 2;
  std::map<int, std::vector<scene::Image>> corrected;
  Observer observer;
  observer.moment = [&](const Moment& moment) {
    if (moment.name == "corrected") corrected[moment.interval].assign(moment.pictures.begin(), moment.pictures.end());
    return Result<void>{};
  };
  Student student;
  const Outcome outcome = repainted(block, student, observer);
  ASSERT_EQ(student.lessons.size(), 3u);
  for (std::size_t u = 0; u < 3; ++u) {
    const auto& history = student.lessons[u].history;
    ASSERT_EQ(history.size(), 3 * (u + 1)) << "edited pictures come beside the originals, never in their place";
    for (std::size_t k = 0; k < history.size(); ++k) {
      const HistoryPicture& picture = history[k];
      EXPECT_EQ(picture.view, k % 3);
      EXPECT_EQ(picture.interval, int(k / 3));
      EXPECT_EQ(picture.origin, k < 3 ? Origin::original : Origin::edited);
      EXPECT_FALSE(picture.box.empty());
      const scene::Image shown = k < 3 ? render::forward(block.cloud, outcome.views[picture.view]).color
                                       : corrected.at(picture.interval).at(picture.view);
      EXPECT_EQ(picture.picture, correct::as_bytes(shown)) << u << " " << k;
    }
  }
  // What must not be painted back by patches is just what a repainter has to know.
  const HistoryPicture& first = student.lessons[0].history[1];
  std::size_t red = 0;
  const scene::Image shown = correct::as_image(first.picture);
  for (int y = first.box.y0; y < first.box.y1; ++y)
    for (int x = first.box.x0; x < first.box.x1; ++x) red += shown.at(x, y, 0) > 0.7f && shown.at(x, y, 1) < 0.3f;
  EXPECT_GT(red, 50u) << "the block at its old place";
}

TEST(EditWithARepainter, GeometryIsCompletedBeforeAnyViewIsShownToIt) {
  const BlockScene block = small_block();
  Student student;
  const Outcome outcome = repainted(block, student);
  EXPECT_GT(outcome.report.seeds, 0u);
  ASSERT_EQ(student.asked.size(), 1u);
  for (std::size_t v = 0; v < 3; ++v) {
    const scene::Image& picture = student.asked[0].tasks[v].picture;
    const scene::Camera& view = outcome.views[v];
    for (const DVec3 point : BlockScene::below_block()) {
      const DVec2 at = view.pixel_from_cam(view.cam_from_world(point));
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(picture.at(int(at.x), int(at.y), c), floor_color[c], 0.1) << v << ": the floor goes on";
    }
  }
}

TEST(EditWithARepainter, TheWholeMaskIsItsToChangeButForARimThatFades) {
  BlockScene block = small_block();
  std::vector<scene::Image> corrected;
  Observer observer;
  observer.moment = [&](const Moment& moment) {
    if (moment.name == "corrected") corrected.assign(moment.pictures.begin(), moment.pictures.end());
    return Result<void>{};
  };
  Student student;
  const Vec3 color{0.1f, 0.9f, 0.2f};
  student.answer = [&](std::span<const correct::RepaintTask> tasks) {
    std::vector<scene::Image> out;
    for (const correct::RepaintTask& task : tasks) {
      scene::Image& picture = out.emplace_back(task.picture.width, task.picture.height, 3);
      for (int c = 0; c < 3; ++c) std::ranges::fill(picture.plane(c), color[c]);
    }
    return out;
  };
  repainted(block, student, observer);
  ASSERT_EQ(corrected.size(), 3u);
  std::size_t within = 0;
  for (std::size_t v = 0; v < 3; ++v) {
    const correct::RepaintTask& task = student.asked[0].tasks[v];
    const std::vector<int> depth = correct::depth_within(task.mask);
    const int rim = mask::dilation_radius(task.mask.height);
    for (std::size_t i = 0; i < depth.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const float before = task.picture.plane(c)[i], now = corrected[v].plane(c)[i];
        if (depth[i] == 0) {
          ASSERT_EQ(now, before) << "outside the mask";
        } else if (depth[i] > rim) {
          ++within;
          ASSERT_NEAR(now, color[c], 1e-6) << "what was seen as well";
        } else {
          ASSERT_LE(std::abs(now - before), std::abs(color[c] - before) + 1e-6f);
          ASSERT_LE(std::abs(now - color[c]), std::abs(color[c] - before) + 1e-6f);
        }
      }
  }
  EXPECT_GT(within, 1000u);
}

TEST(EditWithARepainter, DeformedCopiesFollowWhatItPaints) {
  BlockScene block = small_block();
  block.request.params.iterations = 30;
  const auto redness = [&](const Outcome& outcome) {
    double sum = 0;
    const scene::GaussianCloud& rows = outcome.overlay.rows;
    for (std::size_t row = outcome.overlay.changed.size(); row < outcome.overlay.changed.size() + 512; ++row)
      sum += double(rows.sh_row(row)[0]);
    return sum / 512;
  };
  correct::SceneCorrector corrector;
  const auto held = run(block.cloud, block.cameras, block.request, {&corrector});
  ASSERT_TRUE(held);
  Student student;
  student.answer = [](std::span<const correct::RepaintTask> tasks) {
    std::vector<scene::Image> out;
    for (const correct::RepaintTask& task : tasks)
      out.emplace_back(task.picture.width, task.picture.height, 3, 0.1f);  // black
    return out;
  };
  const double as_it_was = (double(block_color.x) - 0.5) / scene::sh_c0;
  EXPECT_NEAR(redness(*held), as_it_was, 1e-3) << "they were seen, and are held where they are completed only";
  EXPECT_LT(redness(repainted(block, student)), as_it_was - 4e-3);
}

TEST(EditWithARepainter, GoesOnAfterAnIntervalToTheSameBytes) {
  for (const Mode mode : {Mode::move, Mode::extend}) {
    BlockScene block = small_block(mode);
    block.request.params.intervals = 3, block.request.params.annealing_steps = 2;
    std::map<int, std::string> checkpoints;
    Observer observer;
    observer.interval_done = [&](const IntervalDone& done) {
      checkpoints[done.interval] = encode(done.state);
      return Result<void>{};
    };
    Student student;
    const Outcome undisturbed = repainted(block, student, observer);
    ASSERT_EQ(checkpoints.size(), 3u);
    for (const auto& [interval, bytes] : checkpoints) {
      auto from = decode(bytes, block.cloud, block.request);
      ASSERT_TRUE(from) << from.error().message;
      EXPECT_EQ(from->history.size(), 3 * std::size_t(interval));
      EXPECT_EQ(encode(*from), bytes);
      Student another;
      EXPECT_EQ(repainted(block, another, {}, *from).overlay, undisturbed.overlay) << interval;
      // What was learned counts, and so does what was made: otherwise this shows nothing.
      if (interval == 3) continue;
      State forgetful = *from;
      Student blank;
      forgetful.repainter = blank.state();
      EXPECT_NE(repainted(block, blank, {}, forgetful).overlay, undisturbed.overlay) << interval;
      forgetful = *from;
      forgetful.history.clear();
      Student without_history;
      EXPECT_NE(repainted(block, without_history, {}, forgetful).overlay, undisturbed.overlay) << interval;
    }
  }
}

TEST(EditWithARepainter, GoesOnAfterAnIntervalInWhichItHadNothingToLearn) {
  BlockScene block = small_block();
  block.request.params.intervals = 2;
  block.request.handles[0].target = block.request.handles[0].source;
  std::optional<State> after_first;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    if (done.interval == 1) after_first = done.state;
    return Result<void>{};
  };
  Student student;
  EXPECT_EQ(repainted(block, student, observer).overlay, scene::no_change(block.cloud));
  ASSERT_TRUE(after_first);
  EXPECT_FALSE(Student().restore("")) << "otherwise this shows nothing";
  Student another;
  EXPECT_EQ(repainted(block, another, {}, after_first).overlay, scene::no_change(block.cloud));
}

TEST(EditWithARepainter, WhatCannotBeTakenUpAgainIsAnError) {
  BlockScene block = small_block();
  block.request.params.intervals = 2;
  std::string checkpoint;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    if (done.interval == 1) checkpoint = encode(done.state);
    return Result<void>{};
  };
  Student student;
  repainted(block, student, observer);
  auto from = decode(checkpoint, block.cloud, block.request);
  ASSERT_TRUE(from);
  State strange = *from;
  strange.repainter = "of another one";
  Student another;
  EXPECT_EQ(attempt(block, another, {}, strange).error().where, "checkpoint");
  Observer keeping;
  keeping.keep = [] { return true; };
  EXPECT_TRUE(repainted(block, another, keeping, strange).stopped_early) << "it has nothing to paint any more";
  const std::vector<std::pair<const char*, void (*)(HistoryPicture&)>> changes{
      {"a view that there is not", [](HistoryPicture& p) { p.view = 3; }},
      {"an interval that is not finished", [](HistoryPicture& p) { p.interval = 2; }},
      {"a picture of another size", [](HistoryPicture& p) { p.picture = correct::as_bytes(scene::Image(8, 8, 3)); }}};
  for (const auto& [what, change] : changes) {
    State other = *from;
    change(other.history[0]);
    EXPECT_EQ(decode(encode(other), block.cloud, block.request).error().code, ErrorCode::invalid_argument) << what;
  }
}

TEST(EditWithARepainter, IsNotAskedWhereNothingIsOptimisedOrMoved) {
  BlockScene block = small_block();
  Student student;
  block.request.params.iterations = 0;
  repainted(block, student);
  block.request.params.iterations = 3;
  block.request.handles[0].target = block.request.handles[0].source;
  EXPECT_EQ(repainted(block, student).overlay, scene::no_change(block.cloud));
  EXPECT_TRUE(student.lessons.empty());
  EXPECT_TRUE(student.asked.empty());
}

TEST(EditWithARepainter, IsStoppedWithinAStepOfItsTrainingAndOfItsPainting) {
  const BlockScene block = small_block();
  for (const Stage stage : {Stage::tune, Stage::repaint}) {
    std::stop_source stop;
    Observer observer;
    observer.stop = stop.get_token();
    int told = 0;
    observer.progress = [&](const Progress& progress) {
      if (progress.stage == stage && ++told == 3) stop.request_stop();
    };
    Student student;
    const auto stopped = attempt(block, student, observer);
    ASSERT_FALSE(stopped);
    EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
    EXPECT_EQ(told, 3) << name_of(stage) << ": at once";
  }
}

TEST(EditWithARepainter, OneThatAnswersSomethingElseEndsTheEdit) {
  const BlockScene block = small_block();
  const auto pictures = [](std::size_t count, int more, float value) {
    return [=](std::span<const correct::RepaintTask> tasks) {
      const scene::Image& asked = tasks[0].picture;
      return std::vector<scene::Image>(count, scene::Image(asked.width + more, asked.height, 3, value));
    };
  };
  for (const auto& answer : {pictures(2, 0, 0), pictures(4, 0, 0), pictures(3, 1, 0),
                             pictures(3, 0, std::numeric_limits<float>::infinity())}) {
    Student student;
    student.answer = answer;
    const auto outcome = attempt(block, student);
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().code, ErrorCode::internal);
    EXPECT_EQ(outcome.error().where, "repainter");
  }
}

}  // namespace
}  // namespace engine::edit
