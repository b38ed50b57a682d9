#include "server/edits/record_keeper.h"

#include <gtest/gtest.h>

#include <vector>

namespace server::edits {
namespace {

using namespace std::chrono_literals;
using engine::edit::Progress;

class RecordKeeperTest : public testing::Test {
 protected:
  proto::EditRecord published() { return proto::parse_edit_record(texts.back()).value(); }
  RecordKeeper keeper_of(proto::EditRecord record = {}) {
    return RecordKeeper(
        std::move(record), [this](std::string text) { texts.push_back(std::move(text)); }, [this] { return now; });
  }
  double timing(const std::string& stage) {
    for (const auto& known : published().timings)
      if (known.stage == stage) return known.seconds;
    return -1;
  }

  std::chrono::steady_clock::time_point now{};
  std::vector<std::string> texts;
};

TEST_F(RecordKeeperTest, TellsEveryNewStageAndIntervalAtOnceAndTheRestTenTimesASecond) {
  auto keeper = keeper_of();
  keeper.advance({.interval = 1, .intervals = 2, .stage = engine::edit::Stage::mask, .fraction = 0.1});
  EXPECT_EQ(texts.size(), 1u);
  now += 50ms;
  keeper.advance({.interval = 1, .intervals = 2, .stage = engine::edit::Stage::mask, .fraction = 0.2});
  EXPECT_EQ(texts.size(), 1u);
  now += 60ms;
  keeper.advance({.interval = 1, .intervals = 2, .stage = engine::edit::Stage::mask, .fraction = 0.3});
  EXPECT_EQ(texts.size(), 2u);
  keeper.advance({.interval = 1, .intervals = 2, .stage = engine::edit::Stage::relocate, .fraction = 0.3});
  EXPECT_EQ(texts.size(), 3u);
  keeper.advance({.interval = 2, .intervals = 2, .stage = engine::edit::Stage::relocate, .fraction = 0.3});
  EXPECT_EQ(texts.size(), 4u);
  EXPECT_EQ(published().interval, 2);
  EXPECT_EQ(published().intervals, 2);
  EXPECT_EQ(published().stage, "relocate");
}

TEST_F(RecordKeeperTest, SumsTheTimeOfEachStage) {
  auto keeper = keeper_of();
  keeper.enter(JobStage::load);
  now += 2s;
  keeper.advance({.stage = engine::edit::Stage::mask});
  now += 1s;
  keeper.advance({.stage = engine::edit::Stage::pictures});
  now += 4s;
  keeper.advance({.stage = engine::edit::Stage::mask});
  now += 1s;
  keeper.finish();
  EXPECT_DOUBLE_EQ(timing("load"), 2);
  EXPECT_DOUBLE_EQ(timing("mask"), 2);
  EXPECT_DOUBLE_EQ(timing("pictures"), 4);
  EXPECT_EQ(published().timings.size(), 3u);
}

TEST_F(RecordKeeperTest, GoesOnWithTheTimesAndTheProgressOfAnEarlierRun) {
  proto::EditRecord earlier;
  earlier.stage = "mask";
  earlier.progress = 0.7;
  earlier.eta_seconds = 3;
  earlier.timings = {{"mask", 5}};
  auto keeper = keeper_of(earlier);
  now += 100s;  // nobody worked on it meanwhile
  keeper.enter(JobStage::load);
  EXPECT_EQ(published().eta_seconds, std::nullopt);
  keeper.advance({.interval = 3, .stage = engine::edit::Stage::mask, .fraction = 0.5});
  EXPECT_EQ(published().progress, 0.7) << "it never falls";
  now += 1s;
  keeper.advance({.interval = 3, .stage = engine::edit::Stage::mask, .fraction = 0.8});
  EXPECT_EQ(published().progress, 0.8);
  EXPECT_DOUBLE_EQ(timing("mask"), 6);
}

TEST_F(RecordKeeperTest, TellsTheTimeLeftOfTheEditAndWhatComesAfterIt) {
  auto keeper = keeper_of();
  keeper.expect_after(0.5);
  keeper.advance({.interval = 0, .stage = engine::edit::Stage::assign, .fraction = 0});
  EXPECT_EQ(published().eta_seconds, std::nullopt) << "nobody knows yet";
  keeper.advance({.interval = 0, .stage = engine::edit::Stage::views, .fraction = 0, .seconds_left = 6.24});
  EXPECT_DOUBLE_EQ(*published().eta_seconds, 6.7);
  keeper.advance({.interval = 1, .stage = engine::edit::Stage::mask, .fraction = 0.4, .seconds_left = 0});
  EXPECT_DOUBLE_EQ(*published().eta_seconds, 0.5);
  keeper.enter(JobStage::publish);
  EXPECT_DOUBLE_EQ(*published().eta_seconds, 0.5);
  keeper.finish();
  EXPECT_EQ(published().eta_seconds, std::nullopt);
}

TEST_F(RecordKeeperTest, TellsIterationAndLossAsLongAsItOptimises) {
  proto::EditRecord earlier;
  earlier.iteration = 9;
  earlier.loss = 3;
  auto keeper = keeper_of(earlier);
  keeper.enter(JobStage::load);
  EXPECT_EQ(published().iteration, 0) << "what it was at when it was interrupted";
  EXPECT_EQ(published().loss, std::nullopt);
  for (int i = 1; i <= 3; ++i) {
    now += 101ms;
    keeper.advance({.interval = 1,
                    .intervals = 2,
                    .stage = engine::edit::Stage::optimise,
                    .fraction = 0.1 * i,
                    .iteration = i,
                    .iterations = 3,
                    .loss = 1.0 / i});
    EXPECT_EQ(published().iteration, i);
    EXPECT_EQ(published().loss, 1.0 / i);
  }
  keeper.advance(
      {.interval = 1, .intervals = 2, .stage = engine::edit::Stage::relocate, .fraction = 0.4, .iterations = 3});
  EXPECT_EQ(published().iteration, 0);
  EXPECT_EQ(published().loss, std::nullopt);
}

TEST_F(RecordKeeperTest, OnlyTheEndIsOne) {
  auto keeper = keeper_of();
  keeper.advance({.interval = 1, .stage = engine::edit::Stage::finish, .fraction = 1});
  EXPECT_LT(published().progress, 1);
  keeper.finish();
  EXPECT_EQ(published().progress, 1);
  EXPECT_EQ(published().stage, "");
}

TEST_F(RecordKeeperTest, AnIntervalDoneAgainReplacesItsRecord) {
  auto keeper = keeper_of();
  keeper.add({.interval = 1, .seconds = 1, .positions = {}, .loss = {}, .renders = {}});
  keeper.add({.interval = 2, .seconds = 2, .positions = {}, .loss = {}, .renders = {}});
  keeper.add({.interval = 1, .seconds = 3, .positions = {}, .loss = {}, .renders = {}});
  keeper.publish();
  ASSERT_EQ(published().finished_intervals.size(), 2u);
  EXPECT_EQ(published().finished_intervals[0].seconds, 3);
  EXPECT_EQ(published().finished_intervals[1].interval, 2);
}

TEST_F(RecordKeeperTest, SaysAWarningOnce) {
  auto keeper = keeper_of();
  for (const char* warning : {"a", "b", "a"}) keeper.warn(warning);
  keeper.publish();
  EXPECT_EQ(published().warnings, (std::vector<std::string>{"a", "b"}));
}

}  // namespace
}  // namespace server::edits
