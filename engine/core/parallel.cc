#include "engine/core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <chrono>
#include <thread>

#ifdef SPLATDRAG_TSAN
#include <sanitizer/tsan_interface.h>
#endif

namespace engine {
namespace {

/// Tells ThreadSanitizer, which does not see how oneTBB hands work from thread to thread, what that promises: all that
/// the caller did comes before the work, and all of the work before what the caller does next. Between two pieces of
/// work it promises nothing, so that a race between them is found. Without the sanitizer this is nothing at all.
class Handover {
 public:
  Handover() { release(begun_); }
  ~Handover() { acquire(ended_); }
  Handover(const Handover&) = delete;
  Handover& operator=(const Handover&) = delete;

  /// Lives as long as a piece of the work goes on, on whichever thread, however it ends.
  class Work {
   public:
    explicit Work(Handover& handover) : handover_(handover) { acquire(handover_.begun_); }
    ~Work() { release(handover_.ended_); }
    Work(const Work&) = delete;
    Work& operator=(const Work&) = delete;

   private:
    Handover& handover_;
  };

 private:
#ifdef SPLATDRAG_TSAN
  static void release(char& moment) { __tsan_release(&moment); }
  static void acquire(char& moment) { __tsan_acquire(&moment); }
#else
  static void release(char&) {}
  static void acquire(char&) {}
#endif

  char begun_ = 0, ended_ = 0;  // only their addresses count
};

}  // namespace

void parallel_for(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body) {
  assert(grain > 0);
  const std::size_t chunks = chunk_count(count, grain);
  if (chunks == 0) return;
  if (chunks == 1) return body(0, count);
  Handover handover;
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const Handover::Work piece(handover);
    body(chunk * grain, std::min(count, (chunk + 1) * grain));
  });
}

struct WorkArena::Impl {
  Impl(int threads, tbb::task_arena::priority priority)
      : limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads)),
        arena(threads, /*reserved_for_masters=*/1, priority) {}
  // Without this, oneTBB would not start more workers than there are cores, and a test on two cores could not
  // check what four threads do.
  tbb::global_control limit;
  tbb::task_arena arena;
};

namespace {

tbb::task_arena::priority priority_of(Priority priority) {
  switch (priority) {
    case Priority::low:
      return tbb::task_arena::priority::low;
    case Priority::normal:
      return tbb::task_arena::priority::normal;
    case Priority::high:
      return tbb::task_arena::priority::high;
  }
  return tbb::task_arena::priority::normal;
}

int resolved(int threads) { return threads > 0 ? threads : std::max(1, int(std::thread::hardware_concurrency())); }

}  // namespace

WorkArena::WorkArena(int threads, Priority priority)
    : impl_(std::make_unique<Impl>(resolved(threads), priority_of(priority))) {}
WorkArena::~WorkArena() = default;
WorkArena::WorkArena(WorkArena&&) noexcept = default;
WorkArena& WorkArena::operator=(WorkArena&&) noexcept = default;

void WorkArena::run(const std::function<void()>& work) {
  Handover handover;
  impl_->arena.execute([&] {
    const Handover::Work whole(handover);  // perhaps on another thread: the arena may have no room for this one
    work();
  });
}

void WorkArena::start_threads() {
  // Nobody leaves before all are there, or else one would do the work of several. A machine that is very busy may take
  // longer than we wait; they then start with the first work.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
  const auto count = std::size_t(threads());
  std::atomic<std::size_t> arrived = 0;
  run([&] {
    parallel_for(count, 1, [&](std::size_t, std::size_t) {
      ++arrived;
      while (arrived < count && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    });
  });
}

int WorkArena::threads() const { return impl_->arena.max_concurrency(); }

}  // namespace engine
