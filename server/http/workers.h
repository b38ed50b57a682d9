// A bounded set of threads that answer requests, and the lines in which requests wait for one.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/http/visit.h"

namespace server::http {

struct WorkerLimits {
  std::size_t threads = 64;          ///< Requests answered at a time.
  std::size_t max_waiting = 256;     ///< Requests that may wait for a thread, and as many uploads for theirs.
  std::size_t max_uploads = 16;      ///< Threads that may wait for the body of a request; one at least has other work.
  std::size_t max_per_client = 192;  ///< Requests of one client that are answered or wait, beside its streams.
};

/// Whose turn it is: of those that wait, the first of a client for whom the least is being done. A thread costs what it
/// has to compute, not what its client makes it wait for: only uploads and streams of events wait on a thread, uploads
/// up to a number, streams on threads beside the others. Safe to call from any thread.
class Workers {
 public:
  enum class Kind {
    vital,     ///< A request that is answered although all are busy, whoever asks, by a thread that does nothing else.
    request,   ///< Another request, which may be turned away.
    going_on,  ///< A request that has been let in and goes on.
    upload     ///< A request that has been let in and waits for its body, on its thread.
  };
  using Serve = std::function<void(Visit&)>;

  ///   make_server  called once for each thread; what it returns serves visits, and says by their `next` how they go on
  ///   hand_on      gets the visits that were served
  ///   count        told how many more wait, or fewer
  Workers(const WorkerLimits& limits, std::function<Serve()> make_server,
          std::function<void(std::unique_ptr<Visit>)> hand_on, std::function<void(int)> count);
  ~Workers();

  /// Hands a visit over. Threads are started as they are needed.
  ///   returns  false: too many wait, too many of this client are here, the system gives no thread, or the lines are
  ///            closed; the visit stays the caller's. `going_on` and `upload` are refused only by the last two.
  [[nodiscard]] bool offer(Kind kind, std::unique_ptr<Visit>& visit);
  /// Whether so many uploads wait that another one should be turned away.
  [[nodiscard]] bool uploads_are_full() const;
  /// The worker who serves this visit will wait for its client for long: another thread takes its place.
  void step_aside(Visit& visit);
  /// Cuts the connections being served and ends those that wait. New ones are taken.
  void cut();
  /// Ends the intake and the connections that wait.
  void close();

 private:
  struct Load {
    std::size_t waiting = 0, served = 0, aside = 0, uploads = 0;  ///< Uploads are served, too; the others are apart.
    [[nodiscard]] bool none() const { return waiting + served + aside == 0; }
  };
  using Loads = std::map<std::string, Load>;
  struct Errand {
    Kind kind;
    Loads::iterator load;
    std::unique_ptr<Visit> visit;
  };
  using Line = std::list<Errand>;  // errands go from one to another as they are, which takes no memory

  void work(bool reserve, const Serve& server);
  void stand_in_line(Line& line, Kind kind, Loads::iterator load, std::unique_ptr<Visit> visit);
  [[nodiscard]] Line leave_line(Line& line, Line::iterator errand);
  void serve(Line errand, const Serve& server, std::unique_lock<std::mutex>& lock);
  [[nodiscard]] Line::iterator next_in_line();
  [[nodiscard]] std::size_t takeable() const;
  [[nodiscard]] std::size_t upload_share() const;
  [[nodiscard]] bool start_thread(bool reserve);
  void start_if_needed();
  [[nodiscard]] Line empty_lines();
  void forget_if_none(Loads::iterator load);

  const WorkerLimits limits_;
  const std::function<Serve()> make_server_;
  const std::function<void(std::unique_ptr<Visit>)> hand_on_;
  const std::function<void(int)> count_;
  mutable std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_, vital_changed_;
  Line line_, vital_line_;
  Loads loads_;                                     ///< By the client's network.
  std::size_t waiting_ = 0, waiting_uploads_ = 0;   ///< In line_: without uploads, and uploads.
  std::size_t idle_ = 0;                            ///< Threads that serve nobody.
  std::size_t busy_ = 0, uploads_ = 0, aside_ = 0;  ///< Threads that count, those with uploads, and those that do not.
  Line served_;
  bool closed_ = false, has_reserve_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace server::http
