// What has left its place in a move stays away: an optimisation brings nothing back that no picture asks for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/rng.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/edit/publish.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/likeness.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

/// A cloud of many Gaussians, each so faint that only all of them together show, before a wall that is seen whole.
struct FaintScene {
  static constexpr int faint_rows = 6000;
  scene::GaussianCloud cloud, wall;
  std::vector<scene::Camera> cameras = arc_of_cameras(6, 96);
  Request request;

  FaintScene() {
    constexpr float spacing = 0.09f;
    for (int i = -22; i <= 22; ++i)
      for (int j = -22; j <= 22; ++j) {
        const float shade = 0.3f + 0.2f * float((i + j) & 1);
        add_gaussian(wall, {spacing * float(i), spacing * float(j), 1}, {0.06f, 0.06f, 0.005f}, 4,
                     {shade, 0.5f, 0.9f - shade});
      }
    cloud = wall;
    Rng rng(5);
    for (int k = 0; k < faint_rows; ++k) {
      Vec3 at;
      do at = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
      while (glm::length(at) > 1);
      add_gaussian(cloud, 0.28f * at, {0.05f, 0.05f, 0.05f}, rng.uniform(-4, -2), {0.95f, 0.2f, 0.1f});
    }
    request.handles = {{DVec3(0), DVec3(0.9, 0, 0), 0.4, 0}};
    request.params.intervals = 1;
    request.params.iterations = 150;
    request.params.max_image_side = 96;
    request.params.views = 6;
  }
};

/// Least PSNR over the views between an outcome and the wall alone, where the faint cloud was.
double least_psnr_of_vacated(const FaintScene& faint, const Outcome& outcome) {
  double least = std::numeric_limits<double>::infinity();
  const scene::GaussianCloud after = scene::flatten(faint.cloud, outcome.overlay);
  for (const scene::Camera& view : outcome.views) {
    scene::Mask vacated(view.width, view.height);
    const DVec2 middle = view.pixel_from_cam(view.cam_from_world(DVec3(0)));
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x) vacated.at(x, y) = glm::distance(middle, DVec2(x, y)) < 8;
    least = std::min(
        least, psnr_where(render::forward(faint.wall, view).color, render::forward(after, view).color, vacated, 1));
  }
  return least;
}

TEST(Ghost, NothingComesBackThatThePicturesDoNotAskFor) {
  const FaintScene faint;
  FaintScene plain;
  plain.request.params.iterations = 0;
  const auto deformed = run(plain.cloud, plain.cameras, plain.request);
  ASSERT_TRUE(deformed);
  const double alone = least_psnr_of_vacated(plain, *deformed);
  correct::SceneCorrector corrector;
  for (correct::Corrector* const used :
       {static_cast<correct::Corrector*>(nullptr), static_cast<correct::Corrector*>(&corrector)}) {
    const auto optimised = run(faint.cloud, faint.cameras, faint.request, {.corrector = used});
    ASSERT_TRUE(optimised) << optimised.error().message;
    const auto& removed = optimised->overlay.removed;
    EXPECT_EQ(
        std::count_if(removed.begin(), removed.end(), [&](std::uint32_t row) { return row >= faint.wall.size(); }),
        FaintScene::faint_rows);
    EXPECT_GT(least_psnr_of_vacated(faint, *optimised), alone - 1) << "dB; 9 where they had come back";
  }
}

TEST(Ghost, ChildrenOfWhatHasLeftStayAwayToo) {
  FaintScene faint;
  faint.request.params.intervals = 2;
  faint.request.params.iterations = 200;  // enough for originals to be given children
  FaintScene plain;
  plain.request.params.iterations = 0;
  const auto deformed = run(plain.cloud, plain.cameras, plain.request);
  const auto optimised = run(faint.cloud, faint.cameras, faint.request);
  ASSERT_TRUE(deformed && optimised);
  EXPECT_GT(least_psnr_of_vacated(faint, *optimised), least_psnr_of_vacated(plain, *deformed) - 1);
}

TEST(Ghost, OnlyWhatHasClearlyRisenStays) {
  const FaintScene faint;
  working::WorkingScene working(faint.cloud, {}, working::HandleColumn(faint.cloud.size(), 1));
  std::vector<float>& logits = working.gaussians().opacity_logit;
  const auto leave_at = [&](std::uint32_t row, double opacity) {
    working.leave_behind(row);
    logits[row] = float(std::log(opacity / (1 - opacity)));
  };
  leave_at(0, 0.01), leave_at(1, 0.017), leave_at(2, 0.0499), leave_at(3, 0.0501), leave_at(4, 0.9);
  EXPECT_EQ(publish(working, faint.cloud, Mode::move).overlay.removed, (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_TRUE(publish(working, faint.cloud, Mode::extend).overlay.removed.empty());
  // A child of an original goes by the same rule.
  const std::vector<std::uint32_t> parents{0, 4};
  working.append(working.cloud(), parents, std::vector<working::Role>(2, working::Role::trail), parents);
  EXPECT_EQ(publish(working, faint.cloud, Mode::move).overlay.added(), 1u);
}

}  // namespace
}  // namespace engine::edit
