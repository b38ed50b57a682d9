// Waits for the notifications of other processes. Only this room includes this header.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "engine/core/file_descriptor.h"
#include "engine/jobs/postgres_connection.h"

namespace engine::jobs {

inline constexpr const char* news_channel = "splatdrag_jobs";

/// A thread with a connection of its own. Where that is lost it tries again every second, and takes it as news.
class PostgresListener {
 public:
  ///   own_process  the server's process whose notifications are no news; outlives the listener
  PostgresListener(PostgresAddress address, const std::atomic<int>& own_process, std::function<void()> news);
  ~PostgresListener();  ///< Waits for a call of `news` that is on its way.

 private:
  void loop();
  void listen();
  /// Until there is something to read, or the time is over; whether to go on.
  [[nodiscard]] bool wait(int socket, int milliseconds) const;

  PostgresConnection connection_;
  const std::atomic<int>& own_process_;
  const std::function<void()> news_;
  const FileDescriptor end_;  ///< Readable once the thread is to end.
  std::thread thread_;
};

}  // namespace engine::jobs
