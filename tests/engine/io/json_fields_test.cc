#include "engine/io/json_fields.h"

#include <gtest/gtest.h>

#include <array>
#include <tuple>

namespace engine::io {
namespace {

TEST(JsonFields, AnswerZeroOnceSomethingIsNotAsAskedFor) {
  const nlohmann::json document = nlohmann::json::parse(R"({"short": [1, 2], "mixed": [1, "two", 3], "no": null})");
  std::optional<Error> error;
  const JsonFields fields(document, "a.json:", error);
  for (const auto& [name, first, last] : {std::tuple{"short", 0.0, 0.0}, {"mixed", 1.0, 3.0}, {"no", 0.0, 0.0}}) {
    std::array<double, 3> numbers{7, 7, 7};
    fields.at(name).numbers(numbers.data(), numbers.size());
    EXPECT_EQ(numbers, (std::array{first, 0.0, last})) << name;
  }
  ASSERT_TRUE(error);
  EXPECT_EQ(error->where, "a.json:short") << "the first counts";
}

}  // namespace
}  // namespace engine::io
