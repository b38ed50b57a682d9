#include "proto/edit_request.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/proto/examples.h"

namespace proto {
namespace {

using engine::ErrorCode;
using nlohmann::json;

json smallest() { return json::parse(R"({"handles": [{"source": [1, 2, 3], "target": [1, 2, 4], "radius": 0.5}]})"); }

/// `value` at a JSON pointer of the smallest request.
std::string with(const std::string& pointer, json value) {
  json request = smallest();
  request[json::json_pointer(pointer)] = std::move(value);
  return request.dump();
}

std::string without(const std::string& parent, const std::string& member) {
  json request = smallest();
  request["region"] = {{"center", {0, 0, 0}}, {"size", {1, 1, 1}}};
  request[json::json_pointer(parent)].erase(member);
  return request.dump();
}

void expect_refused(const std::string& text, const std::string& where, ErrorCode code = ErrorCode::invalid_argument) {
  const auto request = parse_edit_request(text);
  ASSERT_FALSE(request) << text;
  EXPECT_EQ(request.error().code, code) << request.error().message;
  EXPECT_EQ(request.error().where, where) << request.error().message;
  EXPECT_FALSE(request.error().message.empty());
}

TEST(EditRequest, ReadsHowAHandleTurnsAndScales) {
  json asked = smallest();
  asked["handles"][0]["rotation"] = {0.5, 0, 0.5, -1};
  asked["handles"][0]["scale"] = 1.5;
  asked["attach"] = "held";
  asked["crumbs"] = "keep";
  asked["shadow"] = "remove";
  asked["settle"] = "off";
  const auto request = parse_edit_request(asked.dump());
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->handles[0].rotation, (std::array<double, 4>{0.5, 0, 0.5, -1}));
  EXPECT_EQ(request->handles[0].scale, 1.5);
  EXPECT_EQ(request->attach, Attach::held);
  EXPECT_EQ(request->crumbs, Crumbs::keep);
  EXPECT_EQ(request->shadow, ShadowOfPart::remove);
  EXPECT_EQ(request->settle, Settle::off);
  EXPECT_EQ(*parse_edit_request(to_json(*request)), *request);

  expect_refused(with("/handles/0/rotation", {0, 0, 0, 0}), "handles[0].rotation");
  expect_refused(with("/handles/0/rotation", {1, 0, 0}), "handles[0].rotation");
  expect_refused(with("/handles/0/scale", 0), "handles[0].scale");
  expect_refused(with("/handles/0/scale", 1001), "handles[0].scale");
  expect_refused(with("/attach", "glued"), "attach");
  expect_refused(with("/crumbs", "eat"), "crumbs");
  expect_refused(with("/shadow", "deepen"), "shadow");
  expect_refused(with("/settle", true), "settle");
}

TEST(EditRequest, ReadsEveryField) {
  const auto request = parse_edit_request(example("move_ball.json"));
  ASSERT_TRUE(request) << request.error().message << request.error().where;
  EXPECT_EQ(request->mode, Mode::move);
  EXPECT_EQ(request->preset, Preset::paper);
  EXPECT_EQ(request->prompt, std::nullopt);
  ASSERT_EQ(request->handles.size(), 1u);
  EXPECT_EQ(request->handles[0].source, (Point{-0.28, -0.21, -0.62}));
  EXPECT_EQ(request->handles[0].target, (Point{0.52, -0.21, -0.70}));
  EXPECT_EQ(request->handles[0].radius, 0.22);
  ASSERT_TRUE(request->region);
  EXPECT_EQ(request->region->size, (Point{2.4, 1.0, 1.2}));
  const Params& params = request->params;
  EXPECT_EQ(params.intervals, 4);
  EXPECT_EQ(params.annealing_steps, 4);
  EXPECT_EQ(params.strength_initial, 0.5);
  EXPECT_EQ(params.strength_final, 0.3);
  EXPECT_EQ(params.annealing, Annealing::linear);
  EXPECT_EQ(params.iterations, 500);
  EXPECT_EQ(params.views, 30);
  EXPECT_EQ(params.exclude_views, std::vector<std::string>{"view_03.png"});
  EXPECT_EQ(params.max_image_side, 512);
  EXPECT_EQ(params.corrector, Corrector::scene);
  EXPECT_EQ(params.perceptual, Perceptual::msssim);
  EXPECT_EQ(params.rotation, Rotation::shortest_arc);
  EXPECT_EQ(params.interpolation, Interpolation::smooth);
  EXPECT_EQ(params.rotate_sh, true);
  EXPECT_EQ(params.background, Background::render);
  EXPECT_EQ(params.seed, 7u);
}

TEST(EditRequest, LeavesWhatIsNotGivenOpen) {
  const auto request = parse_edit_request(example("stretch_apple.json"));
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->mode, Mode::extend);
  EXPECT_EQ(request->preset, std::nullopt);
  EXPECT_EQ(request->region, std::nullopt);
  EXPECT_EQ(request->params, Params{});
  ASSERT_EQ(request->handles.size(), 2u);
  EXPECT_EQ(request->handles[0].group, 0);
  EXPECT_EQ(request->handles[1].target, std::nullopt) << "an anchor";
}

TEST(EditRequest, ComesBackFromItsOwnJson) {
  for (const char* name : {"move_ball.json", "stretch_apple.json"}) {
    SCOPED_TRACE(name);
    auto request = parse_edit_request(example(name));
    ASSERT_TRUE(request) << request.error().message;
    request->scene = "s1";
    request->version = 3;
    request->prompt = "a \"red\" ball\n";
    request->negative_prompt = "blur";
    request->lora = "few steps";
    request->allow_slow = true;
    request->params.seed = std::numeric_limits<std::uint64_t>::max();
    request->handles[0].source[0] = 0.1 + 0.2;
    const auto again = parse_edit_request(to_json(*request));
    ASSERT_TRUE(again) << again.error().message << again.error().where;
    EXPECT_EQ(*again, *request);
  }
}

TEST(EditRequest, WhatIsSelectedIsRemovedWithoutAHandle) {
  const std::string selection = R"("selection": [{"sphere": {"center": [0, 0, 0], "radius": 1}}])";
  const std::string heal = R"("heal": [{"box": {"center": [1, 0, 0], "size": [1, 1, 1]}}])";
  for (const std::string handles : {"", R"("handles": [], )"}) {
    const auto request = parse_edit_request(R"({"mode": "remove", )" + handles + selection + ", " + heal + "}");
    ASSERT_TRUE(request) << request.error().message;
    EXPECT_EQ(request->mode, Mode::remove);
    EXPECT_TRUE(request->handles.empty());
    ASSERT_TRUE(request->heal);
    EXPECT_EQ(request->heal->size(), 1u);
    EXPECT_EQ(*parse_edit_request(to_json(*request)), *request);
  }
  const auto where = [](const std::string& text) { return parse_edit_request(text).error().where; };
  EXPECT_EQ(where(R"({"mode": "remove"})"), "handles") << "nothing says what";
  EXPECT_EQ(where(R"({"mode": "move", )" + selection + "}"), "handles");
  EXPECT_EQ(where(R"({"mode": "remove", "handles": [], )" + heal + "}"), "handles");
  EXPECT_EQ(where(R"({"mode": "remove", "heal": [{"ball": 1}], )" + selection + "}").substr(0, 7), "heal[0]");
}

TEST(EditRequest, NamesAMissingField) {
  expect_refused(without("", "handles"), "handles");
  expect_refused(without("/handles/0", "source"), "handles[0].source");
  expect_refused(without("/handles/0", "radius"), "handles[0].radius");
  expect_refused(without("/region", "center"), "region.center");
  expect_refused(without("/region", "size"), "region.size");
}

TEST(EditRequest, NamesAFieldItDoesNotKnow) {
  expect_refused(with("/handle", 1), "handle");
  expect_refused(with("/handles/0/radus", 1), "handles[0].radus");
  expect_refused(with("/region", {{"center", {0, 0, 0}}, {"size", {1, 1, 1}}, {"xyz", 1}}), "region.xyz");
  expect_refused(with("/params/Intervals", 1), "params.Intervals");
}

TEST(EditRequest, ShortensAndEscapesAnUnknownNameInTheAddress) {
  expect_refused(with("/params", {{"a\nb", 1}}), "params.a\\nb");
  const auto request = parse_edit_request(with("/params", {{std::string(5000, 'x'), 1}}));
  ASSERT_FALSE(request);
  EXPECT_LT(request.error().where.size(), 100u);
}

TEST(EditRequest, NamesAFieldOfTheWrongType) {
  const std::vector<std::pair<std::string, std::string>> addresses = {
      {"/scene", "scene"},
      {"/mode", "mode"},
      {"/preset", "preset"},
      {"/prompt", "prompt"},
      {"/negative_prompt", "negative_prompt"},
      {"/lora", "lora"},
      {"/allow_slow", "allow_slow"},
      {"/version", "version"},
      {"/handles", "handles"},
      {"/handles/0", "handles[0]"},
      {"/handles/0/source", "handles[0].source"},
      {"/handles/0/source/1", "handles[0].source[1]"},
      {"/handles/0/target", "handles[0].target"},
      {"/handles/0/radius", "handles[0].radius"},
      {"/handles/0/group", "handles[0].group"},
      {"/region", "region"},
      {"/params", "params"},
      {"/params/intervals", "params.intervals"},
      {"/params/annealing_steps", "params.annealing_steps"},
      {"/params/strength_initial", "params.strength_initial"},
      {"/params/strength_final", "params.strength_final"},
      {"/params/annealing", "params.annealing"},
      {"/params/iterations", "params.iterations"},
      {"/params/views", "params.views"},
      {"/params/exclude_views", "params.exclude_views"},
      {"/params/max_image_side", "params.max_image_side"},
      {"/params/corrector", "params.corrector"},
      {"/params/perceptual", "params.perceptual"},
      {"/params/rotation", "params.rotation"},
      {"/params/interpolation", "params.interpolation"},
      {"/params/rotate_sh", "params.rotate_sh"},
      {"/params/background", "params.background"},
      {"/params/seed", "params.seed"}};
  for (const auto& [pointer, where] : addresses) {
    SCOPED_TRACE(pointer);
    expect_refused(with(pointer, json::array({json::object()})), where == "handles"                ? "handles[0].source"
                                                                 : where == "params.exclude_views" ? where + "[0]"
                                                                                                   : where);
    if (!where.ends_with("prompt") && where != "lora") expect_refused(with(pointer, nullptr), where);
  }
}

TEST(EditRequest, NamesAFieldOutOfRange) {
  const std::vector<std::pair<std::string, json>> values = {
      {"handles[0].radius", 0},
      {"handles[0].radius", -1},
      {"handles[0].radius", 1e13},
      {"handles[0].group", -1},
      {"handles[0].group", 1u << 31},
      {"handles[0].source", {1, 2}},
      {"handles[0].target", {1, 2, 3, 4}},
      {"version", -1},
      {"version", 18446744073709551615u},
      {"mode", "Move"},
      {"preset", "fast"},
      {"params.intervals", 0},
      {"params.intervals", 21},
      {"params.intervals", 4.0},
      {"params.annealing_steps", 0},
      {"params.annealing_steps", 101},
      {"params.strength_initial", -0.01},
      {"params.strength_initial", 1.01},
      {"params.strength_final", 2},
      {"params.annealing", "cosine"},
      {"params.iterations", -1},
      {"params.iterations", 1000001},
      {"params.views", 0},
      {"params.views", 1001},
      {"params.max_image_side", 15},
      {"params.max_image_side", 16385},
      {"params.corrector", "dall-e"},
      {"params.perceptual", "l2"},
      {"params.rotation", "long_arc"},
      {"params.interpolation", "cubic"},
      {"params.background", "black"},
      {"params.seed", -1},
      {"handles", json::array()},
      {"handles", std::vector<int>(max_handles + 1)},
      {"prompt", std::string(max_text_bytes + 1, 'x')},
      {"params.exclude_views", std::vector<std::string>(engine::params::max_excluded_views + 1)}};
  for (const auto& [where, value] : values) {
    SCOPED_TRACE(where);
    std::string pointer = "/" + where;
    for (const auto& [from, to] : {std::pair<std::string, std::string>{"[0]", "/0"}, {".", "/"}})
      for (auto at = pointer.find(from); at != std::string::npos; at = pointer.find(from))
        pointer.replace(at, from.size(), to);
    expect_refused(with(pointer, value), where);
  }
  expect_refused(with("/handles/0/source/2", 1.5e12), "handles[0].source[2]");
  expect_refused(with("/region", {{"center", {0, 0, 0}}, {"size", {1, 0, 1}}}), "region.size[1]");
}

TEST(EditRequest, AcceptsTheEndsOfEveryRange) {
  for (const auto& [pointer, low, high] :
       std::vector<std::tuple<std::string, json, json>>{{"/params/intervals", 1, 20},
                                                        {"/params/annealing_steps", 1, 100},
                                                        {"/params/strength_initial", 0, 1},
                                                        {"/params/strength_final", 0.0, 1.0},
                                                        {"/params/iterations", 0, 1000000},
                                                        {"/params/views", 1, 1000},
                                                        {"/params/max_image_side", 16, 16384},
                                                        {"/params/seed", 0, 18446744073709551615u},
                                                        {"/handles/0/source/0", -1e12, 1e12},
                                                        {"/handles/0/radius", 5e-324, 1e12},
                                                        {"/handles/0/group", 0, 2147483647}})
    for (const json& value : {low, high})
      EXPECT_TRUE(parse_edit_request(with(pointer, value))) << pointer << " " << value;
}

TEST(EditRequest, NamesANumberThatIsNotFinite) {
  std::string text = smallest().dump();
  text.replace(text.find("0.5"), 3, "1e999");
  expect_refused(text, "handles[0].radius");
  text.replace(text.find("1e999"), 5, "-1e999");
  expect_refused(text, "handles[0].radius");
  std::string source = smallest().dump();
  source.replace(source.find("[1,2,3]"), 7, "[1,2,1e400]");
  expect_refused(source, "handles[0].source[2]");
  source.replace(source.find("1e400"), 5, "NaN");
  expect_refused(source, "line 1, column " + std::to_string(source.find("NaN") + 1));
}

TEST(EditRequest, NamesAFieldGivenTwice) {
  expect_refused(R"({"handles": [{"source": [0, 0, 0], "radius": 1, "radius": 2}]})", "handles[0].radius");
  expect_refused(R"({"mode": "move", "handles": [], "mode": "move"})", "mode");
}

TEST(EditRequest, RefusesATextCutAtAnyByte) {
  const std::string text = example("move_ball.json");
  const std::size_t end = text.rfind('}');
  for (std::size_t size = 0; size <= end; ++size) {
    const auto request = parse_edit_request(text.substr(0, size));
    ASSERT_FALSE(request) << size;
    EXPECT_EQ(request.error().code, ErrorCode::invalid_argument) << size;
    EXPECT_NE(request.error().where.find("line "), std::string::npos) << request.error().where;
  }
}

TEST(EditRequest, SaysWhereATextStopsBeingJson) {
  const auto request = parse_edit_request("{\n  \"mode\": \"move\",\n  handles: []\n}");
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().where, "line 3, column 3");
  EXPECT_EQ(request.error().message.find("json.exception"), std::string::npos) << request.error().message;
  expect_refused("{\"prompt\": \"\xff\", \"handles\": []}", "line 1, column 13");
}

TEST(EditRequest, RefusesNestingAndSizeBeyondTheLimits) {
  const std::string deep = R"({"handles": )" + std::string(100'000, '[');
  const auto nested = parse_edit_request(deep);
  ASSERT_FALSE(nested);
  EXPECT_EQ(nested.error().code, ErrorCode::too_large);
  EXPECT_NE(nested.error().message.find("16"), std::string::npos) << nested.error().message;
  const std::string huge = R"({"prompt": ")" + std::string(std::size_t{2} << 20, 'x') + "\"}";
  const auto large = parse_edit_request(huge);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::too_large);
  EXPECT_NE(large.error().message.find("1048576"), std::string::npos) << large.error().message;
  EXPECT_EQ(parse_edit_request(smallest().dump(), {.max_bytes = 10}).error().code, ErrorCode::too_large);
}

TEST(EditRequest, RefusesADocumentThatIsNoObject) {
  for (const char* text : {"[]", "null", "3", "\"handles\"", "true"}) expect_refused(text, "");
}

}  // namespace
}  // namespace proto
