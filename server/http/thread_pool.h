// A bounded set of threads, and a bounded line of connections that wait for one.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace server::http {

/// Safe to call from any thread.
class ThreadPool {
 public:
  /// Serves one connection, given its socket, which it closes.
  using Serve = std::function<void(int socket)>;

  ///   max_threads  connections served at a time
  ///   max_waiting  connections that may wait beside
  ///   make_server  called once by each thread; what it returns serves that thread's connections
  ThreadPool(std::size_t max_threads, std::size_t max_waiting, std::function<Serve()> make_server);
  ~ThreadPool();

  /// Hands a connection over. Threads are started as they are needed.
  ///   returns  false: all threads are busy and the line is full, or the line is closed; the socket stays the caller's
  [[nodiscard]] bool offer(int socket);
  /// Whether a connection waits that no idle thread is about to take.
  [[nodiscard]] bool has_waiting() const { return waiting_count_ > 0; }
  /// Ends the intake and closes the connections that wait.
  void close();
  /// Waits until no thread serves a connection; false: some still do after `timeout`. To be called after close().
  [[nodiscard]] bool idle_within(std::chrono::milliseconds timeout);

 private:
  void work();

  const std::size_t max_threads_, max_waiting_;
  const std::function<Serve()> make_server_;
  std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  std::deque<int> waiting_;
  std::atomic<std::size_t> waiting_count_ = 0;  ///< Size of waiting_ beyond idle_; read without the lock.
  std::size_t idle_ = 0, serving_ = 0;
  bool closed_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace server::http
