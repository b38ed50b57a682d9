#include "server/service/fair_gate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace server::service {
namespace {

/// Until so many wait.
void await_waiting(const FairGate& gate, std::size_t count) {
  while (gate.waiting() != count) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST(FairGate, LetsNoMoreInThanItHasPlaces) {
  FairGate gate(2, 100);
  std::atomic<int> inside{0}, most{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&] {
      const auto place = gate.enter();
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

TEST(FairGate, ServesThoseWhoWaitInTheirOrder) {
  FairGate gate(1, 100);
  std::vector<int> order;  // written by whoever is inside
  std::vector<std::thread> threads;
  {
    const auto place = gate.enter();
    ASSERT_TRUE(place);
    for (int t = 0; t < 5; ++t) {
      threads.emplace_back([&, t] {
        const auto mine = gate.enter();
        order.push_back(t);
      });
      await_waiting(gate, std::size_t(t) + 1);
    }
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

TEST(FairGate, TurnsAwayWhomItCannotSeat) {
  FairGate gate(1, 1);
  auto place = std::make_unique<engine::Result<FairGate::Place>>(gate.enter());
  std::thread waiting([&] { EXPECT_TRUE(gate.enter()); });
  await_waiting(gate, 1);
  const auto refused = gate.enter();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, engine::ErrorCode::busy);
  place.reset();
  waiting.join();
  EXPECT_TRUE(gate.enter()) << "once there is room again";
}

}  // namespace
}  // namespace server::service
