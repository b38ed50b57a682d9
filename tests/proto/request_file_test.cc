#include <gtest/gtest.h>

#include <string>

#include "proto/edit_request.h"
#include "tests/proto/examples.h"

namespace proto {
namespace {

using engine::ErrorCode;

TEST(RequestFile, TellsTheFormsApart) {
  EXPECT_EQ(parse_request_file(example("move_ball.json"), "").value().request,
            parse_edit_request(example("move_ball.json")).value());
  EXPECT_EQ(parse_request_file(example("released_config.json"), "").value().request,
            parse_released_config(example("released_config.json")).value());
}

TEST(RequestFile, PicksARequestByName) {
  const auto ball = parse_request_file(example("named_requests.json"), "ball_right");
  ASSERT_TRUE(ball) << ball.error().message;
  EXPECT_EQ(ball->request.handles[0].radius, 0.22);
  const auto apple = parse_request_file(example("named_requests.json"), "apple_up");
  ASSERT_TRUE(apple) << apple.error().message;
  EXPECT_EQ(apple->request.handles[0].radius, 0.2);
}

TEST(RequestFile, ListsTheNamesWhenNoneOrAWrongOneIsGiven) {
  const auto none = parse_request_file(example("named_requests.json"), "");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::invalid_argument);
  EXPECT_NE(none.error().message.find("apple_up, ball_right"), std::string::npos) << none.error().message;
  const auto wrong = parse_request_file(example("named_requests.json"), "ball_left");
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, ErrorCode::not_found);
  EXPECT_NE(wrong.error().message.find("apple_up, ball_right"), std::string::npos) << wrong.error().message;
}

TEST(RequestFile, TakesTheOnlyRequestWithoutAName) {
  const std::string text = R"({"comment": "c", "up": {"handles": [{"source": [0, 0, 0], "radius": 1}]}})";
  EXPECT_TRUE(parse_request_file(text, ""));
  EXPECT_TRUE(parse_request_file(text, "up"));
}

TEST(RequestFile, PutsTheNameBeforeTheAddress) {
  const auto request = parse_request_file(R"({"up": {"handles": [{"source": [0, 0, 0], "radius": -1}]}})", "up");
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().where, "up.handles[0].radius");
}

TEST(RequestFile, KnowsWhatTheFileCallsAField) {
  const auto named = parse_request_file(R"({"up": {"handles": [{"source": [0, 0, 0], "radius": 1}]}})", "");
  ASSERT_TRUE(named);
  EXPECT_EQ(named->address_of("handles[0].radius"), "up.handles[0].radius");
  const auto released = parse_request_file(example("released_config.json"), "");
  ASSERT_TRUE(released);
  EXPECT_EQ(released->address_of("handles[2].radius"), "voxel_size");
  EXPECT_EQ(released->address_of("handles[12].target"), "direction[12]");
  EXPECT_EQ(released->address_of("handles[1].source"), "start[1]");
  EXPECT_EQ(released->address_of("handles[1].group"), "cluster[1]");
  EXPECT_EQ(released->address_of("handles"), "handles");
  EXPECT_EQ(released->address_of("region.size"), "local_mask.xyz");
  EXPECT_EQ(released->address_of("region.center"), "local_mask.center");
}

TEST(RequestFile, ANameThatIsNoTextIsNotFound) {
  const auto request = parse_request_file(example("named_requests.json"), "\xff");
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().code, ErrorCode::not_found);
}

TEST(RequestFile, RefusesANameForASingleRequest) {
  const auto request = parse_request_file(example("move_ball.json"), "ball");
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().code, ErrorCode::invalid_argument);
}

TEST(RequestFile, SaysWhatItExpectsOfAnythingElse) {
  for (const char* text : {"{}", "[]", "7", R"({"frames": [], "camera": {}})", R"({"camera": {}})"}) {
    const auto request = parse_request_file(text, "");
    ASSERT_FALSE(request) << text;
    EXPECT_EQ(request.error().code, ErrorCode::invalid_argument);
    EXPECT_NE(request.error().message.find("voxel_size"), std::string::npos) << request.error().message;
  }
}

TEST(RequestFile, NamesAFieldThatIsMisspelt) {
  const auto where = [](const char* text, const char* name) {
    const auto request = parse_request_file(text, name);
    return request ? "no error" : request.error().where;
  };
  EXPECT_EQ(where(R"({"mode": "move", "handels": [{"source": [0, 0, 0], "radius": 1}]})", ""), "handels");
  EXPECT_EQ(where(R"({"handels": [{"source": [0, 0, 0], "radius": 1}]})", ""), "handels");
  EXPECT_EQ(where(R"({"up": {"preset": "draft", "handels": []}, "down": {}})", "up"), "up.handels");
  EXPECT_EQ(where(R"({"mode": "move"})", ""), "handles");
  EXPECT_EQ(where(R"({"description": "to the right", "handels": [{"source": [0, 0, 0], "radius": 1}]})", ""),
            "handels");
  EXPECT_EQ(where(R"({"strat": [[0, 0, 0]], "directions": [[0, 1, 0]], "cluster": [0]})", ""), "directions");
  EXPECT_EQ(where(R"({"cluster": [0], "directon": [[0, 1, 0]], "mode": "move"})", ""), "directon");
  EXPECT_EQ(where(R"({"cluster": [0], "mode": "move"})", ""), "start") << "it is missing";
  EXPECT_EQ(where(R"({"preset": "draft", "params": {"views": 9}})", ""), "handles") << "it is missing";
  EXPECT_EQ(where(R"({"handels": {"source": [0, 0, 0], "radius": 1}, "mode": "move"})", ""), "handels");
  EXPECT_EQ(where(R"({"version": 2, "region": {"center": [0, 0, 0], "size": [1, 1, 1]}})", ""), "handles");
}

TEST(RequestFile, TakesWordsBesideSeveralRequestsAsComments) {
  const std::string text = R"({"mode": "both move", "up": {"handles": [{"source": [0, 0, 0], "radius": 1}]},
                               "down": {"handles": [{"source": [0, 0, 0], "radius": 2}]}})";
  const auto down = parse_request_file(text, "down");
  ASSERT_TRUE(down) << down.error().message;
  EXPECT_EQ(down->request.handles[0].radius, 2);
}

TEST(RequestFile, SaysOfWhichFormTheMisspeltFieldIs) {
  const auto message = [](const char* text) { return parse_request_file(text, "").error().message; };
  EXPECT_NE(message(R"({"strat": [[0, 0, 0]], "mode": "move", "cluster": [0]})").find("voxel_size"), std::string::npos);
  EXPECT_NE(message(R"({"strat": [[0, 0, 0]], "mode": "move"})").find("voxel_size"), std::string::npos)
      << "both have a mode: the misspelt one decides";
  EXPECT_NE(message(R"({"handels": [[0, 0, 0]], "mode": "move"})").find("selection"), std::string::npos);
}

TEST(SelectionFile, IsASelectionAListOrAWholeRequest) {
  const auto expected = parse_selection(R"({"selection": [{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}]})");
  ASSERT_TRUE(expected) << expected.error().message;
  for (const char* text : {R"([{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}])",
                           R"({"selection": [{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}]})",
                           R"({"mode": "remove", "params": {"views": 9},
                               "selection": [{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}]})",
                           R"({"scene": "s1",
                               "selection": [{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}]})",
                           R"({"part": {"preset": "draft",
                               "selection": [{"rows": [[0, 3]]}, {"op": "subtract", "rows": [[1, 2]]}]}})"}) {
    const auto selection = parse_selection_file(text);
    ASSERT_TRUE(selection) << text << ": " << selection.error().message << " " << selection.error().where;
    EXPECT_EQ(*selection, *expected) << text;
  }
}

TEST(SelectionFile, SaysWhereItIsWrong) {
  const auto where = [](const char* text) {
    const auto selection = parse_selection_file(text);
    return selection ? "no error" : selection.error().where;
  };
  EXPECT_EQ(where(R"([{"rows": [[0, -3]]}])"), "selection[0].rows[0][1]");
  EXPECT_EQ(where(R"({"selektion": []})"), "selektion");
  EXPECT_EQ(where(R"({"mode": "move", "handles": [{"source": [0, 0, 0], "radius": 1}]})"), "selection");
  EXPECT_EQ(where(R"({"mode": "remove", "selection": [{"rows": [[0, 3]]}], "parms": {}})"), "parms");
  EXPECT_EQ(where(R"({"mode": "remove", "selektion": []})"), "selektion");
  EXPECT_EQ(where(R"({"start": [[0, 0, 0]], "direction": [[0, 1, 0]], "voxel_size": 1})"), "selection");
  EXPECT_EQ(where(R"({"part": {"selection": [{"rows": [[0, -3]]}]}})"), "part.selection[0].rows[0][1]");
}

TEST(SelectionFile, IsChosenByNameAmongSeveral) {
  const std::string text =
      R"({"ears": {"selection": [{"rows": [[0, 3]]}]}, "tail": {"selection": [{"rows": [[5, 9]]}]}})";
  const auto tail = parse_selection_file(text, "tail");
  ASSERT_TRUE(tail) << tail.error().message;
  EXPECT_EQ(*tail, parse_selection(R"({"selection": [{"rows": [[5, 9]]}]})").value());
  const auto none = parse_selection_file(text);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("ears, tail"), std::string::npos) << none.error().message;
  EXPECT_EQ(parse_selection_file(text, "nose").error().code, ErrorCode::not_found);
  EXPECT_EQ(parse_selection_file(R"([{"rows": [[0, 3]]}])", "ears").error().code, ErrorCode::invalid_argument);
}

TEST(RequestFile, RefusesAMixtureOfBothForms) {
  const auto request =
      parse_request_file(R"({"handles": [{"source": [0, 0, 0], "radius": 1}], "start": [[0, 0, 0]]})", "");
  ASSERT_FALSE(request);
  EXPECT_EQ(request.error().where, "start");
}

}  // namespace
}  // namespace proto
