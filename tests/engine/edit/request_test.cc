#include "engine/edit/request.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace engine::edit {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

Request good() {
  Request request;
  request.handles = {{DVec3(0), DVec3(1), 0.5, 0}, {DVec3(2), std::nullopt, 0.25, 1}};
  request.region = Region{DVec3(0), DVec3(1)};
  return request;
}

TEST(ValidateRequest, AcceptsTheDefaults) { EXPECT_TRUE(validate(good())); }

TEST(ValidateRequest, NamesTheFieldThatIsWrong) {
  const std::vector<std::pair<std::string, std::function<void(Request&)>>> cases{
      {"handles", [](Request& r) { r.handles.clear(); }},
      {"handles", [](Request& r) { r.handles.resize(257, r.handles[0]); }},
      {"handles[1].source", [](Request& r) { r.handles[1].source.y = nan; }},
      {"handles[1].source", [](Request& r) { r.handles[1].source.z = 2e12; }},
      {"handles[0].target", [](Request& r) { r.handles[0].target->x = -infinity; }},
      {"handles[0].radius", [](Request& r) { r.handles[0].radius = 0; }},
      {"handles[1].radius", [](Request& r) { r.handles[1].radius = nan; }},
      {"handles[1].radius", [](Request& r) { r.handles[1].radius = infinity; }},
      {"handles[1].group", [](Request& r) { r.handles[1].group = -1; }},
      {"region.center", [](Request& r) { r.region->center.x = nan; }},
      {"region.size", [](Request& r) { r.region->size.y = 0; }},
      {"region.size", [](Request& r) { r.region->size.z = infinity; }},
      {"params.intervals", [](Request& r) { r.params.intervals = 21; }},
      {"params.intervals", [](Request& r) { r.params.intervals = -1; }},
      {"params.views", [](Request& r) { r.params.views = 0; }},
      {"params.views", [](Request& r) { r.params.views = 1001; }},
      {"params.max_image_side", [](Request& r) { r.params.max_image_side = 15; }},
      {"params.max_image_side", [](Request& r) { r.params.max_image_side = 16385; }},
      {"selection",
       [](Request& r) {
         r.selected = {3, 3};
       }},
      {"selection",
       [](Request& r) {
         r.selected = {4, 3};
       }},
      {"up", [](Request& r) { r.up = DVec3(0.0); }},
      {"up", [](Request& r) { r.up.x = nan; }},
  };
  for (const auto& [where, spoil] : cases) {
    Request request = good();
    spoil(request);
    const auto result = validate(request);
    ASSERT_FALSE(result) << where;
    EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(result.error().where, where);
    EXPECT_FALSE(result.error().message.empty());
  }
}

/// What becomes of this is chosen for a selection, where a part leaves.
template <class Choice>
void expect_chosen_of_a_selection_that_leaves(Choice Request::*choice, const std::string& where) {
  Request request = good();
  for (const Choice other : {Choice::remove, Choice::keep}) {
    request.selected.reset();
    request.mode = Mode::move;
    request.*choice = other;
    ASSERT_FALSE(validate(request));
    EXPECT_EQ(validate(request).error().where, where);
    request.selected = {1, 2};
    EXPECT_TRUE(validate(request));
    request.mode = Mode::extend;
    ASSERT_FALSE(validate(request));
    EXPECT_EQ(validate(request).error().where, where);
  }
  request.*choice = Choice::move;
  EXPECT_TRUE(validate(request));
}

TEST(ValidateRequest, AShadowIsThatOfASelectionThatLeaves) {
  expect_chosen_of_a_selection_that_leaves(&Request::shadow, "shadow");
}

TEST(ValidateRequest, CrumbsAreBesideASelectionAndGoWhereAPartLeaves) {
  expect_chosen_of_a_selection_that_leaves(&Request::crumbs, "crumbs");
}

TEST(ValidateRequest, OnlyABodyIsSetDown) {
  Request request = good();
  request.settle = Settle::off;
  request.params.interpolation = Interpolation::arap;
  const auto is_refused = [&] { return !validate(request) && validate(request).error().where == "settle"; };
  EXPECT_TRUE(is_refused()) << "nothing is selected";
  request.selected = {1, 2};
  EXPECT_TRUE(validate(request));
  request.params.interpolation = Interpolation::rigid;
  EXPECT_TRUE(is_refused());
  request.params.interpolation = Interpolation::arap, request.mode = Mode::extend;
  EXPECT_TRUE(is_refused());
}

TEST(ValidateRequest, WhatIsRemovedGoesNowhere) {
  Request request = good();
  request.mode = Mode::remove;
  request.params.interpolation = Interpolation::arap;  // so that nothing else is wrong with turns and scales
  const auto where = [&] {
    const auto valid = validate(request);
    return valid ? std::string() : valid.error().where;
  };
  EXPECT_EQ(where(), "handles[0].target");
  request.handles[0].target.reset();
  EXPECT_EQ(where(), "");
  request.handles[1].rotation = DQuat(1, 0, 0, 0);
  EXPECT_EQ(where(), "handles[1].rotation");
  request.handles[1].rotation.reset();
  request.handles[1].scale = 2;
  EXPECT_EQ(where(), "handles[1].scale");
}

TEST(ValidateRequest, HealedRowsAreGivenOnceInOrder) {
  Request request = good();
  request.healed = {1, 5, 6};
  EXPECT_TRUE(validate(request));
  for (const auto& rows : {std::vector<std::uint32_t>{5, 5}, {6, 1}}) {
    request.healed = rows;
    EXPECT_EQ(validate(request).error().where, "heal");
  }
}

TEST(ValidateRequest, ASelectionOfNothingCannotBeCarriedOut) {
  Request request = good();
  request.selected.emplace();
  const auto result = validate(request);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(result.error().where, "selection");
}

TEST(ValidateRequest, SaysWhatIsAllowed) {
  Request request = good();
  request.params.intervals = 40;
  EXPECT_EQ(validate(request).error().message,
            "the number of intervals is 1 to 20, or 0 to choose it from the drag, not 40");
}

}  // namespace
}  // namespace engine::edit
