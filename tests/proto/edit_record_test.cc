#include "proto/edit_record.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/proto/examples.h"

namespace proto {
namespace {

EditRecord full_record() {
  EditRecord record;
  record.stage = "mask";
  record.progress = 0.1 + 0.2;  // not a short decimal
  record.eta_seconds = 12.5;
  record.interval = 2;
  record.intervals = 3;
  record.iteration = 17;
  record.loss = 1.0 / 7;
  record.finished_intervals = {{.interval = 1,
                                .seconds = 0.25,
                                .positions = {{1.0 / 3, 2, -3e-7}, {4, 5, 6}},
                                .loss = 0.5,
                                .renders = {{"a \"quoted\".jpg", {"before", "deformed"}}}}};
  record.handles = {{12}, {34}};
  record.request = parse_edit_request(example("move_ball.json")).value();
  record.timings = {{"assign", 0.125}, {"mask", 2}};
  record.gaussians = GaussianCounts{1, 2, 3, 4, 5, 6, 7};
  record.uncovered = {{"0001.jpg", 0.25, 0.125, {{0.5, 0.25, 0.75, 1}}}, {"0002.jpg", 0.5, 0, {}}};
  record.parts = {{1, "one_piece", "it only stands next to what stays", 0.25}};
  record.warnings = {"careful"};
  record.result_version = 7;
  record.simd = "AVX2";
  return record;
}

TEST(EditRecord, ComesBackAsItWasWritten) {
  const std::string text = to_json(full_record());
  const auto back = parse_edit_record(text);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->progress, 0.1 + 0.2);
  EXPECT_EQ(back->finished_intervals.at(0).positions.at(0), (Point{1.0 / 3, 2, -3e-7}));
  EXPECT_EQ(back->finished_intervals.at(0).renders.at(0).view, "a \"quoted\".jpg");
  EXPECT_EQ(back->request, full_record().request);
  EXPECT_EQ(back->gaussians->changeable, 5u);
  EXPECT_EQ(to_json(*back), text) << "every field";
}

TEST(EditRecord, OfAnEarlierVersionHasNoPartThatIsSetDown) {
  nlohmann::json written = nlohmann::json::parse(to_json(full_record()));
  written.at("parts").at(0).erase(3);
  const auto back = parse_edit_record(written.dump());
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->parts.at(0).why, "it only stands next to what stays");
  EXPECT_EQ(back->parts.at(0).settled, 0);
}

TEST(EditRecord, OfARemovalOfWhatIsSelectedComesBackWithoutItsSelection) {
  EditRecord record = full_record();
  record.request->mode = Mode::remove;
  record.request->handles.clear();
  const auto back = parse_edit_record(to_json(record));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->request, record.request);
  EXPECT_EQ(back->result_version, 7);
}

TEST(EditRecord, OfAnEditThatHasJustBegunIsMostlyEmpty) {
  const auto back = parse_edit_record(to_json(EditRecord{}));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(to_json(*back), to_json(EditRecord{}));
  EXPECT_EQ(back->eta_seconds, std::nullopt);
  EXPECT_EQ(back->request, std::nullopt);
  EXPECT_EQ(back->result_version, std::nullopt);
}

TEST(EditRecord, WhatIsCutShortOrNotOneIsCorrupt) {
  const std::string text = to_json(full_record());
  for (std::size_t length = 0; length < text.size(); ++length) {
    const auto back = parse_edit_record(text.substr(0, length));
    ASSERT_FALSE(back) << length;
    ASSERT_EQ(back.error().code, engine::ErrorCode::corrupt_data) << length;
  }
  for (const char* other : {"[]", "{}", "3", R"({"stage": 3})"}) EXPECT_FALSE(parse_edit_record(other)) << other;
}

}  // namespace
}  // namespace proto
