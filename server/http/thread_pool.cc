#include "server/http/thread_pool.h"

#include <unistd.h>

#include <chrono>
#include <system_error>
#include <utility>

namespace server::http {

ThreadPool::ThreadPool(std::size_t max_threads, std::size_t max_waiting, std::function<Serve()> make_server)
    : max_threads_(max_threads), max_waiting_(max_waiting), make_server_(std::move(make_server)) {}

ThreadPool::~ThreadPool() {
  close();
  for (std::thread& thread : threads_) thread.join();
}

bool ThreadPool::offer(int socket) {
  const std::lock_guard lock(mutex_);
  if (closed_) return false;
  const bool will_be_taken = waiting_.size() < idle_;
  if (!will_be_taken && threads_.size() < max_threads_) {
    try {
      threads_.emplace_back([this] { work(); });
      ++idle_;  // until it takes its first connection
    } catch (const std::system_error&) {
      if (threads_.empty()) return false;  // the system gives no threads; those there are must do
    }
  } else if (!will_be_taken && waiting_.size() >= idle_ + max_waiting_) {
    return false;
  }
  waiting_.push_back(socket);
  // Connections that an idle thread is about to take do not count as waiting.
  waiting_count_ = waiting_.size() > idle_ ? waiting_.size() - idle_ : 0;
  changed_.notify_all();
  return true;
}

void ThreadPool::work() {
  const Serve serve = make_server_();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return closed_ || !waiting_.empty(); });
    if (waiting_.empty()) return;  // and closed
    const int socket = waiting_.front();
    waiting_.pop_front();
    --idle_;
    ++serving_;
    waiting_count_ = waiting_.size() > idle_ ? waiting_.size() - idle_ : 0;
    lock.unlock();
    serve(socket);
    lock.lock();
    ++idle_;
    --serving_;
    waiting_count_ = waiting_.size() > idle_ ? waiting_.size() - idle_ : 0;
    changed_.notify_all();
  }
}

void ThreadPool::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (const int socket : waiting_) ::close(socket);
  waiting_.clear();
  waiting_count_ = 0;
  changed_.notify_all();
}

bool ThreadPool::idle_within(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [&] { return serving_ == 0; });
}

}  // namespace server::http
