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

class ThreadLine {
 public:
  /// Serves one connection, given its socket, which it closes.
  using Serve = std::function<void(int socket)>;

  ///   make_server  called once by each thread, for what it serves with
  ThreadLine(std::size_t max_threads, std::size_t max_waiting, std::function<Serve()> make_server);
  ~ThreadLine();

  /// Hands a connection over. Threads are started as they are needed.
  ///   returns  false: all threads are busy and the line is full, or the line is closed; the socket stays the caller's
  [[nodiscard]] bool offer(int socket);
  /// Whether a connection waits.
  [[nodiscard]] bool crowded() const { return waiting_count_ > 0; }
  /// Takes no more connections, closes those that wait.
  void close();
  /// Whether all threads come to rest before `timeout`. After close().
  [[nodiscard]] bool rests_within(std::chrono::milliseconds timeout);

 private:
  void work();

  const std::size_t max_threads_, max_waiting_;
  const std::function<Serve()> make_server_;
  std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  std::deque<int> waiting_;
  std::atomic<std::size_t> waiting_count_ = 0;  ///< Of waiting_; read without the lock.
  std::size_t idle_ = 0, serving_ = 0;
  bool closed_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace server::http
