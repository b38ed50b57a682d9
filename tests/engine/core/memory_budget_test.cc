#include "engine/core/memory_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <optional>
#include <thread>
#include <vector>

namespace engine {
namespace {

using std::chrono::milliseconds;

TEST(MemoryBudget, LendsNoMoreThanItHas) {
  MemoryBudget budget(100, "--work-memory", milliseconds(60'000));
  std::atomic<std::uint64_t> held = 0, most = 0;
  std::vector<std::thread> threads;
  for (std::uint64_t t = 0; t < 8; ++t)
    threads.emplace_back([&, bytes = 20 + 10 * t] {
      const auto share = budget.take(bytes, "a");
      ASSERT_TRUE(share);
      const std::uint64_t now = held += bytes;
      for (std::uint64_t seen = most; seen < now && !most.compare_exchange_weak(seen, now);) continue;
      std::this_thread::sleep_for(milliseconds(3));
      held -= bytes;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(most, 100u);
  EXPECT_EQ(budget.lent(), 0u);
}

TEST(MemoryBudget, RefusesWhatNeverFitsAtOnce) {
  MemoryBudget budget(5 << 20, "--work-memory");
  for (const std::uint64_t bytes : {std::uint64_t{(5 << 20) + 1}, std::numeric_limits<std::uint64_t>::max()}) {
    const auto share = budget.take(bytes, "a.png");
    ASSERT_FALSE(share);
    EXPECT_EQ(share.error().code, ErrorCode::too_large);
    EXPECT_EQ(share.error().where, "a.png");
  }
  EXPECT_EQ(budget.take((5 << 20) + 1, "").error().message,
            "this takes about 6 MiB of memory; the limit (--work-memory) is 5 MiB");
  EXPECT_TRUE(budget.take(5 << 20, "a.png"));
}

TEST(MemoryBudget, LosesPatienceAndLeavesTheLine) {
  MemoryBudget budget(100, "--work-memory", milliseconds(20));
  auto held = std::make_optional(budget.take(60, "a"));
  const auto late = budget.take(50, "b");
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::unavailable);
  EXPECT_EQ(late.error().where, "b");
  EXPECT_TRUE(budget.take(40, "c"));  // whoever gave up stands in nobody's way
  held.reset();
  EXPECT_TRUE(budget.take(100, "d"));
}

TEST(MemoryBudget, LetsNobodyPassALargeRequest) {
  MemoryBudget budget(100, "--work-memory", milliseconds(60'000));
  auto first = std::make_optional(budget.take(60, "a"));
  std::atomic<int> order = 0, large = 0, small = 0;
  std::thread one([&] {
    const auto share = budget.take(100, "b");
    large = ++order;
  });
  std::this_thread::sleep_for(milliseconds(20));
  std::thread two([&] {
    const auto share = budget.take(10, "c");  // there is room for it, but it came later
    small = ++order;
  });
  std::this_thread::sleep_for(milliseconds(20));
  EXPECT_EQ(order, 0);
  first.reset();
  one.join(), two.join();
  EXPECT_EQ(large, 1);
  EXPECT_EQ(small, 2);
}

TEST(MemoryBudget, OfNothingIsNoLimit) {
  MemoryBudget budget(0);
  EXPECT_TRUE(budget.take(std::numeric_limits<std::uint64_t>::max(), "a"));
  EXPECT_TRUE(take_from(nullptr, std::numeric_limits<std::uint64_t>::max(), "a"));
}

}  // namespace
}  // namespace engine
