#include "engine/core/file_lock.h"

#include <gtest/gtest.h>

#include <optional>
#include <thread>

#include "tests/support/child.h"
#include "tests/support/data.h"

namespace engine {
namespace {

using namespace std::chrono_literals;
using support::Child;

class FileLockTest : public testing::Test {
 protected:
  [[nodiscard]] Result<FileLock> take(std::uint64_t number, LockKind kind, std::chrono::milliseconds patience = 0ms) {
    return FileLock::take(folder.path() / "locks", number, kind, patience);
  }
  support::TempDir folder;
};

TEST_F(FileLockTest, KeepsOthersOutOfItsNumberAlone) {
  auto first = std::make_optional(take(7, LockKind::alone));
  ASSERT_TRUE(*first);
  EXPECT_EQ(take(7, LockKind::alone).error().code, ErrorCode::busy);
  EXPECT_EQ(take(7, LockKind::shared).error().code, ErrorCode::busy);
  EXPECT_TRUE(take(8, LockKind::alone));
  first.reset();
  EXPECT_TRUE(take(7, LockKind::alone));
}

TEST_F(FileLockTest, IsSharedByThoseWhoWantNoMore) {
  auto first = std::make_optional(take(0, LockKind::shared)), second = std::make_optional(take(0, LockKind::shared));
  ASSERT_TRUE(*first && *second);
  first.reset();
  EXPECT_FALSE(take(0, LockKind::alone)) << "the other still holds it";
  second.reset();
  EXPECT_TRUE(take(0, LockKind::alone));
}

TEST_F(FileLockTest, IsWaitedFor) {
  auto held = std::make_optional(take(1, LockKind::alone));
  std::thread waits([&] { EXPECT_TRUE(take(1, LockKind::alone, 60s)); });
  std::this_thread::sleep_for(10ms);
  held.reset();
  waits.join();
}

TEST_F(FileLockTest, OfAKilledProcessIsFreeAndOfAHaltedOneIsNot) {
  const Child child([&](const Child& self) {
    const auto lock = take(1, LockKind::alone);
    self.say(lock ? 'y' : 'n');
    self.listen();
  });
  ASSERT_EQ(child.hear(), 'y');
  child.signal(SIGSTOP);
  EXPECT_EQ(take(1, LockKind::shared).error().code, ErrorCode::busy);
  child.kill();
  EXPECT_FALSE(child.ended_well());
  EXPECT_TRUE(take(1, LockKind::alone));
}

TEST_F(FileLockTest, NamesAFolderThatIsNotThere) {
  EXPECT_EQ(FileLock::take(folder.path() / "no/locks", 1, LockKind::alone, 0ms).error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace engine
