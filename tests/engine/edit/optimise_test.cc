// Edits that optimise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "engine/edit/optimise.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/likeness.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

const DVec3 far_away(65536, -65536, 65536);

struct Case {
  scene::GaussianCloud scene;
  std::vector<scene::Camera> cameras;
  Request request;

  explicit Case(Mode mode = Mode::move, DVec3 center = DVec3(0)) : scene(ball_before_wall(120, Vec3(center))) {
    cameras = arc_of_cameras(3, 64, center);
    request.mode = mode;
    request.handles = {{center, center + DVec3(0.5, 0.2, 0), 0.25, 0}};
    request.params.intervals = 2;
    request.params.max_image_side = 64;
    request.params.iterations = 12;
    request.params.annealing_steps = 2;
  }
};

Observer collecting(std::map<int, std::string>& checkpoints) {
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_TRUE(done.state.scene.check()) << done.interval;
    checkpoints[done.interval] = encode(done.state);
    return Result<void>{};
  };
  return observer;
}

TEST(Optimise, ChangesMembersOfTheMaskAndNothingElse) {
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const DVec3 center : {DVec3(0), far_away}) {
      const Case c(mode, center);
      Case plain(mode, center);
      plain.request.params.iterations = 0;
      const auto optimised = run(c.scene, c.cameras, c.request);
      const auto deformed = run(plain.scene, plain.cameras, plain.request);
      ASSERT_TRUE(optimised) << optimised.error().message;
      ASSERT_TRUE(deformed);
      EXPECT_NE(optimised->overlay, deformed->overlay);
      const std::set<std::uint32_t> changed(optimised->overlay.changed.begin(), optimised->overlay.changed.end());
      const scene::GaussianCloud flat = scene::flatten(c.scene, optimised->overlay);
      const auto survivors = survivors_of(c.scene.size(), optimised->overlay);
      std::size_t stayed = 0;
      for (std::size_t i = 0; i < survivors.size(); ++i) {
        const bool same = same_row(flat, i, c.scene, survivors[i]);
        EXPECT_EQ(same, changed.count(survivors[i]) == 0) << survivors[i];
        const bool dragged = glm::distance(DVec3(c.scene.mean.get(survivors[i])), center) < 0.25;
        if (!dragged) {
          EXPECT_TRUE(same) << survivors[i];
        }
        stayed += same ? 1 : 0;
      }
      EXPECT_GE(stayed, 144u) << "the wall";
      EXPECT_FALSE(scene::first_not_finite(flat));
      EXPECT_EQ(flat.extra_stride, c.scene.extra_stride);
    }
}

TEST(Optimise, BringsTheBackgroundBack) {
  const Case c;
  Case plain;
  plain.request.params.iterations = 0;
  Case longer;
  longer.request.params.iterations = 60;
  const auto deformed = run(c.scene, c.cameras, plain.request), optimised = run(c.scene, c.cameras, longer.request);
  ASSERT_TRUE(deformed && optimised);
  for (std::size_t v = 0; v < optimised->views.size(); ++v) {
    const scene::Camera& view = optimised->views[v];
    const scene::Mask& mask = optimised->masks[v];
    const scene::Image input = render::forward(c.scene, view).color;
    const auto outside = [&](const scene::Overlay& overlay) {
      return psnr_where(input, render::forward(scene::flatten(c.scene, overlay), view).color, mask, 0);
    };
    EXPECT_GT(outside(optimised->overlay), outside(deformed->overlay)) << v;
  }
}

TEST(Optimise, ReportsTheLossOfEveryIterationAndInterval) {
  const Case c;
  std::vector<double> of_intervals;
  std::map<int, std::vector<double>> losses;
  double last = -1;
  Observer observer;
  observer.progress = [&](const Progress& progress) {
    EXPECT_GE(progress.fraction, last);
    last = progress.fraction;
    EXPECT_EQ(progress.iterations, 24) << "two corrections of twelve";
    if (!progress.loss) return;  // the views of a correction are being set up
    EXPECT_EQ(progress.stage, Stage::optimise);
    losses[progress.interval].push_back(*progress.loss);
    EXPECT_EQ(progress.iteration, int(losses[progress.interval].size()));
  };
  std::vector<std::string> stages;
  observer.moment = [&](const Moment& moment) {
    stages.push_back(moment.name);
    return Result<void>{};
  };
  observer.interval_done = [&](const IntervalDone& done) {
    of_intervals.push_back(done.loss.value());
    return Result<void>{};
  };
  const auto outcome = run(c.scene, c.cameras, c.request, {}, observer);
  ASSERT_TRUE(outcome);
  ASSERT_EQ(losses.size(), 2u);
  for (const auto& [interval, of_iterations] : losses) {
    ASSERT_EQ(of_iterations.size(), 24u) << interval;
    const double last_epoch = (of_iterations[21] + of_iterations[22] + of_iterations[23]) / 3;
    EXPECT_NEAR(of_intervals.at(std::size_t(interval) - 1), last_epoch, 1e-9) << "three views";
  }
  EXPECT_EQ(stages, (std::vector<std::string>{"before", "deformed", "optimised", "before", "deformed", "optimised"}));
  EXPECT_EQ(of_intervals, outcome->report.losses);
  for (const double loss : of_intervals) EXPECT_GT(loss, 0);
}

TEST(Optimise, WithoutIterationsThereIsNoLoss) {
  Case c;
  c.request.params.iterations = 0;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_FALSE(done.loss);
    return Result<void>{};
  };
  EXPECT_TRUE(run(c.scene, c.cameras, c.request, {}, observer)->report.losses.empty());
}

TEST(Optimise, GivesTheSameBytesForAnyNumberOfThreads) {
  std::optional<scene::Overlay> first;
  for (const int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const Case c;
      const auto outcome = run(c.scene, c.cameras, c.request);
      ASSERT_TRUE(outcome);
      if (!first) first = outcome->overlay;
      EXPECT_EQ(outcome->overlay, *first) << threads;
    });
  }
}

TEST(Optimise, AnotherSeedMayGiveOtherBytesTheSameSeedDoesNot) {
  Case c;
  const auto first = run(c.scene, c.cameras, c.request), again = run(c.scene, c.cameras, c.request);
  c.request.params.seed = 9;
  const auto other = run(c.scene, c.cameras, c.request);
  EXPECT_EQ(first->overlay, again->overlay);
  EXPECT_NE(first->overlay, other->overlay);
}

TEST(Optimise, GoesOnAfterAnIntervalToTheSameBytes) {
  for (const Mode mode : {Mode::move, Mode::extend})
    for (const DVec3 center : {DVec3(0), far_away}) {
      const Case c(mode, center);
      std::map<int, std::string> checkpoints;
      const auto undisturbed = run(c.scene, c.cameras, c.request, {}, collecting(checkpoints));
      ASSERT_TRUE(undisturbed);
      for (const auto& [interval, bytes] : checkpoints) {
        const auto from = decode(bytes, c.scene, c.request);
        ASSERT_TRUE(from) << from.error().message;
        EXPECT_EQ(encode(*from), bytes);
        const auto resumed = run(c.scene, c.cameras, c.request, {}, {}, *from);
        ASSERT_TRUE(resumed) << resumed.error().message;
        EXPECT_EQ(resumed->overlay, undisturbed->overlay) << interval;
        EXPECT_EQ(resumed->masks, undisturbed->masks) << interval;
        EXPECT_EQ(resumed->report.losses, undisturbed->report.losses) << interval;
      }
    }
}

TEST(Optimise, EndedInTheMiddleOfAnIntervalItGoesOnFromTheLastOneToTheSameBytes) {
  const Case c;
  std::map<int, std::string> all, until;
  const auto undisturbed = run(c.scene, c.cameras, c.request, {}, collecting(all));
  std::stop_source stop;
  Observer observer = collecting(until);
  observer.stop = stop.get_token();
  int iterations = 0;
  observer.progress = [&](const Progress& progress) {
    if (progress.interval == 2 && progress.loss && ++iterations == 9) stop.request_stop();
  };
  const auto ended = run(c.scene, c.cameras, c.request, {}, observer);
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::cancelled);
  EXPECT_EQ(iterations, 9) << "it ended at once";
  ASSERT_EQ(until.size(), 1u);
  const auto from = decode(until.at(1), c.scene, c.request);
  ASSERT_TRUE(from) << from.error().message;
  const auto resumed = run(c.scene, c.cameras, c.request, {}, {}, *from);
  EXPECT_EQ(resumed->overlay, undisturbed->overlay);
}

TEST(Optimise, AZeroDragGivesBackTheInputHoweverLongItIsToOptimise) {
  Case c;
  c.request.handles[0].target = c.request.handles[0].source;
  EXPECT_EQ(run(c.scene, c.cameras, c.request)->overlay, scene::no_change(c.scene));
}

TEST(Optimise, AZeroDragThatIsOptimisedByForceLooksLikeTheInput) {
  Case c;
  c.request.handles[0].target = c.request.handles[0].source;
  c.request.params.optimise_unmoved = true;
  c.request.params.iterations = 100;
  const auto outcome = run(c.scene, c.cameras, c.request);
  ASSERT_TRUE(outcome);
  ASSERT_EQ(outcome->views.size(), 3u);
  ASSERT_EQ(outcome->report.losses.size(), 2u);
  const scene::GaussianCloud after = scene::flatten(c.scene, outcome->overlay);
  for (std::size_t v = 0; v < outcome->views.size(); ++v) {
    ASSERT_GT(outcome->masks[v].area(), 0u);
    const scene::Image a = render::forward(c.scene, outcome->views[v]).color;
    const scene::Image b = render::forward(after, outcome->views[v]).color;
    EXPECT_GT(psnr_where(a, b, outcome->masks[v], 1), 55);
    EXPECT_GT(psnr_where(a, b, outcome->masks[v], 0), 55);
  }
}

/// Gives gradients that are not numbers.
class Poison final : public optim::PerceptualLoss {
 public:
  Result<double> evaluate(const scene::Image& rendered, const scene::Image&, scene::Image& v) override {
    v = scene::Image(rendered.width, rendered.height, 3, std::numeric_limits<float>::quiet_NaN());
    return 1.0;
  }
};

TEST(Optimise, APoisonedGradientEndsTheEditWithTheNameOfTheParameter) {
  const Case c;
  Poison poison;
  const auto outcome = run(c.scene, c.cameras, c.request, {.perceptual = &poison});
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::internal);
  EXPECT_TRUE(outcome.error().where.starts_with("gaussian[")) << outcome.error().where;
}

/// Fails as a library might.
class Failing final : public optim::PerceptualLoss {
 public:
  Result<double> evaluate(const scene::Image&, const scene::Image&, scene::Image&) override {
    return fail(ErrorCode::unavailable, "the loss is out of order", "loss");
  }
};

TEST(Optimise, AnErrorOfTheLossEndsTheEdit) {
  const Case c;
  Failing failing;
  const auto outcome = run(c.scene, c.cameras, c.request, {.perceptual = &failing});
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().where, "loss");
}

/// Of a network, which takes its time: asks three times within each evaluation.
class Slow final : public optim::PerceptualLoss {
 public:
  explicit Slow(std::string files) : files_(std::move(files)) {}
  Result<double> evaluate(const scene::Image& rendered, const scene::Image&, scene::Image& v) override {
    v = scene::Image(rendered.width, rendered.height, 3);
    ++evaluations;
    for (int k = 0; k < 3; ++k)
      if (auto going = going_on(); !going) return propagate(going);
    return 1.0;
  }
  [[nodiscard]] std::string identity() const override { return files_; }
  int evaluations = 0;

 private:
  std::string files_;
};

TEST(Optimise, AStopIsHeardWithinAnEvaluationOfTheLoss) {
  const Case c;
  Slow slow("a");
  std::stop_source stop;
  Observer observer;
  observer.stop = stop.get_token();
  int told = 0;  // with the first evaluation in work: once for the stage, and then by the loss
  observer.progress = [&](const Progress& progress) {
    if (progress.stage == Stage::optimise && ++told == 2) stop.request_stop();
  };
  const auto outcome = run(c.scene, c.cameras, c.request, {.perceptual = &slow}, observer);
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::cancelled);
  EXPECT_EQ(told, 2);
  EXPECT_EQ(slow.evaluations, 1);
  scene::Image gradient;
  EXPECT_TRUE(slow.evaluate(scene::Image(2, 2, 3), scene::Image(2, 2, 3), gradient)) << "nobody is asked any more";
}

TEST(Optimise, DoesNotGoOnWithAnotherLoss) {
  Case c;
  c.request.params.intervals = 2;
  std::string checkpoint;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    if (done.interval == 1) checkpoint = encode(done.state);
    return Result<void>{};
  };
  Slow before("a"), other("b");
  const auto undisturbed = run(c.scene, c.cameras, c.request, {.perceptual = &before}, observer);
  ASSERT_TRUE(undisturbed) << undisturbed.error().message;
  const auto go_on = [&](optim::PerceptualLoss* loss) {
    return run(c.scene, c.cameras, c.request, {.perceptual = loss}, {}, decode(checkpoint, c.scene, c.request).value());
  };
  const auto same = go_on(&before);
  ASSERT_TRUE(same) << same.error().message;
  EXPECT_EQ(same->overlay, undisturbed->overlay);
  for (optim::PerceptualLoss* loss :
       {static_cast<optim::PerceptualLoss*>(&other), static_cast<optim::PerceptualLoss*>(nullptr)}) {
    const auto mixed = go_on(loss);
    ASSERT_FALSE(mixed);
    EXPECT_EQ(mixed.error().code, ErrorCode::conflict);
    EXPECT_EQ(mixed.error().where, "checkpoint");
  }
}

TEST(Optimise, AnotherLossIsNoMatterWhereNothingIsLeftToDo) {
  Case c;
  c.request.params.intervals = 2;
  std::map<int, std::string> checkpoints;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    checkpoints[done.interval] = encode(done.state);
    return Result<void>{};
  };
  Slow before("a"), other("b");
  const auto undisturbed = run(c.scene, c.cameras, c.request, {.perceptual = &before}, observer);
  ASSERT_TRUE(undisturbed) << undisturbed.error().message;
  const auto end = [&](int interval, const Observer& asked) {
    return run(c.scene, c.cameras, c.request, {.perceptual = &other}, asked,
               decode(checkpoints.at(interval), c.scene, c.request).value());
  };
  const auto done = end(2, {});
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_EQ(done->overlay, undisturbed->overlay);
  Observer keeping;
  keeping.keep = [] { return true; };
  const auto kept = end(1, keeping);
  ASSERT_TRUE(kept) << kept.error().message;
  EXPECT_TRUE(kept->stopped_early);
  keeping.keep = [] { return false; };
  EXPECT_EQ(end(1, keeping).error().code, ErrorCode::conflict);
}

TEST(Optimise, ExtremeParametersEndInAResultOrInAnErrorThatNamesOne) {
  for (const float extreme : {1e30f, -1e30f, 3e38f, -3e38f}) {
    for (int parameter = 0; parameter < 4; ++parameter) {
      Case c;
      // Row 0 is dragged.
      if (parameter == 0) c.scene.opacity_logit[0] = extreme;
      if (parameter == 1) c.scene.log_scale.x[0] = extreme;
      if (parameter == 2) c.scene.rotation.w[0] = extreme;
      if (parameter == 3) c.scene.sh[0] = extreme;
      const auto outcome = run(c.scene, c.cameras, c.request);
      if (outcome) {
        EXPECT_FALSE(scene::first_not_finite(scene::flatten(c.scene, outcome->overlay))) << extreme << " " << parameter;
      } else {
        EXPECT_TRUE(outcome.error().where.starts_with("gaussian[")) << outcome.error().where;
      }
    }
  }
}

TEST(Optimise, RelocatesHandlesByWhatTheOptimisationDidToo) {
  Case c;
  c.request.params.intervals = 1;
  const auto with = run(c.scene, c.cameras, c.request);
  c.request.params.iterations = 0;
  const auto without = run(c.scene, c.cameras, c.request);
  const DVec3 a = with->report.handles[0].relocated[0], b = without->report.handles[0].relocated[0];
  EXPECT_NE(a, b);
  EXPECT_LT(glm::distance(a, b), 0.05);
}

/// A ball that has left: its copies stand beside its place, every other one of them trusted.
struct Left {
  scene::GaussianCloud input = ball_before_wall(60);
  std::vector<scene::Camera> views = arc_of_cameras(3, 64);
  std::vector<scene::Mask> masks = std::vector<scene::Mask>(3, scene::Mask(64, 64));
  working::WorkingScene working = left();
  std::vector<std::uint32_t> gone = working.rows_that_left(), copies = working.dragged_rows();
  std::vector<float> trust = std::vector<float>(working.size(), 0.0f);
  Params params;
  optim::MsSsimLoss perceptual;

  Left() {
    params.iterations = 6;
    for (scene::Mask& mask : masks) std::ranges::fill(mask.data, std::uint8_t{1});
    for (std::size_t k = 0; k < copies.size(); k += 2) trust[copies[k]] = 1;
  }

  [[nodiscard]] working::WorkingScene left() const {
    working::HandleColumn handle(input.size(), 0);
    for (std::size_t row = 0; row < input.size(); ++row) handle[row] = input.mean.z[row] < 1 ? 1 : 0;
    working::WorkingScene moved(input, working::Frame(), handle);
    const std::vector<std::uint32_t> rows = moved.dragged_rows();
    const std::uint32_t first =
        moved.append(input, rows, std::vector<working::Role>(rows.size(), working::Role::copy), rows);
    for (std::size_t row = first; row < moved.size(); ++row) moved.gaussians().mean.x[row] += 1.0f;
    for (const std::uint32_t row : rows) moved.leave_behind(row);
    return moved;
  }

  /// What view v shows without these rows.
  [[nodiscard]] scene::Image without(std::span<const std::uint32_t> rows, std::size_t v) const {
    render::Layers layers(working.cloud());
    layers.hidden = rows;
    return render::forward(layers, views[v]).color;
  }

  struct Losses {
    std::vector<double> each;
    std::optional<double> mean;
  };
  Losses optimised(const Goal& goal) {
    Losses losses;
    const auto advance = [&](const OptimiseProgress& at) {
      if (at.loss) losses.each.push_back(*at.loss);
      return Result<void>{};
    };
    losses.mean = optimise(working, input, views, masks, goal, params, {1, 1, 0.5, true}, perceptual, advance).value();
    return losses;
  }
};

std::optional<scene::Image> grey(std::size_t) { return scene::Image(64, 64, 3, 0.5f); }

TEST(Optimise, ChangesNeitherWhatIsTrustedNorWhatIsGone) {
  Left left;
  const scene::GaussianCloud before = left.working.cloud();
  EXPECT_EQ(left.optimised({grey, left.trust, left.gone}).each.size(), 6u);
  std::set<std::uint32_t> may_change;
  for (std::size_t k = 1; k < left.copies.size(); k += 2) may_change.insert(left.copies[k]);
  for (std::uint32_t row = 0; row < before.size(); ++row)
    EXPECT_EQ(same_row(left.working.cloud(), row, before, row), !may_change.contains(row)) << row;
  EXPECT_TRUE(left.working.check());
}

TEST(Optimise, WhatIsGoneDoesNotShow) {
  Left left;
  const auto bare = [&](std::size_t v) { return std::optional(left.without(left.gone, v)); };
  const double with_gone = Left().optimised({bare, left.trust, {}}).each.front();
  const double without = left.optimised({bare, left.trust, left.gone}).each.front();
  EXPECT_GT(with_gone, 0.005) << "the ball stands where it was";
  EXPECT_LT(without, 0.01 * with_gone) << "nothing but the rounding of a picture";
}

TEST(Optimise, NothingIsPulledAtWhereWhatIsGoneWas) {
  Left left;
  for (std::size_t v = 0; v < left.views.size(); ++v) {  // masks of the right side: of the copies, not of their place
    const scene::Camera& view = left.views[v];
    const double between = view.pixel_from_cam(view.cam_from_world(DVec3(0.5, 0, 0))).x;
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 64; ++x) left.masks[v].at(x, y) = x > between ? 1 : 0;
  }
  const scene::GaussianCloud before = left.working.cloud();
  const auto as_it_is = [](std::size_t) { return std::optional<scene::Image>(); };
  for (const double loss : left.optimised({as_it_is, left.trust, left.gone}).each) EXPECT_LT(loss, 1e-6);
  for (const std::uint32_t row : left.copies)
    EXPECT_LT(glm::distance(left.working.cloud().mean.get(row), before.mean.get(row)), 1e-4f) << row;
}

TEST(Optimise, WithNothingThatMayChangeNothingHappens) {
  Left left;
  std::ranges::fill(left.trust, 1.0f);
  const scene::GaussianCloud before = left.working.cloud();
  const Left::Losses losses = left.optimised({grey, left.trust, left.gone});
  EXPECT_TRUE(losses.each.empty());
  EXPECT_FALSE(losses.mean);
  ASSERT_EQ(left.working.size(), before.size());
  for (std::uint32_t row = 0; row < before.size(); ++row) EXPECT_TRUE(same_row(left.working.cloud(), row, before, row));
}

TEST(Optimise, ARowThatIsTrainedAloneStaysAtItsPlace) {  // its radius is 0
  Left left;
  std::ranges::fill(left.trust, 1.0f);
  const std::uint32_t alone = left.copies[left.copies.size() / 2];
  left.trust[alone] = 0;
  const Vec3 mean = left.working.cloud().mean.get(alone);
  EXPECT_TRUE(left.optimised({grey, left.trust, left.gone}).mean);
  EXPECT_EQ(left.working.cloud().mean.get(alone), mean);
  EXPECT_FALSE(scene::first_not_finite(left.working.cloud()));
}

}  // namespace
}  // namespace engine::edit
