#include "engine/core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <thread>

namespace engine {

void parallel_for(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body) {
  assert(grain > 0);
  const std::size_t chunks = chunk_count(count, grain);
  if (chunks == 0) return;
  if (chunks == 1) return body(0, count);
  tbb::parallel_for(std::size_t{0}, chunks,
                    [&](std::size_t chunk) { body(chunk * grain, std::min(count, (chunk + 1) * grain)); });
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

void WorkArena::run(const std::function<void()>& work) { impl_->arena.execute(work); }
int WorkArena::threads() const { return impl_->arena.max_concurrency(); }

}  // namespace engine
