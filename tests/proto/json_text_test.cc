#include "proto/json_text.h"

#include <gtest/gtest.h>

namespace proto {
namespace {

using nlohmann::ordered_json;

TEST(JsonText, KeepsShortThingsOnOneLine) {
  EXPECT_EQ(pretty({{"b", {1, 2.5, -3}}, {"a", nullptr}}), R"({"b": [1, 2.5, -3], "a": null})");
  EXPECT_EQ(pretty(ordered_json::object()), "{}");
  EXPECT_EQ(pretty("a\n"), R"("a\n")");
}

TEST(JsonText, BreaksWhatIsTooLong) {
  const std::string word(60, 'x');
  EXPECT_EQ(pretty({{"a", {word, word}}, {"b", {1, 2}}}),
            "{\n  \"a\": [\n    \"" + word + "\",\n    \"" + word + "\"\n  ],\n  \"b\": [1, 2]\n}");
}

TEST(JsonText, IsTheSameDocument) {
  ordered_json document;
  for (int i = 0; i < 50; ++i) document["key \"" + std::to_string(i)] = {{"x", {i, i / 7.0, {{"deep", i}}}}, {"y", ""}};
  EXPECT_EQ(ordered_json::parse(pretty(document)), document);
}

TEST(JsonText, ReplacesBytesThatAreNoUtf8) {
  EXPECT_EQ(pretty(ordered_json{{"name", "a\xff"}}), "{\"name\": \"a\xEF\xBF\xBD\"}");
}

}  // namespace
}  // namespace proto
