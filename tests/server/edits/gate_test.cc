#include "server/edits/gate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>
#include <vector>

namespace server::edits {
namespace {

using namespace std::chrono_literals;

TEST(Gate, SharersDoNotWaitForEachOther) {
  Gate gate;
  const auto one = gate.share("a");
  const auto two = gate.share("a");
  const auto other = gate.own("b");
}

TEST(Gate, AnOwnerIsAlone) {
  Gate gate;
  int owners = 0, sharers = 0;  // plain: the sanitizer sees who is not kept apart
  std::atomic<int> sharing = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 200; ++i) {
        if (t % 2 == 0) {
          const auto hold = gate.own("a");
          EXPECT_EQ(sharing, 0);
          ++owners;
          sharers = 0;
        } else {
          const auto hold = gate.share("a");
          ++sharing;
          EXPECT_GE(owners, 0);
          --sharing;
        }
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(owners, 600);
  EXPECT_EQ(sharers, 0);
}

TEST(Gate, AWaitingOwnerIsNotOvertakenByNewSharers) {
  Gate gate;
  std::atomic<bool> owned = false, shared_late = false;
  std::optional<Gate::Hold> first(gate.share("a"));
  std::thread owner([&] {
    const auto hold = gate.own("a");
    EXPECT_FALSE(shared_late);
    owned = true;
  });
  std::this_thread::sleep_for(20ms);
  std::thread sharer([&] {
    const auto hold = gate.share("a");
    EXPECT_TRUE(owned);
    shared_late = true;
  });
  std::this_thread::sleep_for(20ms);
  EXPECT_FALSE(owned);
  EXPECT_FALSE(shared_late);
  first.reset();
  owner.join();
  sharer.join();
  EXPECT_TRUE(shared_late);
}

TEST(Gate, AMovedHoldIsReleasedOnce) {
  Gate gate;
  {
    auto hold = gate.own("a");
    const auto moved = std::move(hold);
  }
  const auto again = gate.own("a");
}

}  // namespace
}  // namespace server::edits
