#include "server/http/guess_brake.h"

#include <gtest/gtest.h>

#include <limits>

namespace server::http {
namespace {

using std::chrono::seconds;

const GuessBrake::Clock::time_point start = GuessBrake::Clock::time_point() + seconds(1'000'000);

TEST(GuessBrake, LetsAFewPassAndThenDoublesTheWait) {
  GuessBrake brake;
  auto now = start;
  for (int i = 0; i < 5; ++i) {
    brake.count_wrong("1.2.3.4", "guess " + std::to_string(i), now);
    brake.count_wrong("1.2.3.4", "guess " + std::to_string(i), now);  // again: not counted
    EXPECT_FALSE(brake.must_wait("1.2.3.4", now)) << i;
  }
  for (const int expected : {1, 2, 4, 8, 16, 32, 60, 60}) {
    brake.count_wrong("1.2.3.4", std::to_string(now.time_since_epoch().count()), now);
    EXPECT_EQ(brake.must_wait("1.2.3.4", now), expected);
    EXPECT_FALSE(brake.must_wait("1.2.3.5", now));
    now += seconds(expected);
    EXPECT_FALSE(brake.must_wait("1.2.3.4", now));
  }
  brake.forget("1.2.3.4");
  brake.count_wrong("1.2.3.4", "a", now);
  EXPECT_FALSE(brake.must_wait("1.2.3.4", now));
}

TEST(GuessBrake, ForgetsAndNeverRemembersMoreThanItMay) {
  GuessBrakeOptions options;
  options.free_guesses = 0;
  options.max_addresses = 3;
  GuessBrake brake(options);
  for (int i = 0; i < 100; ++i) brake.count_wrong("10.0.0." + std::to_string(i), "a", start + seconds(i));
  EXPECT_EQ(brake.addresses(), 3u);
  EXPECT_TRUE(brake.must_wait("10.0.0.99", start + seconds(99)));
  brake.count_wrong("1.1.1.1", "a", start + seconds(10'000));
  EXPECT_EQ(brake.addresses(), 1u);
}

TEST(GuessBrake, TakesANetworkOfIpv6ForOneClient) {
  GuessBrakeOptions options;
  options.free_guesses = 0;
  GuessBrake brake(options);
  brake.count_wrong("2001:db8:1:2::7", "a", start);
  EXPECT_TRUE(brake.must_wait("2001:db8:1:2:ffff::1", start));
  EXPECT_FALSE(brake.must_wait("2001:db8:1:3::7", start));
  brake.count_wrong("::ffff:10.0.0.1", "a", start);
  EXPECT_FALSE(brake.must_wait("::ffff:10.0.0.2", start));
}

}  // namespace
}  // namespace server::http
