// Edits with a corrector, from end to end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "engine/edit/handles.h"
#include "engine/edit/preview.h"
#include "engine/render/forward.h"
#include "engine/working/mode.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/likeness.h"
#include "tests/engine/repair/shadowed_block.h"

namespace engine::edit {
namespace {

Outcome run_with(const BlockScene& block, correct::Corrector* corrector, const Observer& observer = {},
                 std::optional<State> from = std::nullopt) {
  auto outcome = run(block.cloud, block.cameras, block.request, {corrector}, observer, std::move(from));
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  return std::move(*outcome);
}

Outcome run_with_scene_corrector(const BlockScene& block, const Observer& observer = {},
                                 std::optional<State> from = std::nullopt) {
  correct::SceneCorrector corrector;
  return run_with(block, &corrector, observer, std::move(from));
}

/// What the outcome shows where the floor was hidden below the block, over all views.
struct Below {
  float least_alpha = 1;
  Vec3 mean_color{0.0f};
  float most_red = 0;
};
Below below_block(const BlockScene& block, const Outcome& outcome) {
  Below below;
  const scene::GaussianCloud after = scene::flatten(block.cloud, outcome.overlay);
  float count = 0;
  for (const scene::Camera& view : block.cameras) {
    const render::Rendering shown = render::forward(after, view);
    for (const DVec3 point : BlockScene::below_block()) {
      const DVec2 at = view.pixel_from_cam(view.cam_from_world(point));
      const int x = int(at.x), y = int(at.y);
      below.least_alpha = std::min(below.least_alpha, shown.alpha.at(x, y));
      below.most_red = std::max(below.most_red, shown.color.at(x, y, 0));
      below.mean_color += Vec3(shown.color.at(x, y, 0), shown.color.at(x, y, 1), shown.color.at(x, y, 2));
      count += 1;
    }
  }
  below.mean_color /= count;
  return below;
}

TEST(EditWithACorrector, ClosesTheHoleThatAMoveUncoversInTheColourOfWhatIsAround) {
  const BlockScene block;
  const Outcome open = run_with(block, nullptr), closed = run_with_scene_corrector(block);
  const Below without = below_block(block, open), with = below_block(block, closed);
  EXPECT_LT(without.least_alpha, 0.3f);
  EXPECT_GT(with.least_alpha, 0.9f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(with.mean_color[c], floor_color[c], 0.04f) << c;
  EXPECT_LT(with.most_red, floor_color.x + 0.1f) << "nothing of the block is painted onto the floor";
  EXPECT_EQ(open.report.seeds, 0u);
  EXPECT_GT(closed.report.seeds, 0u);
  EXPECT_FALSE(scene::first_not_finite(closed.overlay.rows));
}

TEST(EditWithACorrector, CompletesAPlaceAsSoonAsThePartBeginsToLeaveIt) {
  BlockScene block;
  block.request.params.intervals = 18;  // by a tenth of the block's side each
  std::optional<State> after_first;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    if (done.interval == 1) after_first = done.state;
    return Result<void>{};
  };
  observer.keep = [&] { return after_first.has_value(); };
  (void)run_with_scene_corrector(block, observer);
  ASSERT_TRUE(after_first);
  // Below the block, which still is on most of it.
  const std::vector<std::uint32_t> block_rows = after_first->scene.rows_of(working::Role::copy);
  render::Layers without_block(after_first->scene.cloud());
  without_block.hidden = block_rows;
  int closed = 0, all = 0;
  for (const scene::Camera& view : block.cameras) {
    render::Workspace workspace;
    render::Rendering shown;
    render::forward(without_block, view, {}, {}, workspace, shown);
    for (const DVec3 point : BlockScene::below_block()) {
      const DVec2 at = view.pixel_from_cam(view.cam_from_world(point));
      closed += shown.alpha.at(int(at.x), int(at.y)) > 0.9f, ++all;
    }
  }
  EXPECT_GT(closed, 0.95 * all);
}

TEST(EditWithACorrector, KnowsWhatTheDragWillLeaveAfterAnInterruption) {
  BlockScene block;
  block.request.params.intervals = 18;
  std::optional<State> after_first;
  int done = 0;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& interval) {
    done = interval.interval;
    if (done == 1) after_first = interval.state;
    return Result<void>{};
  };
  observer.keep = [&] { return done == 3; };
  const Outcome whole = run_with_scene_corrector(block, observer);
  ASSERT_TRUE(after_first);
  const auto from = decode(encode(*after_first), block.cloud, block.request);
  ASSERT_TRUE(from);
  done = 1;
  const Outcome resumed = run_with_scene_corrector(block, observer, *from);
  EXPECT_EQ(resumed.overlay, whole.overlay);
  EXPECT_EQ(resumed.report.seeds, whole.report.seeds);
  EXPECT_EQ(whole.report.seeds, after_first->report.seeds) << "the first interval has completed it all";
  EXPECT_EQ(resumed.report.uncovered.size(), block.cameras.size());
}

TEST(EditWithACorrector, RowsThatWereSeenStayTheInputs) {
  const BlockScene block;
  const Outcome outcome = run_with_scene_corrector(block);
  EXPECT_TRUE(scene::validate(outcome.overlay, block.cloud));
  // What the block hides from every camera, the floor in its shadow included, may be made anew.
  const auto was_seen = [&](std::uint32_t row) {
    return row < block.floor_rows && !block.hides(block.cloud.mean.get(row));
  };
  EXPECT_LE(std::ranges::count_if(outcome.overlay.removed, was_seen), 3) << "of 1600, beside its outlines";
  EXPECT_TRUE(std::ranges::none_of(outcome.overlay.changed, was_seen));
  EXPECT_EQ(outcome.report.copies, outcome.overlay.added());
  EXPECT_LE(outcome.report.seeds + 512, outcome.report.copies + 20) << "the block's copies, seeds, their children";
}

TEST(EditWithACorrector, SaysHowMuchOfThePlaceCouldNotBeCompleted) {
  const Outcome completed = run_with_scene_corrector(BlockScene());
  ASSERT_EQ(completed.report.uncovered.size(), completed.report.views.size());
  for (const Uncovered& view : completed.report.uncovered) {
    EXPECT_GT(view.area, 0.0) << view.view;
    EXPECT_LE(view.open, 0.1 * view.area) << view.view;
  }
  EXPECT_TRUE(completed.report.warnings.empty());

  const Outcome open = run_with_scene_corrector(before_rubble());
  for (const Uncovered& view : open.report.uncovered) {
    EXPECT_GT(view.open, 0.5 * view.area) << view.view;
    EXPECT_GE(view.open_from.x, 0.0) << view.view;
    EXPECT_LT(view.open_from.y, view.open_to.y) << view.view;
    EXPECT_LE(view.open_to.x, 1.0) << view.view;
  }
  ASSERT_EQ(open.report.warnings.size(), 1u);
  EXPECT_NE(open.report.warnings[0].find("could not be completed"), std::string::npos) << open.report.warnings[0];
}

/// The block scene, but the block is removed, by its ball.
BlockScene removing_the_block() {
  BlockScene block;
  block.request.mode = Mode::remove;
  block.request.handles[0].target.reset();
  return block;
}

TEST(EditWithACorrector, AShadowGoesAlongUnlessThePartTurnsInTheLight) {
  const auto relit = [](double degrees, ShadowOfPart shadow) {
    repair::ShadowedBlock scene(repair::beside_block);
    Request& request = scene.block.request;
    request.region.reset();
    request.selected = scene.part;
    request.shadow = shadow;
    request.params.interpolation = Interpolation::arap;
    request.params.iterations = 1;
    const double half = degrees * std::numbers::pi / 360;
    request.handles[0].rotation = DQuat(std::cos(half), 0, std::sin(half), 0);
    return run_with_scene_corrector(scene.block).report.relit;
  };
  EXPECT_GT(relit(-25, ShadowOfPart::move), 10u);
  EXPECT_EQ(relit(35, ShadowOfPart::move), 0u);
  EXPECT_EQ(relit(-180, ShadowOfPart::move), 0u);
  EXPECT_GT(relit(350, ShadowOfPart::move), 10u) << "by 10, the other way";
  EXPECT_GT(relit(60, ShadowOfPart::remove), 10u) << "who asks for it has seen one";
}

TEST(EditWithACorrector, RemovesABlockAndClosesWhatItLeft) {
  const BlockScene block = removing_the_block();
  const Outcome outcome = run_with_scene_corrector(block);
  for (auto row = std::uint32_t(block.floor_rows); row < block.cloud.size(); ++row)
    EXPECT_TRUE(std::ranges::binary_search(outcome.overlay.removed, row)) << row;
  EXPECT_EQ(outcome.overlay.added(), outcome.report.copies);
  EXPECT_GT(outcome.report.seeds, 0u);
  EXPECT_EQ(outcome.report.resolved.intervals, 1);
  const Below below = below_block(block, outcome);
  EXPECT_GT(below.least_alpha, 0.9f);
  EXPECT_LT(below.most_red, floor_color.x + 0.1f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(below.mean_color[c], floor_color[c], 0.04f) << c;
  EXPECT_TRUE(outcome.report.warnings.empty());
}

TEST(EditWithACorrector, ARemovalIsTheSameByASelectionWithoutAHandle) {
  BlockScene block = removing_the_block();
  const Outcome by_ball = run_with_scene_corrector(block);
  std::vector<std::uint32_t> rows(block.cloud.size() - block.floor_rows);
  std::iota(rows.begin(), rows.end(), std::uint32_t(block.floor_rows));
  block.request.selected = rows;
  block.request.region.reset();
  block.request.handles.clear();
  const float half = block_side / 2;
  give_radii({Vec3(block.middle) - Vec3(half), Vec3(block.middle) + Vec3(half)}, block.request);
  ASSERT_EQ(block.request.handles.size(), 1u);
  EXPECT_EQ(block.request.handles[0].source, DVec3(Vec3(block.middle)));
  const Outcome by_rows = run_with_scene_corrector(block);
  EXPECT_EQ(by_rows.overlay.removed, by_ball.overlay.removed);
  EXPECT_EQ(by_rows.overlay.rows, by_ball.overlay.rows);
}

TEST(EditWithACorrector, ARemovalPreviewsWithoutRepair) {
  BlockScene block = removing_the_block();
  const auto shown =
      preview(scene::LayeredCloud{std::make_shared<scene::GaussianCloud>(block.cloud), nullptr}, block.request);
  ASSERT_TRUE(shown);
  EXPECT_EQ(shown->overlay.removed.size(), block.cloud.size() - block.floor_rows);
  EXPECT_EQ(shown->overlay.added(), 0u);
  EXPECT_TRUE(shown->warnings.empty());
  block.request.params.iterations = 0;
  EXPECT_EQ(run_with(block, nullptr).overlay, shown->overlay);
}

TEST(EditWithACorrector, HealsAStainThatEveryCameraSaw) {
  BlockScene block;
  const auto is_stained = [&](std::uint32_t row) {
    const Vec3 mean = block.cloud.mean.get(row);
    return row < block.floor_rows && std::abs(mean.x + 0.7f) < 0.2f && std::abs(mean.z) < 0.2f;
  };
  for (std::uint32_t row = 0; row < block.floor_rows; ++row)
    if (is_stained(row)) {
      block.request.healed.push_back(row);
      for (int c = 0; c < 3; ++c)
        block.cloud.sh_row(row)[std::size_t(c) * 4] = (block_color[c] - 0.5f) / float(scene::sh_c0);
    }
  ASSERT_GT(block.request.healed.size(), 20u);
  const auto redness = [&](const Outcome& outcome) {
    float most = 0;
    const scene::GaussianCloud after = scene::flatten(block.cloud, outcome.overlay);
    for (const scene::Camera& view : block.cameras) {
      const render::Rendering shown = render::forward(after, view);
      const DVec2 at = view.pixel_from_cam(view.cam_from_world(DVec3(-0.7, 0, 0)));
      most = std::max(most, shown.color.at(int(at.x), int(at.y), 0));
      EXPECT_GT(shown.alpha.at(int(at.x), int(at.y)), 0.9f);
    }
    return most;
  };
  const Outcome healed = run_with_scene_corrector(block);
  EXPECT_LT(redness(healed), floor_color.x + 0.1f);
  for (const std::uint32_t row : block.request.healed)
    EXPECT_TRUE(std::ranges::binary_search(healed.overlay.removed, row)) << row;
  EXPECT_GT(redness(run_with(block, nullptr)), 0.8f) << "nothing heals without a corrector";
  block.request.healed.clear();
  EXPECT_GT(redness(run_with_scene_corrector(block)), 0.8f) << "what was seen stays";
}

TEST(EditWithACorrector, BesideAStainThatIsRemovedTheSurfaceStays) {
  BlockScene block;
  std::vector<std::uint32_t> stain;
  for (std::uint32_t row = 0; row < block.floor_rows; ++row) {
    const Vec3 mean = block.cloud.mean.get(row);
    if (std::abs(mean.x + 0.7f) < 0.2f && std::abs(mean.z) < 0.2f) stain.push_back(row);
  }
  ASSERT_GT(stain.size(), 20u);
  for (std::uint32_t row = 0; row < block.floor_rows; ++row) block.cloud.opacity_logit[row] = 1;  // none hides another
  block.request.mode = Mode::remove;
  block.request.selected = block.request.healed = stain;
  block.request.region.reset();
  block.request.handles.clear();
  give_radii({Vec3(-0.9f, 0, -0.2f), Vec3(-0.5f, 0, 0.2f)}, block.request);
  EXPECT_EQ(run_with_scene_corrector(block).overlay.removed, stain) << "nothing was seen through it";
}

TEST(EditWithACorrector, WhatWasSeenHardlyMovesInTheOptimisation) {
  BlockScene block;
  const auto copies = [&](const Outcome& outcome) {
    std::vector<DVec3> means;
    for (std::size_t k = 0; k < 512; ++k)
      means.emplace_back(outcome.overlay.rows.mean.get(outcome.overlay.changed.size() + k));
    return means;
  };
  const auto with = copies(run_with_scene_corrector(block)), without = copies(run_with(block, nullptr));
  block.request.params.iterations = 0;
  const auto deformed = copies(run_with(block, nullptr));
  double moved_with = 0, moved_without = 0;
  for (std::size_t k = 0; k < 512; ++k)
    moved_with += glm::distance(with[k], deformed[k]), moved_without += glm::distance(without[k], deformed[k]);
  EXPECT_GT(moved_without, 0);
  EXPECT_LT(moved_with, 0.5 * moved_without);
}

TEST(EditWithACorrector, WhatHasLeftStaysAsFaintAsItWasLeft) {
  const BlockScene block;
  const float lowered = working::keep_logit(Mode::move);
  std::size_t left = 0, lifted = 0;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    const working::WorkingScene& scene = done.state.scene;
    for (const std::uint32_t row : scene.rows_of(working::Role::original)) {
      ++left;
      lifted += scene.cloud().opacity_logit[row] != std::min(block.cloud.opacity_logit[row], lowered);
    }
    return Result<void>{};
  };
  (void)run_with_scene_corrector(block, observer);
  EXPECT_GT(left, 0u);
  EXPECT_EQ(lifted, 0u) << "the place is filled by others";
  (void)run_with(block, nullptr, observer);
  EXPECT_GT(lifted, 0u) << "nothing else would fill it";
}

TEST(EditWithACorrector, SeedsNothingBehindAPartThatHangsBeforeAWholeSurface) {
  const BlockScene block(/*gap=*/0.5f);
  const Outcome outcome = run_with_scene_corrector(block);
  EXPECT_EQ(outcome.report.seeds, 0u);
  const Below below = below_block(block, outcome);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(below.mean_color[c], floor_color[c], 0.02f) << c;
}

TEST(EditWithACorrector, SeedsLittleBehindAPartThatHangsBeforeANoisySurface) {
  BlockScene block(/*gap=*/0.5f);
  std::mt19937 random(7);
  // Depths of the floor are off by up to 8 % of what the cameras are away, and what lies deeper shines through.
  std::uniform_real_distribution<float> height(-0.2f, 0.2f);
  for (std::uint32_t row = 0; row < block.floor_rows; ++row) {
    const Vec3 mean = block.cloud.mean.get(row);
    block.cloud.mean.set(row, {mean.x, height(random), mean.z});
    block.cloud.opacity_logit[row] = 1;
  }
  EXPECT_LT(run_with_scene_corrector(block).report.seeds, 40u) << "by depths alone they are 49";
}

TEST(EditWithACorrector, LooksOutsideItsMasksLikeTheInput) {
  const BlockScene block;
  const Outcome outcome = run_with_scene_corrector(block);
  const scene::GaussianCloud after = scene::flatten(block.cloud, outcome.overlay);
  ASSERT_EQ(outcome.masks.size(), block.cameras.size());
  for (std::size_t v = 0; v < outcome.views.size(); ++v) {
    const scene::Image before = render::forward(block.cloud, outcome.views[v]).color,
                       now = render::forward(after, outcome.views[v]).color;
    EXPECT_GT(psnr_where(before, now, outcome.masks[v], 0), 40) << v;
    EXPECT_LT(psnr_where(before, now, outcome.masks[v], 1), 25) << v << ": the block is not there any more";
  }
}

TEST(EditWithACorrector, GivesTheSameBytesForAnyNumberOfThreads) {
  for (const Mode mode : {Mode::move, Mode::extend}) {
    const BlockScene block(0, mode);
    std::optional<Outcome> first;
    for (const int threads : {1, 2, 4})
      WorkArena(threads).run([&] {
        Outcome outcome = run_with_scene_corrector(block);
        if (!first)
          first = std::move(outcome);
        else
          EXPECT_EQ(outcome.overlay, first->overlay) << threads;
      });
  }
}

/// Standard deviations of the new Gaussians along their longest axes, on the mean.
double mean_extent(const Outcome& outcome) {
  double sum = 0;
  std::size_t count = 0;
  const scene::GaussianCloud& rows = outcome.overlay.rows;
  for (std::size_t row = outcome.overlay.changed.size(); row < rows.size(); ++row) {
    const auto sh = rows.sh_row(row);
    if (sh[0] < sh[2 * scene::sh_coefficients(rows.sh_degree)]) continue;  // of the floor, which is blue: a seed
    const Vec3 log_scale = rows.log_scale.get(row);
    sum += std::exp(double(std::max({log_scale.x, log_scale.y, log_scale.z})));
    ++count;
  }
  return sum / double(count);
}

TEST(EditWithACorrector, WhatIsStretchedIsDrawnOutOncePerInterval) {
  BlockScene block(0, Mode::move);
  Handle left = block.request.handles[0], right = left;
  left.source.x -= 0.1, right.source.x += 0.1;
  left.target->x -= 0.2, right.target->x += 0.2;
  block.request.handles = {left, right};
  block.request.params.interpolation = Interpolation::rigid;
  block.request.params.intervals = 2, block.request.params.iterations = 1;
  const double stays = mean_extent(run_with(block, nullptr));
  std::optional<Outcome> once;
  for (const int steps : {1, 2}) {
    block.request.params.annealing_steps = steps;
    std::optional<Outcome> first;
    for (const int threads : {1, 4})
      WorkArena(threads).run([&] {
        std::string checkpoint;
        Observer observer;
        observer.interval_done = [&](const IntervalDone& done) {
          if (done.interval == 1) checkpoint = encode(done.state);
          return Result<void>{};
        };
        Outcome outcome = run_with_scene_corrector(block, observer);
        if (!first) {
          first = std::move(outcome);
          return;
        }
        EXPECT_EQ(outcome.overlay, first->overlay) << threads;
        const auto resumed = decode(checkpoint, block.cloud, block.request);
        ASSERT_TRUE(resumed) << resumed.error().message;
        EXPECT_EQ(run_with_scene_corrector(block, {}, *resumed).overlay, outcome.overlay) << "gone on with";
      });
    EXPECT_GT(mean_extent(*first), 1.2 * stays);
    if (!once)
      once = std::move(first);
    else
      EXPECT_NEAR(mean_extent(*first), mean_extent(*once), 0.03 * stays) << "not again by each correction";
  }
}

TEST(EditWithACorrector, GoesOnAfterAnIntervalToTheSameBytes) {
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const bool far_away : {false, true}) {
      BlockScene block(0, mode);
      const int intervals = mode == Mode::move && !far_away ? 3 : 2;  // under a sanitizer each takes ten seconds
      block.request.params.intervals = intervals;
      block.request.params.annealing_steps = 2;
      block.request.params.iterations = 4;
      if (far_away) {
        const DVec3 by(4096, -4096, 2048);
        for (std::size_t i = 0; i < block.cloud.size(); ++i)
          block.cloud.mean.set(i, block.cloud.mean.get(i) + Vec3(by));
        for (scene::Camera& camera : block.cameras) camera.translation -= camera.rotation * by;
        block.request.handles[0].source += by;
        *block.request.handles[0].target += by;
        block.request.region->center += by;
      }
      std::map<int, std::string> checkpoints;
      Observer observer;
      observer.interval_done = [&](const IntervalDone& done) {
        EXPECT_TRUE(done.state.scene.check()) << done.interval;
        checkpoints[done.interval] = encode(done.state);
        return Result<void>{};
      };
      const Outcome undisturbed = run_with_scene_corrector(block, observer);
      ASSERT_EQ(checkpoints.size(), std::size_t(intervals));
      if (mode == Mode::move) {
        EXPECT_GT(undisturbed.report.seeds, 0u);
      }
      for (const auto& [interval, bytes] : checkpoints) {
        const auto from = decode(bytes, block.cloud, block.request);
        ASSERT_TRUE(from) << from.error().message;
        const Outcome resumed = run_with_scene_corrector(block, {}, *from);
        EXPECT_EQ(resumed.overlay, undisturbed.overlay) << interval;
        EXPECT_EQ(resumed.masks, undisturbed.masks) << interval;
        EXPECT_EQ(resumed.report.seeds, undisturbed.report.seeds) << interval;
        EXPECT_EQ(resumed.report.losses, undisturbed.report.losses) << interval;
      }
    }
}

TEST(EditWithACorrector, AnExtendIsDrawnOutOpaque) {
  // Without a corrector the pictures show the original half transparent, as it was made; with one they do not.
  BlockScene block(0, Mode::extend);
  block.request.params.iterations = 60;
  const auto mean_logit_of_originals = [&](const Outcome& outcome) {
    const scene::GaussianCloud after = scene::flatten(block.cloud, outcome.overlay);
    double sum = 0;
    for (std::size_t row = block.floor_rows; row < block.cloud.size(); ++row) sum += double(after.opacity_logit[row]);
    return sum / double(block.cloud.size() - block.floor_rows);
  };
  EXPECT_GT(mean_logit_of_originals(run_with_scene_corrector(block)),
            mean_logit_of_originals(run_with(block, nullptr)) + 0.1);
}

/// Cannot do its work.
class Failing final : public correct::Corrector {
 public:
  explicit Failing(bool when_tuned) : when_tuned_(when_tuned) {}
  Result<void> fine_tune(std::span<const correct::Example>, int) override {
    if (when_tuned_) return fail(ErrorCode::unavailable, "the corrector cannot learn", "tuning");
    return {};
  }
  Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask>, double, std::uint64_t) override {
    return fail(ErrorCode::unavailable, "the corrector is out of order", "corrector");
  }

 private:
  bool when_tuned_;
};

TEST(EditWithACorrector, AnErrorOfTheCorrectorEndsTheEdit) {
  const BlockScene block;
  for (const bool when_tuned : {false, true}) {
    Failing failing(when_tuned);
    const auto outcome = run(block.cloud, block.cameras, block.request, {&failing});
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().code, ErrorCode::unavailable);
    EXPECT_EQ(outcome.error().where, when_tuned ? "tuning" : "corrector");
  }
}

/// Gives back so many times this picture, whatever it is asked for.
class Careless final : public correct::Corrector {
 public:
  Careless(std::size_t pictures, const scene::Image& picture) : pictures_(pictures, picture) {}
  Result<void> fine_tune(std::span<const correct::Example>, int) override { return {}; }
  Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask>, double, std::uint64_t) override {
    return pictures_;
  }

 private:
  std::vector<scene::Image> pictures_;
};

TEST(EditWithACorrector, ACorrectorThatAnswersSomethingElseEndsTheEdit) {
  BlockScene block;
  block.request.params.max_image_side = 48;
  const scene::Camera view = scene::fit_within(block.cameras[0], 48);
  const int width = view.width, height = view.height;
  for (Careless careless :
       {Careless(0, {}), Careless(2, scene::Image(width, height, 3)), Careless(1, scene::Image(width + 1, height, 3)),
        Careless(1, scene::Image(width, height - 1, 3)), Careless(1, scene::Image(width, height, 1))}) {
    const auto outcome = run(block.cloud, block.cameras, block.request, {&careless});
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().code, ErrorCode::internal);
    EXPECT_EQ(outcome.error().where, "corrector");
  }
}

/// Leaves pictures as they are, and notes how strongly it was to correct them.
class Noting final : public correct::Corrector {
 public:
  std::vector<double> strengths;  ///< Each time that it changed.
  Result<void> fine_tune(std::span<const correct::Example>, int) override { return {}; }
  Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask> views, double strength,
                                            std::uint64_t) override {
    if (strengths.empty() || strengths.back() != strength) strengths.push_back(strength);
    std::vector<scene::Image> pictures;
    for (const correct::CorrectionTask& flawed : views) pictures.push_back(flawed.picture);
    return pictures;
  }
};

TEST(EditWithACorrector, StrengthFallsFromTheFirstCorrectionOfAnIntervalToItsLast) {
  BlockScene block;
  Params& params = block.request.params;
  params.intervals = 2, params.iterations = 1, params.annealing_steps = 3;
  params.strength_initial = 0.75, params.strength_final = 0.25;
  Noting noting;
  run_with(block, &noting);
  EXPECT_EQ(noting.strengths, (std::vector<double>{0.75, 0.5, 0.25, 0.75, 0.5, 0.25}));
}

TEST(EditWithACorrector, IsNotAskedWhereNothingIsOptimisedOrMoved) {
  BlockScene block;
  Failing failing(true);
  block.request.params.iterations = 0;
  run_with(block, &failing);
  block.request.params.iterations = 5;
  block.request.handles[0].target = block.request.handles[0].source;
  EXPECT_EQ(run_with(block, &failing).overlay, scene::no_change(block.cloud));
}

TEST(EditWithACorrector, ReportsItsProgressAndStopsWhenAsked) {
  const BlockScene block;
  std::vector<double> correcting;
  double last = 0;
  Observer observer;
  observer.progress = [&](const Progress& progress) {
    EXPECT_GE(progress.fraction, last);
    last = progress.fraction;
    if (progress.stage == Stage::correct) correcting.push_back(progress.fraction);
  };
  run_with_scene_corrector(block, observer);
  EXPECT_EQ(last, 1.0);
  EXPECT_GE(correcting.size(), block.cameras.size());

  std::stop_source stop;
  observer = {};
  observer.stop = stop.get_token();
  int steps = 0;
  observer.progress = [&](const Progress& progress) {
    if (progress.stage == Stage::correct && ++steps == 2) stop.request_stop();
  };
  correct::SceneCorrector corrector;
  const auto stopped = run(block.cloud, block.cameras, block.request, {&corrector}, observer);
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
  EXPECT_EQ(steps, 2) << "at once";
}

}  // namespace
}  // namespace engine::edit
