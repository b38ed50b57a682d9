#include "server/edits/estimate.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace server::edits {
namespace {

Workload typical() {
  return {.gaussians = 150'000,
          .row_bytes = 152,
          .layered = false,
          .dragged = 6000,
          .copies = 6000,
          .intervals = 4,
          .iterations = 100,
          .rounds = 1,
          .corrected = true,
          .candidates = 40,
          .candidate_pixels = 640 * 480,
          .virtual_views = false,
          .views = 40,
          .pictured = 4,
          .view_pixels = 512 * 384,
          .probe_seconds = 0.01,
          .probe_pixels = 256 * 192};
}

TEST(Estimate, GrowsWithEverythingThatCosts) {
  struct Growth {
    std::string what;
    std::function<void(Workload&)> grow;
    bool takes_time, takes_memory;
  };
  const std::vector<Growth> growths = {
      {"gaussians, which the probe renders", [](Workload& w) { w.gaussians *= 2, w.probe_seconds *= 2; }, true, true},
      {"row bytes", [](Workload& w) { w.row_bytes *= 2; }, false, true},
      {"layered", [](Workload& w) { w.layered = true; }, true, true},
      {"dragged", [](Workload& w) { w.dragged *= 2; }, true, false},
      {"copies", [](Workload& w) { w.copies *= 2; }, false, true},
      {"intervals", [](Workload& w) { ++w.intervals; }, true, true},
      {"candidates", [](Workload& w) { ++w.candidates; }, true, false},
      {"virtual views", [](Workload& w) { w.virtual_views = true; }, true, false},
      {"views", [](Workload& w) { ++w.views; }, true, true},
      {"pictures", [](Workload& w) { ++w.pictured; }, true, false},
      {"iterations", [](Workload& w) { w.iterations *= 2; }, true, false},
      {"rounds", [](Workload& w) { ++w.rounds; }, true, false},
      {"candidates' size", [](Workload& w) { w.candidate_pixels *= 2; }, true, false},
      {"picture size", [](Workload& w) { w.view_pixels *= 2; }, true, true},
      {"a slower machine", [](Workload& w) { w.probe_seconds *= 2; }, true, false}};
  for (const Growth& growth : growths) {
    SCOPED_TRACE(growth.what);
    Workload more = typical();
    growth.grow(more);
    EXPECT_EQ(estimated_seconds(more) > estimated_seconds(typical()), growth.takes_time);
    EXPECT_GE(estimated_seconds(more), estimated_seconds(typical()));
    EXPECT_EQ(estimated_bytes(more) > estimated_bytes(typical()), growth.takes_memory);
    EXPECT_GE(estimated_bytes(more), estimated_bytes(typical()));
  }
}

TEST(Estimate, AFrameCostsWhatTheProbeSaysAtItsSizeAndGrowsWithPixels) {
  const Workload work = typical();
  EXPECT_DOUBLE_EQ(frame_seconds(work, work.probe_pixels), work.probe_seconds);
  EXPECT_GT(frame_seconds(work, 2 * work.probe_pixels), work.probe_seconds);
  EXPECT_LT(frame_seconds(work, 2 * work.probe_pixels), 2 * work.probe_seconds);
  EXPECT_EQ(frame_seconds({}, 1000), 0);
}

TEST(Estimate, MemoryHoldsTheWorkingCopyAndAPicturesScene) {
  Workload work = typical();
  EXPECT_GE(estimated_bytes(work), 2 * work.gaussians * work.row_bytes);
  const auto flat = estimated_bytes(work);
  work.layered = true;
  EXPECT_EQ(estimated_bytes(work) - flat, work.gaussians * work.row_bytes);
}

TEST(Estimate, AnOptimisationHoldsEveryViewItSetsUp) {
  Workload work = typical();
  work.iterations = 0;
  work.corrected = false;
  const auto plain = estimated_bytes(work);
  work.iterations = 1;
  const auto one = estimated_bytes(work);
  const double seconds = estimated_seconds(work);
  EXPECT_GE(one - plain, work.views * (36 * work.view_pixels + 24 * work.gaussians));
  EXPECT_GE(seconds, work.intervals * double(work.views) * frame_seconds(work, work.view_pixels));
  work.iterations = 1000;
  EXPECT_EQ(estimated_bytes(work), one) << "more iterations take more time, not more memory";
  EXPECT_GT(estimated_seconds(work), seconds);
}

TEST(Estimate, AnIterationCostsAFrameAtMostAndMoreWhereMoreIsDragged) {
  Workload work = typical();
  const auto seconds_of = [&work](std::size_t dragged, std::size_t iterations) {
    work.dragged = dragged;
    work.iterations = iterations;
    return estimated_seconds(work);
  };
  const double frame = frame_seconds(work, work.view_pixels);
  double last = 0;
  for (const std::size_t dragged : {std::size_t{0}, work.gaussians / 100, work.gaussians / 20, work.gaussians}) {
    const double each = (seconds_of(dragged, 1100) - seconds_of(dragged, 100)) / (1000.0 * work.intervals);
    EXPECT_GT(each, last);
    EXPECT_LE(each, frame * (1 + 1e-9));
    last = each;
  }
}

TEST(Estimate, ACorrectionHoldsTheUneditedSceneAndLooksAtEveryView) {
  Workload work = typical();
  work.corrected = false;
  const auto plain = estimated_bytes(work);
  const double seconds = estimated_seconds(work);
  work.corrected = true;
  const auto one = estimated_bytes(work);
  const double once = estimated_seconds(work);
  EXPECT_GE(one - plain, work.views * (16 + 1 + 12) * work.view_pixels + work.gaussians * work.row_bytes);
  // Two frames of each view in each interval, and one of each camera and view before the first.
  const double frames = frame_seconds(work, work.view_pixels) * double(work.views);
  EXPECT_GE(once - seconds, (2 * work.intervals + 1) * frames);
  work.rounds = 3;
  EXPECT_EQ(estimated_bytes(work), one) << "more corrections take more time, not more memory";
  EXPECT_GE(estimated_seconds(work) - once, 2 * 2 * work.intervals * frames);
  work.intervals *= 2;
  EXPECT_GE(estimated_seconds(work) - once, 5 * 2 * double(work.intervals) / 2 * frames);
}

}  // namespace
}  // namespace server::edits
