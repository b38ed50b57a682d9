#include "proto/edit_status.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/proto/examples.h"

namespace proto {
namespace {

using nlohmann::json;

EditRequest some_request() {
  auto request = parse_edit_request(example("stretch_apple.json")).value();
  request.scene = "s000001";
  request.version = 0;
  return request;
}

EditStatus queued() {
  EditStatus status;
  status.id = "e000001";
  status.scene = "s000001";
  status.state = "queued";
  status.queue_position = 2;
  status.request = some_request();
  status.created = "2026-11-21T11:09:38.123Z";
  return status;
}

EditStatus succeeded() {
  EditStatus status = queued();
  status.version = 1;
  status.state = "succeeded";
  status.stopped_early = true;
  status.queue_position = std::nullopt;
  status.progress = 1;
  status.interval = status.intervals = 5;
  status.finished_intervals = {{.interval = 1,
                                .seconds = 0.5,
                                .positions = {{1, 2, 3}},
                                .loss = {},
                                .renders = {{"0001.jpg", {"before", "deformed"}}, {"0002.jpg", {"before"}}}}};
  status.handles = {{17}};
  status.timings = {{"mask", 1.5}};
  status.gaussians = GaussianCounts{10, 12, 1, 3, 4, 5, 6};
  status.uncovered = {{"0001.jpg", 0.25, 0.125, {{0.5, 0.25, 0.75, 1}}}, {"0002.jpg", 0.5, 0, {}}};
  status.warnings = {"careful"};
  status.result_version = 2;
  status.started = "2026-11-21T11:09:39.000Z";
  status.ended = "2026-11-21T11:09:40.000Z";
  status.simd = "AVX2";
  return status;
}

TEST(EditStatus, OfAWaitingEditHasEveryFieldAndNullsWhereNothingIsKnown) {
  const json edit = json::parse(to_json(queued()));
  EXPECT_EQ(edit.at("id"), "e000001");
  EXPECT_EQ(edit.at("scene"), "s000001");
  EXPECT_EQ(edit.at("version"), 0);
  EXPECT_EQ(edit.at("state"), "queued");
  EXPECT_EQ(edit.at("stopped_early"), false);
  EXPECT_EQ(edit.at("queue_position"), 2);
  EXPECT_EQ(edit.at("iteration"), 0);
  EXPECT_EQ(edit.at("iterations"), 0);
  for (const char* name :
       {"stage", "eta_seconds", "loss", "gaussians", "result_version", "error", "started", "ended", "simd"})
    EXPECT_TRUE(edit.at(name).is_null()) << name;
  for (const char* name : {"finished_intervals", "handles", "parts", "timings", "uncovered", "warnings"})
    EXPECT_EQ(edit.at(name), json::array()) << name;
  EXPECT_EQ(edit.at("created"), "2026-11-21T11:09:38.123Z");
  EXPECT_EQ(edit.at("links"), json::parse(R"({"self": "/v1/edits/e000001", "events": "/v1/edits/e000001/events",
    "stop": "/v1/edits/e000001/stop", "cancel": "/v1/edits/e000001/cancel", "scene": "/v1/scenes/s000001",
    "result": null, "file": null})"));
}

TEST(EditStatus, EchoesTheRequestSoThatItCanBeSentAgain) {
  const json edit = json::parse(to_json(queued()));
  const auto again = parse_edit_request(edit.at("request").dump());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(*again, some_request());
}

TEST(EditStatus, OfASuccessLinksItsResultAndItsPictures) {
  const json edit = json::parse(to_json(succeeded()));
  EXPECT_EQ(edit.at("result_version"), 2);
  EXPECT_EQ(edit.at("links").at("result"), "/v1/scenes/s000001/versions/2");
  EXPECT_EQ(edit.at("links").at("file"), "/v1/scenes/s000001/versions/2/file?format=ply");
  EXPECT_EQ(edit.at("finished_intervals"), json::parse(R"([{"interval": 1, "seconds": 0.5, "positions": [[1,2,3]],
    "loss": null, "renders": [
      {"view": "0001.jpg", "stages": {"before": "/v1/edits/e000001/intervals/1/renders/0?stage=before",
                                      "deformed": "/v1/edits/e000001/intervals/1/renders/0?stage=deformed"}},
      {"view": "0002.jpg", "stages": {"before": "/v1/edits/e000001/intervals/1/renders/1?stage=before"}}]}])"));
  EXPECT_EQ(edit.at("handles"), json::parse(R"([{"gaussians": 17}])"));
  EXPECT_EQ(edit.at("timings"), json::parse(R"([{"stage": "mask", "seconds": 1.5}])"));
  EXPECT_EQ(edit.at("gaussians"),
            json::parse(
                R"({"input": 10, "output": 12, "removed": 1, "copies": 3, "changeable": 4, "crumbs": 5, "relit": 6})"));
  EXPECT_EQ(edit.at("uncovered"), json::parse(R"([
    {"view": "0001.jpg", "area": 0.25, "open": 0.125, "open_box": [0.5, 0.25, 0.75, 1.0]},
    {"view": "0002.jpg", "area": 0.5, "open": 0.0, "open_box": null}])"));
  EXPECT_EQ(edit.at("simd"), "AVX2");
  EXPECT_EQ(edit.at("stopped_early"), true);
}

TEST(EditStatus, OfAnOptimisationSaysHowFarItIsAndWhatItsLossIs) {
  EditStatus status = queued();
  status.state = "running";
  status.iteration = 17;
  status.iterations = 200;
  status.loss = 0.25;
  const json edit = json::parse(to_json(status));
  EXPECT_EQ(edit.at("iteration"), 17);
  EXPECT_EQ(edit.at("iterations"), 200);
  EXPECT_EQ(edit.at("loss"), 0.25);
}

TEST(EditStatus, OfAFailureSaysWhatAndWhere) {
  EditStatus status = queued();
  status.state = "failed";
  status.error = engine::Error{engine::ErrorCode::unprocessable, "0 Gaussians", "handles[2].radius"};
  EXPECT_EQ(json::parse(to_json(status)).at("error"),
            json::parse(R"({"code": "unprocessable", "detail": "0 Gaussians", "where": "handles[2].radius"})"));
}

TEST(EditStatus, IsOneLineWhateverIsInIt) {
  EditStatus status = succeeded();
  status.warnings = {"two\nlines", "no UTF-8: \xff"};
  const std::string text = to_json(status);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  EXPECT_EQ(json::parse(text).at("warnings").at(0), "two\nlines");
}

TEST(EditStatus, AListKeepsItsOrder) {
  const json list = json::parse(to_json(std::vector{succeeded(), queued()}));
  ASSERT_EQ(list.at("edits").size(), 2u);
  EXPECT_EQ(list.at("edits").at(0).at("state"), "succeeded");
  EXPECT_EQ(json::parse(to_json(std::vector<EditStatus>{})), json::parse(R"({"edits": []})"));
}

TEST(EditEstimate, SaysWhatTheEditWouldCost) {
  const EditEstimate estimate{.handles = {{3}, {4}},
                              .views = 40,
                              .intervals = 2,
                              .parts = {{1, "held", "it grows there", 0.25}},
                              .seconds = 1.5,
                              .memory_bytes = std::uint64_t{5} << 32,
                              .request = some_request(),
                              .warnings = {"careful"}};
  const json out = json::parse(to_json(estimate));
  EXPECT_EQ(out.at("valid"), true);
  EXPECT_EQ(out.at("handles"), json::parse(R"([{"gaussians": 3}, {"gaussians": 4}])"));
  EXPECT_EQ(out.at("views"), 40);
  EXPECT_EQ(out.at("intervals"), 2);
  EXPECT_EQ(out.at("parts"), json::parse(R"([{"group": 1, "how": "held", "why": "it grows there", "settled": 0.25}])"));
  EXPECT_EQ(out.at("estimate"), json::parse(R"({"seconds": 1.5, "memory_bytes": 21474836480})"));
  EXPECT_EQ(*parse_edit_request(out.at("request").dump()), some_request());
  EXPECT_EQ(out.at("warnings"), json::parse(R"(["careful"])"));
}

TEST(Preview, LinksTheVersionThatShowsIt) {
  const Preview preview{.scene = "s000001",
                        .version = "p000003",
                        .parent = 1,
                        .expires = "2026-11-21T11:19:38.123Z",
                        .handles = {{12}},
                        .positions = {{1, 2, 3}},
                        .intervals = 4,
                        .parts = {},
                        .gaussians = {10, 11, 1, 2, 3, 4, 0},
                        .seconds = 0.01,
                        .warnings = {}};
  EXPECT_EQ(json::parse(to_json(preview)), json::parse(R"({
    "scene": "s000001", "version": "p000003", "parent": 1, "expires": "2026-11-21T11:19:38.123Z",
    "handles": [{"gaussians": 12, "position": [1, 2, 3]}], "intervals": 4, "parts": [],
    "gaussians": {"input": 10, "output": 11, "removed": 1, "copies": 2, "changeable": 3, "crumbs": 4, "relit": 0},
    "seconds": 0.01, "warnings": [],
    "links": {"render": "/v1/scenes/s000001/versions/p000003/render",
              "pick": "/v1/scenes/s000001/versions/p000003/pick",
              "file": "/v1/scenes/s000001/versions/p000003/file?format=ply"}})"));
}

}  // namespace
}  // namespace proto
