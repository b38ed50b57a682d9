#include "server/edits/turnstile.h"

#include <gtest/gtest.h>

#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace server::edits {
namespace {

using namespace std::chrono_literals;

TEST(Turnstile, LetsOneInAtATime) {
  Turnstile turnstile(1min);
  int inside = 0;  // which the turnstile guards
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back([&] {
      for (int round = 0; round < 100; ++round) {
        const auto pass = turnstile.enter();
        ASSERT_TRUE(pass);
        EXPECT_EQ(++inside, 1);
        --inside;
      }
    });
}

TEST(Turnstile, TurnsAwayWhoHasWaitedForTooLong) {
  Turnstile turnstile(1ms);
  auto entered = turnstile.enter();
  ASSERT_TRUE(entered);
  std::optional<Turnstile::Pass> pass = std::move(*entered);
  EXPECT_EQ(turnstile.enter().error().code, engine::ErrorCode::unavailable);
  pass.reset();
  EXPECT_TRUE(turnstile.enter());
  EXPECT_TRUE(turnstile.enter()) << "the pass before is gone";
}

}  // namespace
}  // namespace server::edits
