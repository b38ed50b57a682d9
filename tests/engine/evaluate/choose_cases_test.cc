#include <gtest/gtest.h>

#include "engine/evaluate/cases.h"

namespace engine::evaluate {
namespace {

using Names = std::vector<std::string>;

TEST(ChooseCases, TakesAllWhereNoneIsNamed) { EXPECT_EQ(choose_cases({}, false).value(), case_names()); }

TEST(ChooseCases, KeepsTheOrderAskedFor) {
  EXPECT_EQ(choose_cases({"speck", "slide"}, false).value(), (Names{"speck", "slide"}));
}

TEST(ChooseCases, LeavesOutWhatIsNotSmall) {
  const Names small = choose_cases({}, true).value();
  EXPECT_LT(small.size(), case_names().size());
  for (const std::string& name : small) EXPECT_TRUE(is_small(name)) << name;
  for (const std::string& name : case_names())
    if (!is_small(name)) {
      EXPECT_EQ(choose_cases({name}, true).error().code, ErrorCode::invalid_argument) << name;
    }
}

TEST(ChooseCases, SaysWhichThereAre) {
  const auto none = choose_cases({"slide", "no such case"}, false);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::not_found);
  EXPECT_NE(none.error().message.find("slide"), std::string::npos) << none.error().message;
}

}  // namespace
}  // namespace engine::evaluate
