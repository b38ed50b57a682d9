// Where connections wait that need no thread: one loop accepts them, reads heads and small bodies, and knows when a
// client takes more of its answer.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"
#include "server/http/places.h"
#include "server/http/unsent_bytes.h"
#include "server/http/visit.h"

namespace server::http {

struct LobbyOptions {
  std::size_t max_connections = 1024;            ///< Open at a time, with those of the workers.
  std::size_t max_connections_per_client = 256;  ///< Of one network; 0: no limit but the other one.
  /// Of answers in memory that clients are slow to take, with the lobby or in line for a worker. What workers' threads
  /// hold comes on top: one answer each.
  std::uint64_t max_unsent_bytes = std::uint64_t{512} << 20;
  ConnectionLimits connection = {};
};

/// What the lobby asks of the server around it. Called on the lobby's thread: none of it waits.
struct LobbyHooks {
  /// What the visit waited for (its `next`) has come; or it will not, and its connection knows that.
  std::function<void(std::unique_ptr<Visit>)> ready;
  /// Posts an answer to a request that could not be read, or a connection that there is no place for.
  std::function<void(Visit&, const Refusal&)> refuse;
  std::function<void()> count_cut;                   ///< Called for each that is ended to make room for others.
  std::function<void(const std::string&)> complain;  ///< Of what should not happen.
};

class Lobby {
 public:
  using Clock = std::chrono::steady_clock;

  /// A lobby that serves from start() on, until the stop.
  ///   listening  socket, non-blocking
  ///   stop_fd    when it becomes readable, nobody new is let in, and only those go on whose request is under way
  ///   places     outlives the lobby and all visits
  ///   errors     unavailable: the process may open, or watch, no more files
  [[nodiscard]] static engine::Result<std::unique_ptr<Lobby>> open(engine::FileDescriptor listening, int stop_fd,
                                                                   const LobbyOptions& options, Places& places,
                                                                   LobbyHooks hooks);
  ~Lobby();

  /// To be called once, when what the hooks use is there: they may use the lobby.
  void start();
  /// Has a visit wait for what its `next` says. From any thread. After end(), it ends.
  void take(std::unique_ptr<Visit> visit);
  /// Ends all visits that wait here.
  void cut();
  /// Ends the loop and all visits that wait here.
  void end();

 private:
  /// A visit that waits.
  struct Guest {
    std::unique_ptr<Visit> visit;
    Clock::time_point since;  ///< When the wait began.
    Clock::time_point due;    ///< When its time is over.
    bool head_has_begun = false;
  };
  using Guests = std::map<int, Guest>;  // by socket
  using HeadText = tl::expected<std::optional<std::string>, Refusal>;

  Lobby(engine::FileDescriptor listening, int stop_fd, const LobbyOptions& options, Places& places, LobbyHooks hooks)
      : listening_(std::move(listening)),
        stop_fd_(stop_fd),
        options_(options),
        places_(places),
        hooks_(std::move(hooks)) {}

  void run();
  template <class Step>
  void survive(const Step& step, int socket = -1);
  [[nodiscard]] int milliseconds_to_wait() const;
  [[nodiscard]] bool watch(int descriptor, unsigned events) const;
  void watch_no_more(int descriptor) const;
  void wake() const;
  void take_those_handed_in();
  void accept_some();
  void accept(int socket);
  [[nodiscard]] bool make_room(const std::string& network);
  void bound_unsent_bytes(int newest);
  void let_in(std::unique_ptr<Visit> visit);
  void seat(std::unique_ptr<Visit> visit, unsigned events, Clock::time_point due);
  void set_due(Guests::iterator guest, Clock::time_point due);
  [[nodiscard]] std::unique_ptr<Visit> unseat(Guests::iterator guest);
  void cut_off(Guests::iterator guest);
  void refuse(std::unique_ptr<Visit> visit, const Refusal& refusal);
  void go_on_with(std::unique_ptr<Visit> visit, const HeadText& text);
  void serve(int socket);
  void read_head(Guests::iterator guest);
  void read_body(Guests::iterator guest);
  void end_those_whose_time_is_over();
  void end_wait(Guests::iterator guest);
  void close_doors();

  engine::FileDescriptor listening_;
  const int stop_fd_;
  const LobbyOptions options_;
  Places& places_;
  const LobbyHooks hooks_;
  engine::FileDescriptor epoll_, wake_;
  Guests guests_;
  std::set<std::pair<Clock::time_point, int>> by_due_;
  /// Of the answers of guests, and of those that were: what waits in line for a worker is held as well.
  UnsentBytes unsent_bytes_;
  Clock::time_point accept_again_ = Clock::time_point::max();  ///< Nobody is let in until then.
  bool doors_closed_ = false;

  std::mutex mutex_;  ///< Guards what follows.
  std::vector<std::unique_ptr<Visit>> handed_in_;
  bool ended_ = false, cut_ = false;

  std::thread thread_;  ///< Last: it uses all of the above.
};

}  // namespace server::http
