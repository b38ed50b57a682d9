#include "server/scenes/disk/bounded_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>

namespace server::scenes {
namespace {

using engine::ErrorCode;
using engine::fail;

BoundedCache::CachedObject number(int value, std::uint64_t bytes) {
  return {std::make_shared<const int>(value), bytes};
}

/// Asks for a number; -1 on an error.
int ask(BoundedCache& cache, const std::string& name, std::uint64_t bytes, int value, int* makings = nullptr) {
  const auto got = cache.get<int>(name, bytes, [&]() -> Result<BoundedCache::CachedObject> {
    if (makings) ++*makings;
    return number(value, bytes);
  });
  return got ? **got : -1;
}

TEST(BoundedCache, MakesAThingOnce) {
  BoundedCache cache(100, "memory", WhenFull::refuse);
  int makings = 0;
  EXPECT_EQ(ask(cache, "a", 10, 7, &makings), 7);
  EXPECT_EQ(ask(cache, "a", 10, 8, &makings), 7);
  EXPECT_EQ(makings, 1);
  EXPECT_EQ(cache.used(), 10u);
}

TEST(BoundedCache, DropsWhatWasAskedForLongestAgo) {
  BoundedCache cache(30, "memory", WhenFull::refuse);
  (void)ask(cache, "a", 10, 1), (void)ask(cache, "b", 10, 2), (void)ask(cache, "c", 10, 3);
  (void)ask(cache, "a", 10, 1);
  EXPECT_EQ(ask(cache, "d", 10, 4), 4);
  EXPECT_NE(cache.find<int>("a"), nullptr);
  EXPECT_EQ(cache.find<int>("b"), nullptr);
  EXPECT_EQ(cache.used(), 30u);
}

TEST(BoundedCache, KeepsWhatSomebodyHolds) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  const auto held = cache.get<int>("a", 10, [] { return Result<BoundedCache::CachedObject>(number(1, 10)); });
  (void)ask(cache, "b", 10, 2);
  EXPECT_EQ(ask(cache, "c", 10, 3), 3);
  EXPECT_NE(cache.find<int>("a"), nullptr);
  EXPECT_EQ(cache.find<int>("b"), nullptr);
  EXPECT_EQ(ask(cache, "d", 20, 4), -1);
}

TEST(BoundedCache, NamesItsLimit) {
  BoundedCache cache(20, "the memory of scenes", WhenFull::refuse);
  const auto refused = cache.get<int>("a", 21, [] { return Result<BoundedCache::CachedObject>(number(1, 21)); });
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::too_large);
  EXPECT_NE(refused.error().message.find("the memory of scenes"), std::string::npos);
}

TEST(BoundedCache, KeepsWhatCannotBeMadeAgainLongest) {
  BoundedCache cache(30, "memory", WhenFull::refuse);
  cache.put("preview", {number(1, 10).object, 10, false}, cache.reserve(10).value());
  (void)ask(cache, "a", 10, 1), (void)ask(cache, "b", 10, 2);
  (void)ask(cache, "c", 20, 3);
  EXPECT_NE(cache.find<int>("preview"), nullptr);
  EXPECT_EQ(cache.find<int>("a"), nullptr);
  (void)ask(cache, "d", 30, 4);
  EXPECT_EQ(cache.find<int>("preview"), nullptr);
}

TEST(BoundedCache, ExceedsABudgetThatIsOnlyAConvenience) {
  BoundedCache cache(20, "downloads", WhenFull::exceed);
  const auto held = cache.get<int>("a", 50, [] { return Result<BoundedCache::CachedObject>(number(1, 50)); });
  EXPECT_TRUE(held);
  EXPECT_EQ(ask(cache, "b", 5, 2), 2);
}

TEST(BoundedCache, CountsWhatIsForgottenForAsLongAsItIsHeld) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  auto held = cache.get<int>("s1/a", 10, [] { return Result<BoundedCache::CachedObject>(number(1, 10)); });
  (void)ask(cache, "s1/b", 5, 2), (void)ask(cache, "s2/a", 5, 3);
  EXPECT_EQ(cache.used_by("s1/"), 15u);
  cache.forget("s1/");
  EXPECT_EQ(cache.find<int>("s1/a"), nullptr);
  EXPECT_NE(cache.find<int>("s2/a"), nullptr);
  EXPECT_EQ(cache.used(), 15u);
  held->reset();
  EXPECT_EQ(cache.used(), 5u);
}

TEST(BoundedCache, TakesRoomForAWhile) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  {
    const auto reservation = cache.reserve(15);
    ASSERT_TRUE(reservation);
    EXPECT_EQ(ask(cache, "a", 10, 1), -1);
  }
  EXPECT_EQ(ask(cache, "a", 10, 1), 1);
}

TEST(BoundedCache, TellsMemoryThatOthersUseFromMemoryThereIsNot) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  const auto held = cache.reserve(15).value();
  EXPECT_EQ(cache.reserve(6).error().code, ErrorCode::busy);
  EXPECT_EQ(cache.reserve(21).error().code, ErrorCode::too_large);
  EXPECT_EQ(cache.reserve(~std::uint64_t{0}).error().code, ErrorCode::too_large);
}

TEST(BoundedCache, DropsNothingForWhatDoesNotFitAnyway) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  (void)ask(cache, "a", 10, 1);
  const auto held = cache.reserve(5).value();
  EXPECT_FALSE(cache.reserve(16));
  EXPECT_NE(cache.find<int>("a"), nullptr);
  EXPECT_TRUE(cache.reserve(15));
}

TEST(BoundedCache, TakesOverWhatWasMadeInRoomTakenBefore) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  auto reservation = cache.reserve(15).value();
  cache.put("a", number(7, 10), std::move(reservation));
  EXPECT_EQ(cache.used(), 10u);
  cache.put("a", number(8, 10), cache.reserve(10).value());
  EXPECT_EQ(ask(cache, "a", 10, 9), 7) << "the first one stays";
  EXPECT_EQ(cache.used(), 10u);
}

TEST(BoundedCache, ForgetsAFailureAndItsReservation) {
  BoundedCache cache(20, "memory", WhenFull::refuse);
  const auto failed = cache.get<int>(
      "a", 15, []() -> Result<BoundedCache::CachedObject> { return fail(ErrorCode::corrupt_data, "cut short", "x"); });
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().where, "x");
  const auto thrown =
      cache.get<int>("a", 15, []() -> Result<BoundedCache::CachedObject> { throw std::runtime_error("odd"); });
  ASSERT_FALSE(thrown);
  EXPECT_EQ(thrown.error().code, ErrorCode::internal);
  EXPECT_EQ(thrown.error().message.find("odd"), std::string::npos) << "a library's words are not for clients";
  EXPECT_EQ(cache.used(), 0u);
  EXPECT_EQ(ask(cache, "a", 15, 9), 9);
}

TEST(BoundedCache, LetsOthersWaitForOneMaking) {
  BoundedCache cache(100, "memory", WhenFull::refuse);
  std::atomic<int> makings{0}, right{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      const auto got = cache.get<int>("a", 10, [&]() -> Result<BoundedCache::CachedObject> {
        ++makings;
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return number(5, 10);
      });
      if (got && **got == 5) ++right;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(makings, 1);
  EXPECT_EQ(right, 4);
}

TEST(BoundedCache, DoesNotKeepWhatIsForgottenWhileItIsMade) {
  BoundedCache cache(100, "memory", WhenFull::refuse);
  const auto got = cache.get<int>("s1/a", 10, [&]() -> Result<BoundedCache::CachedObject> {
    cache.forget("s1/");
    return number(5, 10);
  });
  ASSERT_TRUE(got);
  EXPECT_EQ(cache.find<int>("s1/a"), nullptr);
  EXPECT_EQ(cache.used(), 10u) << "it is held";
}

}  // namespace
}  // namespace server::scenes
