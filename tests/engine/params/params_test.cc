#include "engine/params/params.h"

#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <limits>
#include <set>
#include <string>

namespace engine::params {
namespace {

// What the table says is held against the code that reads JSON in tests/proto/params_fields_test.cc, against
// checkpoints in tests/engine/edit/checkpoint_test.cc, and against proto/openapi.yaml in
// tests/service/contract.test.mjs.

TEST(Parameters, EachHasAFieldOfItsOwnInBothForms) {
  Values values;
  GivenParams given;
  std::set<const void*> places;
  for_each_parameter([&](const auto& parameter) {
    EXPECT_TRUE(places.insert(&(values.*parameter.value)).second) << parameter.name;
    EXPECT_TRUE(places.insert(&(given.*parameter.given)).second) << parameter.name;
  });
  EXPECT_EQ(places.size(), 2 * parameter_count);
}

TEST(Parameters, EachIsNamedAndDescribed) {
  bool internal_ones = false;
  for_each_parameter([&](const auto& parameter) {
    for (const char c : parameter.name) EXPECT_TRUE(c == '_' || std::islower(c)) << parameter.name;
    EXPECT_TRUE(parameter.meaning.ends_with('.')) << parameter.name;
    EXPECT_FALSE(internal_ones && parameter.on_wire) << parameter.name << " comes after those that are not on the wire";
    internal_ones = internal_ones || !parameter.on_wire;
  });
}

TEST(Parameters, EveryPresetIsValidAndLeavesWhatIsGiven) {
  EXPECT_TRUE(validate(Params{}));
  for (const auto& preset : names<Preset>) {
    const Params usual = filled_in({}, preset.value);
    EXPECT_TRUE(validate(usual)) << preset.text;
    const GivenParams all = as_given(usual);
    for (const auto& another : names<Preset>) EXPECT_EQ(filled_in(all, another.value), usual) << preset.text;
  }
}

TEST(Parameters, AllThatIsOnTheWireIsGiven) {
  const GivenParams all = as_given(Params{});
  for_each_parameter([&](const auto& parameter) {
    EXPECT_EQ((all.*parameter.given).has_value(), parameter.on_wire) << parameter.name;
  });
}

/// The message about one parameter that is wrong.
template <class T>
std::string refusal(const Parameter<T>& parameter, T value) {
  Params params;
  params.*parameter.value = value;
  const auto valid = validate(params);
  if (valid) return "";
  EXPECT_EQ(valid.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(valid.error().where, "params." + std::string(parameter.name));
  return valid.error().message;
}

struct HoldsItsRange {
  void operator()(const Parameter<int>& parameter) const {
    EXPECT_EQ(refusal(parameter, parameter.range.low), "");
    EXPECT_EQ(refusal(parameter, parameter.range.high), "");
    EXPECT_NE(refusal(parameter, parameter.range.high + 1), "") << parameter.name;
    if (parameter.range.zero.empty()) {
      EXPECT_NE(refusal(parameter, parameter.range.low - 1), "") << parameter.name;
    } else {
      EXPECT_EQ(refusal(parameter, 0), "") << parameter.name;
      EXPECT_NE(refusal(parameter, -1), "") << parameter.name;
    }
  }
  void operator()(const Parameter<double>& parameter) const {
    EXPECT_EQ(refusal(parameter, parameter.range.low), "");
    EXPECT_EQ(refusal(parameter, parameter.range.high), "");
    EXPECT_NE(refusal(parameter, std::nextafter(parameter.range.high, 2 * parameter.range.high)), "");
    EXPECT_NE(refusal(parameter, std::numeric_limits<double>::quiet_NaN()), "") << parameter.name;
  }
  void operator()(const Parameter<std::vector<std::string>>& parameter) const {
    const auto names_of_length = [](std::size_t n) { return std::vector<std::string>(n, "0001.jpg"); };
    EXPECT_EQ(refusal(parameter, names_of_length(parameter.range.most)), "");
    EXPECT_NE(refusal(parameter, names_of_length(parameter.range.most + 1)), "") << parameter.name;
  }
  template <class T>
  void operator()(const Parameter<T>&) const {}  // of other types every value is right
};

TEST(Parameters, EachIsRefusedByNameOutsideOfItsRange) { for_each_parameter(HoldsItsRange{}); }

TEST(Parameters, ARefusalSaysWhatIsAllowed) {
  const auto message = [](auto change) {
    Params params;
    change(params);
    return validate(params).error().message;
  };
  EXPECT_EQ(message([](Params& p) { p.intervals = 40; }),
            "the number of intervals is 1 to 20, or 0 to choose it from the drag, not 40");
  EXPECT_EQ(message([](Params& p) { p.views = 0; }), "the number of views is 1 to 1000, not 0");
  EXPECT_EQ(message([](Params& p) { p.max_image_side = 15; }),
            "the longer side of a working picture is 16 to 16384 pixels, not 15");
  EXPECT_EQ(message([](Params& p) { p.iterations = -1; }),
            "the number of iterations per correction is 0 to 1,000,000, not -1");
  EXPECT_EQ(message([](Params& p) { p.annealing_steps = 101; }),
            "the number of corrections per interval is 1 to 100, not 101");
  EXPECT_EQ(message([](Params& p) { p.strength_final = 1.5; }), "a strength is a number from 0 to 1");
}

TEST(Parameters, TheIntervalsOfAPresetDependOnTheDrag) {
  for (const bool extends : {false, true})
    for (const bool one_piece : {false, true}) {
      const DragKind drag{extends, one_piece};
      EXPECT_EQ(preset_intervals(Preset::preview, drag), 0) << "by the length";
      EXPECT_EQ(preset_intervals(Preset::draft, drag), extends ? 0 : 1);
      EXPECT_EQ(preset_intervals(Preset::standard, drag), extends ? 0 : one_piece ? 1 : 4);
      EXPECT_EQ(preset_intervals(Preset::paper, drag), 5);
    }
}

TEST(Parameters, WhatIsSelectedMovesAsABody) {
  for (const auto& preset : names<Preset>) {
    SCOPED_TRACE(preset.text);
    const Interpolation usual = filled_in({}, preset.value).interpolation;
    const Interpolation body = preset.value == Preset::paper ? usual : Interpolation::arap;
    EXPECT_EQ(preset_interpolation(preset.value, {}), usual);
    EXPECT_EQ(preset_interpolation(preset.value, {.selected = true}), body);
    EXPECT_EQ(preset_interpolation(preset.value, {.extends = true, .selected = true}), body);
    EXPECT_EQ(preset_interpolation(preset.value, {.turns = true}), body);
  }
}

TEST(Parameters, TheirNamesOnTheWireAreThoseOfThePaper) {
  EXPECT_EQ(name_of(Rotation::shortest_arc), "shortest_arc");
  EXPECT_EQ(name_of(Interpolation::rigid), "rigid");
  EXPECT_EQ(name_of(Annealing::paper), "paper");
  EXPECT_EQ(name_of(Corrector::sd), "sd");
  EXPECT_EQ(name_of(Perceptual::lpips), "lpips");
  EXPECT_EQ(name_of(Background::photo), "photo");
  EXPECT_EQ(name_of(Preset::standard), "standard");
  EXPECT_EQ(name_of(Mode::extend), "extend");
}

}  // namespace
}  // namespace engine::params
