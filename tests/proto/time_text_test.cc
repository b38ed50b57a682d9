#include "proto/time_text.h"

#include <gtest/gtest.h>

namespace proto {
namespace {

using namespace std::chrono;

TEST(TimeText, WritesRfc3339InUtcWithMilliseconds) {
  EXPECT_EQ(rfc3339(sys_time<milliseconds>{}), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(rfc3339(sys_days(2026y / 11 / 21) + 11h + 9min + 38s + 7ms), "2026-11-21T11:09:38.007Z");
  EXPECT_EQ(rfc3339(sys_days(2024y / 2 / 29) + 23h + 59min + 59s + 999ms), "2024-02-29T23:59:59.999Z");
}

TEST(TimeText, CountsBackwardsBefore1970) {
  EXPECT_EQ(rfc3339(sys_time<milliseconds>(-1ms)), "1969-12-31T23:59:59.999Z");
}

}  // namespace
}  // namespace proto
