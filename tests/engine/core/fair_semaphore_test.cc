#include "engine/core/fair_semaphore.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

namespace engine {
namespace {

using namespace std::chrono_literals;

/// Until so many wait.
void await_waiting(const FairSemaphore& semaphore, std::size_t count) {
  while (semaphore.waiting() != count) std::this_thread::sleep_for(1ms);
}

TEST(FairSemaphore, LetsNoMoreInThanItHasSlots) {
  FairSemaphore semaphore({.slots = 2}, "things");
  std::atomic<int> inside{0}, most{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&] {
      const auto slot = semaphore.acquire();
      const int now = ++inside;
      int seen = most;
      while (now > seen && !most.compare_exchange_weak(seen, now)) {
      }
      std::this_thread::sleep_for(5ms);
      --inside;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(most, 2);
}

TEST(FairSemaphore, ServesThoseWhoWaitInTheirOrder) {
  FairSemaphore semaphore({}, "things");
  std::vector<int> order;  // written by whoever is inside
  std::vector<std::thread> threads;
  {
    const auto slot = semaphore.acquire();
    ASSERT_TRUE(slot);
    for (int t = 0; t < 5; ++t) {
      threads.emplace_back([&, t] {
        const auto mine = semaphore.acquire();
        order.push_back(t);
      });
      await_waiting(semaphore, std::size_t(t) + 1);
    }
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

TEST(FairSemaphore, WakesOnlyTheOneWhoseTurnItIs) {
  constexpr std::size_t clients = 32;
  FairSemaphore semaphore({}, "things");
  std::vector<std::thread> threads;
  {
    const auto slot = semaphore.acquire();
    ASSERT_TRUE(slot);
    for (std::size_t t = 0; t < clients; ++t)
      threads.emplace_back([&] {
        const auto mine = semaphore.acquire();
        std::this_thread::sleep_for(2ms);  // for whoever was woken for nothing to fall asleep again
      });
    await_waiting(semaphore, clients);
    EXPECT_EQ(semaphore.wakes(), 0u);
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GE(semaphore.wakes(), clients);
  EXPECT_LE(semaphore.wakes(), 2 * clients) << "all of them at each turn makes 500";  // a system may wake one by itself
}

TEST(FairSemaphore, TurnsAwayWhomItCannotSeat) {
  FairSemaphore semaphore({.waiting = 1}, "things");
  auto slot = std::make_unique<Result<FairSemaphore::Slot>>(semaphore.acquire());
  std::thread waiting([&] { EXPECT_TRUE(semaphore.acquire()); });
  await_waiting(semaphore, 1);
  const auto refused = semaphore.acquire();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::busy);
  slot.reset();
  waiting.join();
  EXPECT_TRUE(semaphore.acquire()) << "once there is room again";
}

TEST(FairSemaphore, TurnsAwayWhoHasWaitedForTooLong) {
  FairSemaphore semaphore({.patience = 1ms}, "things");
  auto slot = std::make_unique<Result<FairSemaphore::Slot>>(semaphore.acquire());
  const auto refused = semaphore.acquire();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unavailable);
  EXPECT_EQ(semaphore.waiting(), 0u) << "who has gone is handed nothing";
  slot.reset();
  EXPECT_TRUE(semaphore.acquire());
  EXPECT_TRUE(semaphore.acquire()) << "the slot before is given back";
}

TEST(FairSemaphore, WhoeverIsPatientEnoughHasItsTurn) {
  FairSemaphore semaphore({.patience = 10min}, "things");
  int inside = 0;  // which the semaphore guards
  std::vector<std::jthread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&] {
      for (int round = 0; round < 100; ++round) {
        const auto slot = semaphore.acquire();
        ASSERT_TRUE(slot);
        EXPECT_EQ(++inside, 1);
        --inside;
      }
    });
}

}  // namespace
}  // namespace engine
