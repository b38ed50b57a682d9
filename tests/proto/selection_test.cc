#include "proto/selection.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "proto/edit_request.h"
#include "tests/proto/examples.h"

namespace proto {
namespace {

using engine::ErrorCode;
using nlohmann::json;

/// A list of this one operation.
std::string only(const std::string& operation) { return R"({"selection": [)" + operation + "]}"; }

void expect_refused(const std::string& text, const std::string& where, ErrorCode code = ErrorCode::invalid_argument) {
  const auto read = parse_selection(text);
  ASSERT_FALSE(read) << text.substr(0, 200);
  EXPECT_EQ(read.error().code, code) << read.error().message;
  EXPECT_EQ(read.error().where, where) << read.error().message;
  EXPECT_LT(read.error().message.size(), 400u);
}

TEST(Selection, ReadsEveryAction) {
  const auto read = parse_selection(example("selection.json"));
  ASSERT_TRUE(read) << read.error().message << read.error().where;
  ASSERT_EQ(read->size(), std::variant_size_v<selection::Action>);
  const auto& [op, action] = read->at(0);
  EXPECT_EQ(op, selection::Op::add);
  const auto& grow = std::get<selection::Grow>(action);
  EXPECT_EQ(grow.inside, (std::vector<Point>{{-0.28, -0.21, -0.62}, {-0.2, -0.3, -0.6}}));
  EXPECT_EQ(grow.outside, (std::vector<Point>{{0.1, 0.05, -0.6}}));
  EXPECT_EQ(grow.reach, 1.5);
  EXPECT_TRUE(grow.whole);
  EXPECT_EQ(grow.wider, 1);
  EXPECT_EQ(read->at(1).action, selection::Action(selection::Sphere{{-0.28, -0.21, -0.62}, 0.3}));
  EXPECT_EQ(read->at(2).op, selection::Op::intersect);
  EXPECT_EQ(read->at(2).action, selection::Action(selection::Box{{0, 0, 0}, {4, 2, 2}, {0.5, 0.5, 0.5, 0.5}}));
  EXPECT_EQ(read->at(3).op, selection::Op::subtract);
  EXPECT_EQ(read->at(3).action, selection::Action(selection::Plane{{0, 0.05, 0}, {0, 1, 0}}));
  const auto& stroke = std::get<selection::Stroke>(read->at(4).action);
  EXPECT_EQ(stroke.viewpoint, Viewpoint("view_03.png"));
  EXPECT_EQ(stroke.points, (std::vector<selection::Pixel>{{12.5, 40}, {80, 44.25}}));
  EXPECT_EQ(stroke.radius, 6);
  EXPECT_EQ(stroke.depth, selection::Depth::through);
  const auto& polygon = std::get<selection::Polygon>(read->at(5).action);
  EXPECT_EQ(polygon.viewpoint, Viewpoint(Camera(LookAtCamera{{0, 0, -4}, {0, 0, 0}, {}, 50, 160, 120})));
  EXPECT_EQ(polygon.points.size(), 3u);
  const auto& masks = std::get<selection::Masks>(read->at(6).action);
  ASSERT_EQ(masks.views.size(), 1u);
  EXPECT_EQ(masks.views[0].image, "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(read->at(7).action, selection::Action(selection::Rows{{{0, 12}, {40, 41}}}));
  EXPECT_EQ(read->at(8).action, selection::Action(selection::Expand{0.01}));
  EXPECT_EQ(read->at(9).action, selection::Action(selection::Shrink{0.01}));
  EXPECT_EQ(read->at(10).action, selection::Action(selection::Largest{1}));
  EXPECT_EQ(read->at(11).action, selection::Action(selection::Invert{}));
  for (std::size_t i = 0; i < read->size(); ++i)
    EXPECT_TRUE(json::parse(example("selection.json"))["selection"][i].contains(name_of(read->at(i).action))) << i;
}

TEST(Selection, ComesBackFromItsOwnJson) {
  auto read = parse_selection(example("selection.json"));
  ASSERT_TRUE(read);
  PinholeCamera camera{160, 120, 100.25, 101, 80, 60, {{{1, 0, 0, 0.1}, {0, 1, 0, 0.2}, {0, 0, 1, 0.1 + 0.2}}}};
  std::get<selection::Stroke>(read->at(4).action).viewpoint = Camera(camera);
  const auto again = parse_selection(to_json(*read));
  ASSERT_TRUE(again) << again.error().message << again.error().where;
  EXPECT_EQ(*again, *read);
  EXPECT_EQ(json::parse(to_json(*parse_selection(example("selection.json")))), json::parse(example("selection.json")))
      << "what is said is what is meant";
}

TEST(Selection, MayBeEmpty) { EXPECT_EQ(parse_selection(R"({"selection": []})"), Selection{}); }

TEST(Selection, NamesTheOperationThatIsWrong) {
  expect_refused("[]", "");
  expect_refused("{}", "selection");
  expect_refused(R"({"selection": {}})", "selection");
  expect_refused(R"({"selection": [], "op": "add"})", "op");
  expect_refused(only("3"), "selection[0]");
  expect_refused(only("{}"), "selection[0]");
  expect_refused(only(R"({"op": "add"})"), "selection[0]");
  expect_refused(only(R"({"expand": 1, "shrink": 1})"), "selection[0]");
  expect_refused(only(R"({"op": "xor", "expand": 1})"), "selection[0].op");
  expect_refused(only(R"({"ball": {}})"), "selection[0].ball");
  expect_refused(R"({"selection": [{"expand": 1}, {"expand": 0}]})", "selection[1].expand");
}

TEST(Selection, NamesTheFieldThatIsWrong) {
  expect_refused(only(R"({"sphere": {"center": [0, 0, 0], "radius": -1}})"), "selection[0].sphere.radius");
  expect_refused(only(R"({"sphere": {"center": [0, 0, 0]}})"), "selection[0].sphere.radius");
  expect_refused(only(R"({"sphere": {"center": [0, 0, 0], "radius": 1, "colour": 1}})"), "selection[0].sphere.colour");
  expect_refused(only(R"({"sphere": {"center": [0, 1e30, 0], "radius": 1}})"), "selection[0].sphere.center[1]");
  expect_refused(only(R"({"sphere": {"center": [0, "NaN", 0], "radius": 1}})"), "selection[0].sphere.center[1]");
  expect_refused(only(R"({"box": {"center": [0, 0, 0], "size": [1, 0, 1]}})"), "selection[0].box.size[1]");
  expect_refused(only(R"({"box": {"center": [0, 0, 0], "size": [1, 1, 1], "rotation": [0, 0, 0, 0]}})"),
                 "selection[0].box.rotation");
  expect_refused(only(R"({"plane": {"point": [0, 0, 0], "normal": [0, 0, 0]}})"), "selection[0].plane.normal");
  expect_refused(only(R"({"polygon": {"view": "a", "points": [[0, 0], [1, 1]]}})"), "selection[0].polygon.points");
  expect_refused(only(R"({"polygon": {"points": [[0, 0], [1, 1], [0, 1]]}})"), "selection[0].polygon");
  expect_refused(only(R"({"polygon": {"view": "a", "camera": {}, "points": [[0, 0], [1, 1], [0, 1]]}})"),
                 "selection[0].polygon");
  expect_refused(only(R"({"stroke": {"view": "a", "points": [[0, 2e6]], "radius": 1}})"),
                 "selection[0].stroke.points[0][1]");
  expect_refused(only(R"({"stroke": {"view": "a", "points": [[0, 2]], "radius": 1e7}})"), "selection[0].stroke.radius");
  expect_refused(only(R"({"stroke": {"view": "a", "points": [[0, 2]], "radius": 1, "depth": "deep"}})"),
                 "selection[0].stroke.depth");
  expect_refused(only(R"({"grow": {"inside": []}})"), "selection[0].grow.inside");
  expect_refused(only(R"({"grow": {"inside": [[0, 0, 0], [0, 0, 1e30]]}})"), "selection[0].grow.inside[1][2]");
  expect_refused(only(R"({"grow": {"inside": [[0, 0, 0]], "whole": 1}})"), "selection[0].grow.whole");
  expect_refused(only(R"({"grow": {"inside": [[0, 0, 0]], "wider": 65}})"), "selection[0].grow.wider");
  expect_refused(only(R"({"grow": {"inside": [[0, 0, 0]], "wider": 0.5}})"), "selection[0].grow.wider");
  expect_refused(only(R"({"masks": []})"), "selection[0].masks");
  expect_refused(only(R"({"masks": [{"view": "a", "image": "data:image/png;base64,iVBORw0KGgo="}]})"),
                 "selection[0].masks[0].image");
  expect_refused(only(R"({"masks": [{"view": "a", "image": ""}]})"), "selection[0].masks[0].image");
  expect_refused(only(R"({"rows": [[0]]})"), "selection[0].rows[0]");
  expect_refused(only(R"({"rows": [[-1, 2]]})"), "selection[0].rows[0][0]");
  expect_refused(only(R"({"rows": [[0, 0.5]]})"), "selection[0].rows[0][1]");
  expect_refused(only(R"({"largest": 0})"), "selection[0].largest");
  expect_refused(only(R"({"invert": false})"), "selection[0].invert");
}

std::string repeated(const std::string& text, std::size_t count) {
  std::string all;
  for (std::size_t i = 0; i < count; ++i) all += (i == 0 ? "" : ",") + text;
  return all;
}

TEST(Selection, RefusesWhatIsTooMuch) {
  expect_refused(only(repeated(R"({"expand": 1})", 10'000)), "selection");
  expect_refused(only(R"({"grow": {"inside": [)" + repeated("[0, 0, 0]", 5'000) + "]}}"), "selection[0].grow.inside");
  expect_refused(only(R"({"rows": [)" + repeated("[0,1]", 120'000) + "]}"), "selection[0].rows");
  expect_refused(only(R"({"rows": [)" + repeated("[0,1]", 50 << 17) + "]}"), "", ErrorCode::too_large);
  expect_refused(only(std::string(40, '[') + std::string(40, ']')),
                 "selection[0][0][0][0][0][0][0][0][0][0][0][0][0][0][0]", ErrorCode::too_large);
}

TEST(Selection, OfAnEditSaysWhatMovesSoThatARadiusMayBeLeftOut) {
  const std::string text =
      R"({"handles": [{"source": [0, 0, 0], "target": [1, 0, 0]}], "selection": [{"rows": [[0, 3]]}]})";
  const auto request = parse_edit_request(text);
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->handles[0].radius, std::nullopt);
  EXPECT_EQ(request->selection, (Selection{{.action = selection::Rows{{{0, 3}}}}}));
  const auto again = parse_edit_request(to_json(*request));
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(*again, *request);
  const auto bad =
      parse_edit_request(R"({"handles": [{"source": [0, 0, 0], "radius": 0}], "selection": [{"rows": [[0, 3]]}]})");
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().where, "handles[0].radius");
}

TEST(SelectionSummary, IsWrittenWhole) {
  SelectionSummary summary{
      "q1", 3, {0, 0, 0}, {1, 2, 3}, {0.5, 1, 1.5}, 2, SelectionBorder{-1, true, false}, {"nothing is selected"}};
  json written = json::parse(R"({"id": "q1", "count": 3, "bounds": {"low": [0, 0, 0], "high": [1, 2, 3]},
                                 "centre": [0.5, 1, 1.5], "undecided": 2,
                                 "border": {"wider": -1, "more": true, "less": false},
                                 "warnings": ["nothing is selected"]})");
  EXPECT_EQ(json::parse(to_json(summary)), written);
  summary.border.reset();
  written["border"] = nullptr;
  EXPECT_EQ(json::parse(to_json(summary)), written);
}

}  // namespace
}  // namespace proto
