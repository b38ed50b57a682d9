#include "engine/jobs/postgres_listener.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <exception>
#include <string>
#include <utility>

namespace engine::jobs {
namespace {

constexpr int try_again_ms = 1000;
constexpr int forever = -1;

}  // namespace

PostgresListener::PostgresListener(PostgresAddress address, const std::atomic<int>& own_process,
                                   std::function<void()> news)
    : connection_(std::move(address)),
      own_process_(own_process),
      news_(std::move(news)),
      end_(::eventfd(0, EFD_CLOEXEC)),
      thread_([this] { loop(); }) {}

PostgresListener::~PostgresListener() {
  constexpr std::uint64_t once = 1;
  // It cannot fail: the counter is far from its end.
  (void)!::write(end_.get(), &once, sizeof once);
  thread_.join();
}

void PostgresListener::loop() {
  do {
    try {
      listen();
      return;
    } catch (const std::exception&) {
      connection_.close();  // whoever works with the store meets the error, and tells of it
    }
  } while (wait(/*socket=*/-1, try_again_ms));
}

void PostgresListener::listen() {
  connection_.open();
  connection_.execute(std::string("LISTEN ") + news_channel);
  news_();  // what there was meanwhile, nobody has heard
  while (wait(connection_.socket(), forever))
    if (connection_.take_notifications(own_process_)) news_();
}

bool PostgresListener::wait(int socket, int milliseconds) const {
  std::array<pollfd, 2> files{pollfd{.fd = end_.get(), .events = POLLIN, .revents = 0},
                              pollfd{.fd = socket, .events = POLLIN, .revents = 0}};  // -1: poll() passes it over
  ::poll(files.data(), files.size(), milliseconds);
  return files.front().revents == 0;
}

}  // namespace engine::jobs
