#include "server/http/workers.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "server/http/network.h"

namespace server::http {

Workers::Workers(const WorkerLimits& limits, std::function<Serve()> make_server,
                 std::function<void(std::unique_ptr<Visit>)> hand_on, std::function<void(int)> count)
    : limits_(limits), make_server_(std::move(make_server)), hand_on_(std::move(hand_on)), count_(std::move(count)) {}

Workers::~Workers() {
  close();
  for (std::thread& thread : threads_) thread.join();
}

/// Threads that may have uploads: not all, where there are several.
std::size_t Workers::upload_share() const {
  return std::max<std::size_t>(1, std::min(limits_.max_uploads, limits_.threads - 1));
}

bool Workers::uploads_are_full() const {
  const std::lock_guard lock(mutex_);
  return waiting_uploads_ >= limits_.max_waiting + upload_share() - std::min(uploads_, upload_share());
}

/// Of the line, what a thread might take now.
std::size_t Workers::takeable() const {
  return waiting_ + std::min(waiting_uploads_, upload_share() - std::min(uploads_, upload_share()));
}

bool Workers::start_thread(bool reserve) {
  try {
    // Made here: what is thrown on the thread itself would end the process.
    threads_.emplace_back([this, reserve, server = make_server_()] { work(reserve, server); });
    return true;
  } catch (const std::exception&) {
    return false;  // the system gives no more threads, or no memory; those there are must do
  }
}

void Workers::start_if_needed() {
  const std::size_t general = threads_.size() - (has_reserve_ ? 1 : 0);
  if (takeable() > idle_ && general < limits_.threads + aside_ && start_thread(/*reserve=*/false)) ++idle_;
}

bool Workers::offer(Kind kind, std::unique_ptr<Visit>& visit) {
  const std::lock_guard lock(mutex_);
  if (closed_) return false;
  const auto load = loads_.try_emplace(network_of(visit->client)).first;
  const auto refuse = [&] {
    forget_if_none(load);
    return false;
  };
  // What is vital is not: a proxy may ask for it under the address of a client that has all it may have.
  if (kind == Kind::request && load->second.waiting + load->second.served >= limits_.max_per_client) return refuse();
  if (kind == Kind::vital) {
    if (vital_line_.size() > limits_.max_waiting) return refuse();
    if (!has_reserve_ && !start_thread(/*reserve=*/true)) return refuse();
    has_reserve_ = true;
    stand_in_line(vital_line_, kind, load, std::move(visit));
    vital_changed_.notify_one();
    return true;
  }
  // A thread that is idle, or may still be started, takes one that does not have to wait.
  const std::size_t places = limits_.threads - std::min(busy_, limits_.threads);
  if (kind == Kind::request && waiting_ >= places + limits_.max_waiting) return refuse();
  stand_in_line(line_, kind, load, std::move(visit));
  start_if_needed();
  if (threads_.empty()) {  // the system gives not even one
    visit = std::move(leave_line(line_, std::prev(line_.end())).front().visit);
    return refuse();
  }
  changed_.notify_one();
  return true;
}

void Workers::stand_in_line(Line& line, Kind kind, Loads::iterator load, std::unique_ptr<Visit> visit) {
  line.push_back({kind, load, std::move(visit)});
  ++load->second.waiting;
  if (&line == &line_) (kind == Kind::upload ? waiting_uploads_ : waiting_) += 1;
  count_(1);
}

/// Takes an errand out: the only one of a line of its own.
Workers::Line Workers::leave_line(Line& line, Line::iterator errand) {
  Line alone;
  alone.splice(alone.end(), line, errand);
  --errand->load->second.waiting;
  if (&line == &line_) (errand->kind == Kind::upload ? waiting_uploads_ : waiting_) -= 1;
  count_(-1);
  return alone;
}

/// Whose turn it is among those that may be served now; end() if there is none.
Workers::Line::iterator Workers::next_in_line() {
  auto next = line_.end();
  if (busy_ >= limits_.threads) return next;
  // One client may have half of what there is for uploads: if it is slow, others still get theirs done.
  const std::size_t share = upload_share(), share_of_one = (share + 1) / 2;
  for (auto errand = line_.begin(); errand != line_.end(); ++errand) {
    const Load& load = errand->load->second;
    if (errand->kind == Kind::upload && (uploads_ >= share || load.uploads >= share_of_one)) continue;
    if (next == line_.end() || load.served < next->load->second.served) next = errand;
  }
  return next;
}

void Workers::work(bool reserve, const Serve& server) {
  std::unique_lock lock(mutex_);
  while (!closed_) {
    Line& line = reserve ? vital_line_ : line_;
    const auto next = reserve ? line.begin() : next_in_line();
    if (next == line.end()) {
      (reserve ? vital_changed_ : changed_).wait(lock);
      continue;
    }
    serve(leave_line(line, next), server, lock);
  }
}

/// Nothing here takes memory where the process would end for want of it.
void Workers::serve(Line errand, const Serve& server, std::unique_lock<std::mutex>& lock) {
  const auto place = errand.begin();
  const bool counts = place->kind != Kind::vital, is_upload = place->kind == Kind::upload;
  Load& load = place->load->second;
  Visit& visit = *place->visit;
  if (counts) {
    --idle_;
    ++busy_;
  }
  if (is_upload) ++uploads_, ++load.uploads;
  ++load.served;
  served_.splice(served_.end(), errand);
  lock.unlock();
  try {
    server(visit);
  } catch (const std::exception&) {  // there was not even memory to report what went wrong
    visit.next = Next::end;
  }
  lock.lock();
  errand.splice(errand.end(), served_, place);
  (visit.stepped_aside ? load.aside : load.served) -= 1;
  if (is_upload) --uploads_, --load.uploads;
  if (counts) {
    ++idle_;
    (visit.stepped_aside ? aside_ : busy_) -= 1;
  }
  visit.stepped_aside = false;
  forget_if_none(place->load);
  lock.unlock();
  try {
    hand_on_(std::move(place->visit));
    // NOLINTNEXTLINE(bugprone-empty-catch): there was no memory to remember it by, and so it has ended
  } catch (const std::exception&) {
  }
  lock.lock();
}

void Workers::step_aside(Visit& visit) {
  const std::lock_guard lock(mutex_);
  // Nor does it count as what is done for its client: a stream lasts for hours and costs next to nothing.
  Load& load = loads_.find(network_of(visit.client))->second;
  --load.served;
  ++load.aside;
  visit.stepped_aside = true;
  --busy_;
  ++aside_;
  start_if_needed();
  changed_.notify_one();
}

void Workers::forget_if_none(Loads::iterator load) {
  if (load->second.none()) loads_.erase(load);
}

Workers::Line Workers::empty_lines() {
  Line ended;
  for (Line* line : {&line_, &vital_line_}) {
    while (!line->empty()) {
      ended.splice(ended.end(), leave_line(*line, line->begin()));
      forget_if_none(ended.back().load);
    }
  }
  return ended;
}

void Workers::cut() {
  Line ended;  // goes without the lock
  const std::lock_guard lock(mutex_);
  for (const Errand& errand : served_) errand.visit->connection.cut();
  ended = empty_lines();
}

void Workers::close() {
  Line ended;
  const std::lock_guard lock(mutex_);
  closed_ = true;
  ended = empty_lines();
  changed_.notify_all();
  vital_changed_.notify_all();
}

}  // namespace server::http
