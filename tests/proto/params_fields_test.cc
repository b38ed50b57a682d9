#include "proto/params_fields.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace proto {
namespace {

using engine::params::for_each_parameter;
using engine::params::GivenParams;
using engine::params::Preset;
using nlohmann::json;
using nlohmann::ordered_json;

/// Some value of a parameter that is not its usual one.
int other(const engine::params::Parameter<int>& p) {
  return p.defaults.usual == p.range.high ? p.range.low : p.range.high;
}
double other(const engine::params::Parameter<double>& p) { return (p.range.low + 3 * p.range.high) / 4; }
bool other(const engine::params::Parameter<bool>& p) { return !p.defaults.usual; }
std::uint64_t other(const engine::params::Parameter<std::uint64_t>&) {
  return std::numeric_limits<std::uint64_t>::max();
}
std::vector<std::string> other(const engine::params::Parameter<std::vector<std::string>>&) { return {"", "a view"}; }
template <engine::Named Enum>
Enum other(const engine::params::Parameter<Enum>& p) {
  const auto& names = engine::names<Enum>;
  return names.back().value == p.defaults.usual ? names.front().value : names.back().value;
}

GivenParams all_given() {
  GivenParams params;
  for_each_parameter([&](const auto& p) {
    if (p.on_wire) params.*p.given = other(p);
  });
  return params;
}

std::optional<engine::Error> refusal(const json& document, GivenParams* params = nullptr) {
  std::optional<engine::Error> error;
  const GivenParams read = read_params(JsonField(document, "params", error));
  if (params != nullptr) *params = read;
  return error;
}

TEST(ParamsFields, EveryParameterGoesThereAndBack) {
  const GivenParams given = all_given();
  const ordered_json written = encode(given);
  EXPECT_EQ(written.size(), engine::params::wire_count);
  GivenParams read;
  EXPECT_FALSE(refusal(json::parse(written.dump()), &read));
  EXPECT_EQ(read, given);
}

TEST(ParamsFields, EachParameterAloneGoesThereAndBack) {
  for_each_parameter([&](const auto& p) {
    if (!p.on_wire) return;
    GivenParams given, read;
    given.*p.given = other(p);
    EXPECT_FALSE(refusal(json::parse(encode(given).dump()), &read));
    EXPECT_EQ(read, given) << p.name;
    EXPECT_NE(read, GivenParams{}) << p.name;
  });
}

TEST(ParamsFields, EveryParameterIsRefusedByNameWhereItIsOfAWrongType) {
  for_each_parameter([&](const auto& p) {
    json document = json::object();
    document[std::string(p.name)] = json::object();
    const auto error = refusal(document);
    ASSERT_TRUE(error) << p.name;
    EXPECT_EQ(error->where, "params." + std::string(p.name));
    EXPECT_EQ(error->message.starts_with("unknown field"), !p.on_wire) << p.name << ": " << error->message;
  });
}

TEST(ParamsFields, WhatIsDescribedIsWhatIsRead) {
  const ordered_json list = describe_parameters();
  ASSERT_EQ(list.size(), engine::params::wire_count);
  std::size_t i = 0;
  for_each_parameter([&](const auto& p) {
    if (!p.on_wire) return;
    const ordered_json& described = list[i++];
    const std::string name(p.name);
    SCOPED_TRACE(name);
    EXPECT_EQ(described.at("name"), name);
    EXPECT_TRUE(described.at("description").template get<std::string>().ends_with('.'));
    const auto accepted = [&](const json& value) { return !refusal(json{{name, value}}); };
    if (described.at("type") == "integer" || described.at("type") == "number") {
      for (const char* end : {"minimum", "maximum"}) EXPECT_TRUE(accepted(described.at(end))) << end;
    }
    if (described.at("type") == "integer") {
      EXPECT_FALSE(accepted(described.at("minimum").template get<int>() - 1));
      EXPECT_FALSE(accepted(1.5));
    }
    EXPECT_EQ(described.at("type") == "string", described.at("values").is_array());
    for (const auto& value : described.at("values")) EXPECT_TRUE(accepted(value)) << value;
    EXPECT_EQ(described.at("defaults").size(), engine::names<Preset>.size());
    for (const auto& value : described.at("defaults")) EXPECT_TRUE(value.is_null() || accepted(value)) << value;
  });
}

TEST(ParamsFields, ADefaultIsThatOfThePresetOrDependsOnTheDrag) {
  const ordered_json list = describe_parameters();
  const auto defaults = [&](const std::string& name) {
    for (const ordered_json& described : list)
      if (described.at("name") == name) return described.at("defaults");
    return ordered_json();
  };
  EXPECT_EQ(defaults("intervals").dump(), R"({"preview":null,"draft":null,"standard":null,"paper":5})");
  EXPECT_EQ(defaults("max_image_side").dump(), R"({"preview":512,"draft":384,"standard":512,"paper":512})");
  EXPECT_EQ(defaults("corrector").dump(), R"({"preview":"none","draft":"scene","standard":"scene","paper":"scene"})");
  EXPECT_EQ(defaults("exclude_views").dump(), R"({"preview":[],"draft":[],"standard":[],"paper":[]})");
}

}  // namespace
}  // namespace proto
