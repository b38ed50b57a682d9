#include "server/edits/named_locks.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>
#include <vector>

namespace server::edits {
namespace {

using namespace std::chrono_literals;

TEST(NamedLocks, SharedLocksDoNotWaitForEachOther) {
  NamedLocks locks;
  const auto one = locks.lock_shared("a");
  const auto two = locks.lock_shared("a");
  const auto other = locks.lock("b");
}

TEST(NamedLocks, AnExclusiveLockIsAlone) {
  NamedLocks locks;
  int owners = 0, sharers = 0;  // plain: the sanitizer sees who is not kept apart
  std::atomic<int> sharing = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 200; ++i) {
        if (t % 2 == 0) {
          const auto lock = locks.lock("a");
          EXPECT_EQ(sharing, 0);
          ++owners;
          sharers = 0;
        } else {
          const auto lock = locks.lock_shared("a");
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

TEST(NamedLocks, AWaitingExclusiveLockIsNotOvertakenByNewSharedOnes) {
  NamedLocks locks;
  std::atomic<bool> owned = false, shared_late = false;
  std::optional<NamedLocks::Lock> first(locks.lock_shared("a"));
  std::thread owner([&] {
    const auto lock = locks.lock("a");
    EXPECT_FALSE(shared_late);
    owned = true;
  });
  std::this_thread::sleep_for(20ms);
  std::thread sharer([&] {
    const auto lock = locks.lock_shared("a");
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

TEST(NamedLocks, AMovedLockIsReleasedOnce) {
  NamedLocks locks;
  {
    auto lock = locks.lock("a");
    const auto moved = std::move(lock);
  }
  const auto again = locks.lock("a");
}

}  // namespace
}  // namespace server::edits
