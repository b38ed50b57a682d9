#include "engine/core/parallel.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

namespace engine {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnce) {
  std::vector<int> visits(1003, 0);
  parallel_for(visits.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++visits[i];
  });
  EXPECT_EQ(visits, std::vector<int>(1003, 1));
}

TEST(ParallelFor, MakesTheSameChunksForAnyNumberOfThreads) {
  auto sums_with = [](int threads) {
    std::vector<float> partial(chunk_count(10'000, 128));
    WorkArena arena(threads);
    arena.run([&] {
      parallel_for(10'000, 128, [&](std::size_t begin, std::size_t end) {
        float sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += 1.0f / float(i + 1);
        partial[begin / 128] = sum;
      });
    });
    return std::accumulate(partial.begin(), partial.end(), 0.0f);
  };
  const float one = sums_with(1);
  EXPECT_EQ(one, sums_with(2));
  EXPECT_EQ(one, sums_with(4));
}

// These two say more under ThreadSanitizer, which has to be told in which order work is handed over.
TEST(ParallelFor, HandsMemoryToItsWorkAndBack) {
  WorkArena arena(4);
  for (int round = 0; round < 20; ++round) {
    SCOPED_TRACE(round);
    auto input = std::make_unique<std::vector<int>>(1000, round);
    std::vector<std::vector<int>> output(32);
    arena.run([&] {
      parallel_for(output.size(), 1, [&](std::size_t chunk, std::size_t) {
        output[chunk].resize(input->size());
        parallel_for(input->size(), 100, [&](std::size_t begin, std::size_t end) {
          for (std::size_t i = begin; i < end; ++i) output[chunk][i] = (*input)[i] + int(chunk);
        });
      });
    });
    input.reset();
    for (std::size_t chunk = 0; chunk < output.size(); ++chunk)
      EXPECT_EQ(output[chunk], std::vector<int>(1000, round + int(chunk)));
  }
}

TEST(WorkArena, ServesMoreCallersThanItHasThreads) {
  WorkArena arena(2);
  std::vector<std::thread> callers;
  std::vector<std::size_t> sums(5);
  for (std::size_t caller = 0; caller < sums.size(); ++caller)
    callers.emplace_back([&arena, &sum = sums[caller], caller] {
      for (int round = 0; round < 20; ++round) {
        std::vector<std::size_t> partial(100);
        arena.run(
            [&] { parallel_for(partial.size(), 1, [&](std::size_t i, std::size_t) { partial[i] = i * caller; }); });
        sum += std::accumulate(partial.begin(), partial.end(), std::size_t{0});
      }
    });
  for (std::thread& caller : callers) caller.join();
  for (std::size_t caller = 0; caller < sums.size(); ++caller) EXPECT_EQ(sums[caller], 20 * 4950 * caller);
}

TEST(ParallelFor, DoesNothingForNoItems) {
  parallel_for(0, 16, [](std::size_t, std::size_t) { FAIL() << "called"; });
}

TEST(WorkArena, HasTheThreadsAskedForAtAnyPriority) {
  for (const Priority priority : {Priority::low, Priority::normal, Priority::high}) {
    WorkArena arena(3, priority);
    EXPECT_EQ(arena.threads(), 3);
    std::atomic<int> visits = 0;
    arena.run([&] { parallel_for(100, 1, [&](std::size_t, std::size_t) { ++visits; }); });
    EXPECT_EQ(visits, 100);
  }
}

TEST(WorkArena, ThreadsKeepThePriorityOfTheOneThatStartedThem) {
  const auto niceness = [] { return ::getpriority(PRIO_PROCESS, 0); };  // on Linux, of the calling thread
  WorkArena arena(3);
  arena.start_threads();
  const int usual = niceness();
  std::mutex mutex;
  std::map<std::thread::id, int> seen;
  std::thread polite([&] {
    ASSERT_EQ(::setpriority(PRIO_PROCESS, 0, usual + 3), 0);
    arena.run([&] {
      parallel_for(300, 1, [&](std::size_t, std::size_t) {
        const std::lock_guard lock(mutex);
        seen[std::this_thread::get_id()] = niceness();
      });
    });
    seen.erase(std::this_thread::get_id());
  });
  polite.join();
  for (const auto& [thread, value] : seen) EXPECT_EQ(value, usual);
}

TEST(WorkArena, WorkOfHighPriorityIsDoneWhileALongJobOfLowPriorityGoesOn) {
  WorkArena low(2, Priority::low), high(2, Priority::high);
  std::atomic<bool> started = false, stop = false;
  std::thread job([&] {
    low.run([&] {
      parallel_for(1'000'000'000, 1'000'000, [&](std::size_t, std::size_t) {
        started = true;
        if (!stop) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      });
    });
  });
  while (!started) std::this_thread::yield();
  std::atomic<int> visits = 0;
  high.run([&] { parallel_for(64, 1, [&](std::size_t, std::size_t) { ++visits; }); });
  EXPECT_EQ(visits, 64);
  stop = true;
  job.join();
}

TEST(ParallelFor, LetsAnExceptionOut) {
  EXPECT_THROW(parallel_for(100, 1,
                            [](std::size_t begin, std::size_t) {
                              if (begin == 57) throw std::runtime_error("57");
                            }),
               std::runtime_error);
}

}  // namespace
}  // namespace engine
