#include "server/service/fair_semaphore.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace server::service {
namespace {

/// Until so many wait.
void await_waiting(const FairSemaphore& semaphore, std::size_t count) {
  while (semaphore.waiting() != count) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST(FairSemaphore, LetsNoMoreInThanItHasSlots) {
  FairSemaphore semaphore(2, 100);
  std::atomic<int> inside{0}, most{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&] {
      const auto slot = semaphore.acquire();
      const int now = ++inside;
      int seen = most;
      while (now > seen && !most.compare_exchange_weak(seen, now)) {
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      --inside;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(most, 2);
}

TEST(FairSemaphore, ServesThoseWhoWaitInTheirOrder) {
  FairSemaphore semaphore(1, 100);
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

/// How often this thread has gone to sleep so far.
long sleeps_of_this_thread() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nvcsw;
}

TEST(FairSemaphore, WakesOnlyTheOneWhoseTurnItIs) {
  constexpr int clients = 32;
  FairSemaphore semaphore(1, clients);
  std::atomic<long> sleeps{0};
  std::vector<std::thread> threads;
  {
    const auto slot = semaphore.acquire();
    ASSERT_TRUE(slot);
    for (int t = 0; t < clients; ++t)
      threads.emplace_back([&] {
        const long before = sleeps_of_this_thread();
        const auto mine = semaphore.acquire();
        sleeps += sleeps_of_this_thread() - before;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));  // for whoever was woken to fall asleep again
      });
    await_waiting(semaphore, clients);
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(sleeps, 4 * clients)
      << "each waits once, and perhaps for a lock; all of them at each turn makes 500 or more";
}

TEST(FairSemaphore, TurnsAwayWhomItCannotSeat) {
  FairSemaphore semaphore(1, 1);
  auto slot = std::make_unique<engine::Result<FairSemaphore::Slot>>(semaphore.acquire());
  std::thread waiting([&] { EXPECT_TRUE(semaphore.acquire()); });
  await_waiting(semaphore, 1);
  const auto refused = semaphore.acquire();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, engine::ErrorCode::busy);
  slot.reset();
  waiting.join();
  EXPECT_TRUE(semaphore.acquire()) << "once there is room again";
}

}  // namespace
}  // namespace server::service
