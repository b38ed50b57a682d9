#include "server/cli/bench_report.h"

#include <gtest/gtest.h>

#include "tests/support/data.h"

namespace server::cli {
namespace {

namespace captures = engine::captures;
namespace evaluate = engine::evaluate;

evaluate::Trial sample_trial() {
  evaluate::Trial trial;
  trial.name = "slide", trial.what = "A crate.", trial.corrector = "scene", trial.textured = false;
  trial.gaussians = 12, trial.part = 3, trial.seeds = 1, trial.intervals = 4;
  trial.untouched.edited = {20.1, 0.5, 7};
  trial.result.edited = {30.1, 0.25, 7};
  trial.result.vacated = {31.1, 0.125, 8};
  trial.result.arrived = {32.1, 0.75, 9};
  trial.result.outside = {33.1, 1, 10};
  trial.result.miss = 1e-9;
  trial.lpips = 0.1 + 0.2;  // of the untouched scene nobody has asked
  trial.corrected_views = {40, 11};
  trial.seconds = 0.1 + 0.2;
  trial.stages = {{engine::edit::Stage::views, 0.1}, {engine::edit::Stage::assign, 0.2}};
  trial.peak_memory_bytes = std::uint64_t{1} << 40;
  trial.warnings = {"one", "two"};
  return trial;
}

TEST(BenchReport, ATrialComesBackAsItWas) {
  const auto written = encode(sample_trial());
  evaluate::Trial read;
  decode(nlohmann::ordered_json::parse(written.dump()), read);
  EXPECT_EQ(encode(read).dump(), written.dump());
  EXPECT_EQ(read.seconds, 0.1 + 0.2);
  EXPECT_EQ(read.lpips, 0.1 + 0.2);
  EXPECT_EQ(read.untouched_lpips, std::nullopt);
  EXPECT_EQ(read.stages.front().stage, engine::edit::Stage::views);
}

TEST(BenchReport, ATripComesBackAsItWas) {
  const evaluate::TripTrial trip{.request = "ear_up",
                                 .corrector = "none",
                                 .arrived = 0.9,
                                 .inside = {30, 0.5, 3},
                                 .outside = {40, 1, 4},
                                 .zero_drag = {50, 1, 5},
                                 .cameras = 6,
                                 .seconds = 1.5};
  const auto written = encode(trip);
  evaluate::TripTrial read;
  decode(nlohmann::ordered_json::parse(written.dump()), read);
  EXPECT_EQ(encode(read).dump(), written.dump());
  EXPECT_EQ(read.request, "ear_up");
}

captures::CaptureTrial sample_capture() {
  captures::CaptureTrial capture;
  capture.trial = sample_trial();
  capture.is_test = true, capture.by = "clicks", capture.said = "Nearly.";
  capture.deformed.edited = {25.5, 0.5, 7}, capture.ceiling.edited = {40.1, 0.5, 7};
  capture.untouched_beyond_db = 19, capture.deformed_beyond_db = 20;
  capture.result_beyond_db = 21, capture.ceiling_beyond_db = 22;
  capture.match = {.recall = 0.75, .precision = 0.5};
  capture.fit_seconds = 61.5;
  return capture;
}

TEST(BenchReport, ACaptureComesBackAsItWas) {
  const auto written = encode(sample_capture());
  captures::CaptureTrial read;
  decode(nlohmann::ordered_json::parse(written.dump()), read);
  EXPECT_EQ(encode(read).dump(), written.dump());
  EXPECT_TRUE(read.is_test);
  EXPECT_EQ(read.trial.name, "slide");
  EXPECT_DOUBLE_EQ(written.at("gain_db"), 30.1 - 25.5);
  EXPECT_DOUBLE_EQ(written.at("share_of_ceiling"), (30.1 - 20.1) / (40.1 - 20.1));
}

TEST(BenchReport, ACaptureWithoutAWayToItsCeilingHasNoShareOfIt) {
  captures::CaptureTrial capture = sample_capture();
  capture.ceiling.edited.psnr_db = 10;
  EXPECT_TRUE(encode(capture).at("share_of_ceiling").is_null());
  captures::CaptureTrial read;
  decode(encode(capture), read);
  EXPECT_EQ(encode(read).dump(), encode(capture).dump());
}

TEST(BenchReport, HasTheFieldsThatOthersRead) {
  const auto written = encode(sample_trial());
  std::vector<std::string> names;
  for (const auto& [name, value] : written.items()) names.push_back(name);
  EXPECT_EQ(names, (std::vector<std::string>{"case", "what", "corrector", "textured", "gaussians", "part", "seeds",
                                             "uncovered", "open", "intervals", "untouched", "result", "untouched_lpips",
                                             "lpips", "corrected_views_agree", "seconds", "stages", "peak_memory_bytes",
                                             "warnings"}));
}

TEST(CachedResult, IsNotFoundAgain) {
  const support::TempDir folder;
  const auto file = folder.path() / "slide.json";
  int found = 0;
  const auto find = [&]() -> engine::Result<evaluate::Trial> {
    ++found;
    return sample_trial();
  };
  ASSERT_TRUE(cached_or_new<evaluate::Trial>(file, find));
  const auto again = cached_or_new<evaluate::Trial>(file, find);
  ASSERT_TRUE(again);
  EXPECT_EQ(encode(*again).dump(), encode(sample_trial()).dump());
  EXPECT_EQ(found, 1);
}

TEST(CachedResult, ThatIsDamagedIsFoundAgain) {
  const support::TempDir folder;
  const auto file = folder.path() / "slide.json";
  ASSERT_TRUE(write_json(file, encode(sample_trial())));
  const std::string whole = support::read_file(file);
  for (const std::string& bytes :
       {std::string(), whole.substr(0, whole.size() / 2), std::string("{}"), std::string("[1]"), std::string("null")}) {
    support::write_file(file, bytes);
    EXPECT_FALSE(cached_result<evaluate::Trial>(file)) << bytes;
  }
  support::write_file(file, whole);
  EXPECT_TRUE(cached_result<evaluate::Trial>(file));
}

TEST(CachedResult, IsNotMadeOfAFailure) {
  const support::TempDir folder;
  const auto file = folder.path() / "slide.json";
  const auto failed = cached_or_new<evaluate::Trial>(
      file, []() -> engine::Result<evaluate::Trial> { return engine::fail(engine::ErrorCode::cancelled, "stopped"); });
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, engine::ErrorCode::cancelled);
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace server::cli
