#include "server/edits/estimate.h"

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/engine/edit/samples.h"

namespace server::edits {
namespace {

using engine::DVec3;

JobWorkload typical() {
  JobWorkload work;
  work.row_bytes = 152, work.copies = 6000;
  work.edit.gaussians = 150'000, work.edit.dragged = 6000;
  work.edit.intervals = 4, work.edit.iterations = 100, work.edit.corrected = true;
  work.edit.candidates = 40, work.edit.views = 40, work.edit.view_pixels = 512 * 384;
  work.edit.shown = true, work.edit.pictured = 4, work.edit.kept = true;
  work.edit.frame = {3e-3, 1e-8};
  return work;
}

TEST(Estimate, GrowsWithEverythingThatTakesMemory) {
  struct Growth {
    std::string what;
    std::function<void(JobWorkload&)> grow;
    bool takes_memory;
  };
  const std::vector<Growth> growths = {
      {"gaussians", [](JobWorkload& w) { w.edit.gaussians *= 2; }, true},
      {"row bytes", [](JobWorkload& w) { w.row_bytes *= 2; }, true},
      {"layered", [](JobWorkload& w) { w.layered = true; }, true},
      {"dragged", [](JobWorkload& w) { w.edit.dragged *= 2; }, false},
      {"copies", [](JobWorkload& w) { w.copies *= 2; }, true},
      {"intervals", [](JobWorkload& w) { ++w.edit.intervals; }, true},
      {"candidates", [](JobWorkload& w) { ++w.edit.candidates; }, true},
      {"candidates beyond those that are kept", [](JobWorkload& w) { w.edit.candidates = 5000; }, true},
      {"views", [](JobWorkload& w) { ++w.edit.views; }, true},
      {"pictures", [](JobWorkload& w) { ++w.edit.pictured; }, false},
      {"iterations", [](JobWorkload& w) { w.edit.iterations *= 2; }, false},
      {"corrections", [](JobWorkload& w) { ++w.edit.corrections; }, false},
      {"a network that compares",
       [](JobWorkload& w) {
         add_models(w, {{}, models::PerceptualCost{1e-5, 1, 1}});
       },
       true},
      {"picture size", [](JobWorkload& w) { w.edit.view_pixels *= 2; }, true},
      {"a slower machine", [](JobWorkload& w) { w.edit.frame.gaussians *= 2; }, false}};
  for (const Growth& growth : growths) {
    SCOPED_TRACE(growth.what);
    JobWorkload more = typical();
    growth.grow(more);
    EXPECT_EQ(estimated_bytes(more) > estimated_bytes(typical()), growth.takes_memory);
    EXPECT_GE(estimated_bytes(more), estimated_bytes(typical()));
    EXPECT_GE(estimated_seconds(more), estimated_seconds(typical()));
  }
}

TEST(Estimate, OfManyCamerasOnlySomeAreKept) {
  JobWorkload many = typical(), more = typical();
  many.edit.candidates = 1000, more.edit.candidates = 100'000;
  EXPECT_EQ(estimated_bytes(many), estimated_bytes(more));
  EXPECT_LT(estimated_bytes(many) - estimated_bytes(typical()), 100'000'000u);
}

TEST(Estimate, TheTimeOfAJobIsThatOfTheEditAndWhatComesBeforeAndAfter) {
  JobWorkload work = typical();
  const double of_edit = seconds_of(engine::edit::plan_of(work.edit));
  EXPECT_DOUBLE_EQ(estimated_seconds(work), seconds_to_load(150'000, false) + of_edit + seconds_to_publish(150'000));
  work.layered = true;
  EXPECT_GT(estimated_seconds(work), seconds_to_load(150'000, false) + of_edit + seconds_to_publish(150'000));
}

TEST(Estimate, TakesThePreviewForATrialOfTheDragWhateverElseGoesOn) {
  namespace edit = engine::edit;
  const engine::scene::LayeredCloud version{
      std::make_shared<const engine::scene::GaussianCloud>(edit::ball_before_wall(200)), nullptr};
  edit::Request request;
  request.handles = {{DVec3(0), DVec3(0.5, 0, 0), 0.3, 0}};
  request.params.views = 2, request.params.max_image_side = 48;
  auto preview = edit::preview(version, request);
  ASSERT_TRUE(preview);
  preview->assign_seconds = 4, preview->drag_seconds = 8;
  double slowness = 1;
  SpeedLog log([&] { return slowness; });
  const auto seconds = [&] {
    const edit::Workload work = workload_of(version, request, *preview, {}, false, 0, "scene", log).edit;
    return std::pair(work.assign_seconds, work.drag_seconds);
  };
  EXPECT_EQ(seconds(), std::pair(4.0, 8.0));
  slowness = 4;
  EXPECT_EQ(seconds(), std::pair(1.0, 2.0)) << "it was slowed down as the yardstick is";
}

TEST(Estimate, MemoryHoldsTheWorkingCopyAndAPicturesScene) {
  JobWorkload work = typical();
  EXPECT_GE(estimated_bytes(work), 2 * work.edit.gaussians * work.row_bytes);
  const auto flat = estimated_bytes(work);
  work.layered = true;
  EXPECT_EQ(estimated_bytes(work) - flat, work.edit.gaussians * work.row_bytes);
}

TEST(Estimate, AnOptimisationHoldsEveryViewItSetsUp) {
  JobWorkload work = typical();
  work.edit.iterations = 0;
  work.edit.corrected = false;
  const auto plain = estimated_bytes(work);
  work.edit.iterations = 1;
  EXPECT_GE(estimated_bytes(work) - plain, work.edit.views * (36 * work.edit.view_pixels + 24 * work.edit.gaussians));
}

TEST(Estimate, ACorrectionHoldsTheUneditedScene) {
  JobWorkload work = typical();
  work.edit.corrected = false;
  const auto plain = estimated_bytes(work);
  work.edit.corrected = true;
  EXPECT_GE(estimated_bytes(work) - plain,
            work.edit.views * (16 + 1 + 12) * work.edit.view_pixels + work.edit.gaussians * work.row_bytes);
}

}  // namespace
}  // namespace server::edits
