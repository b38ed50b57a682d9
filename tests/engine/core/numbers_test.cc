#include "engine/core/numbers.h"

#include <gtest/gtest.h>

#include <limits>

namespace engine {
namespace {

TEST(NumberIn, ReadsATextThatIsANumberAndNothingElse) {
  EXPECT_EQ(number_in<int>("0"), 0);
  EXPECT_EQ(number_in<int>("-12"), -12);
  EXPECT_EQ(number_in<std::uint64_t>("18446744073709551615"), std::numeric_limits<std::uint64_t>::max());
  for (const char* text : {"", " 1", "1 ", "+1", "1x", "x", "1.0", "-1", "18446744073709551616"})
    EXPECT_FALSE(number_in<std::uint64_t>(text)) << text;
}

TEST(NumberedId, IsReadBackAsItIsWritten) {
  EXPECT_EQ(numbered_id('s', 7), "s000007");
  EXPECT_EQ(numbered_id('s', 1'234'567), "s1234567");
  for (const std::uint64_t number : {std::uint64_t{0}, std::uint64_t{999'999}, std::uint64_t{1'000'000}})
    EXPECT_EQ(number_of_id('s', numbered_id('s', number)), number);
  for (const char* text : {"", "s", "s1", "s0000001", "e000001", "s00001x", "s-00001", "s99999999999999999999", "../x"})
    EXPECT_FALSE(number_of_id('s', text)) << text;
}

}  // namespace
}  // namespace engine
