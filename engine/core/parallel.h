// The only fan-out of the engine. Kernels start no threads of their own.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace engine {

/// Calls body(begin, end) for the chunks [0, grain), [grain, 2 grain), ... of [0, count), on the threads of the
/// current arena, in any order. The chunks depend on count and grain alone, never on the number of threads: a
/// reduction that keeps one partial result per chunk (number begin / grain) and sums them in order gives the same bits
/// for any thread count. An exception thrown by body comes out of parallel_for.
void parallel_for(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body);

/// Number of chunks parallel_for() makes of `count` items.
constexpr std::size_t chunk_count(std::size_t count, std::size_t grain) { return (count + grain - 1) / grain; }

/// Whose work comes first when arenas compete for the threads of the machine.
enum class Priority {
  low,  ///< Jobs that take minutes.
  normal,
  high  ///< Work that somebody waits for at a screen.
};

/// A bounded set of worker threads. Whatever run() executes fans out to at most `threads` of them, the caller included.
class WorkArena {
 public:
  /// threads: 0 means as many as the machine has cores.
  /// priority: threads that become free go to the arena of the highest priority first; a chunk of work that has begun
  /// is finished where it is. While several arenas exist, the smallest `threads` among them limits the workers of all.
  explicit WorkArena(int threads = 0, Priority priority = Priority::normal);
  ~WorkArena();
  WorkArena(WorkArena&&) noexcept;
  WorkArena& operator=(WorkArena&&) noexcept;

  void run(const std::function<void()>& work);
  /// Has its worker threads started now, if they have not been. A thread has the priority of the one that starts it,
  /// for good, and all arenas share their threads: whoever lowers the priority of a thread that works in an arena, so
  /// that only that work comes last, calls this before.
  void start_threads();
  [[nodiscard]] int threads() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine
