#include "server/http/lobby.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <exception>
#include <tuple>

#include "server/http/network.h"

namespace server::http {
namespace {

using namespace std::chrono_literals;

constexpr auto goodbye_time = 1s;         // for a client to take the end of its last answer; a choice
constexpr auto accept_pause = 20ms;       // where the process has no descriptor left; a choice
constexpr int accepted_at_a_time = 64;    // before those who wait are looked after again; a choice
constexpr int unsent_bytes = 128 * 1024;  // that the system holds of an answer besides what is on its way; a choice

}  // namespace

engine::Result<std::unique_ptr<Lobby>> Lobby::open(engine::FileDescriptor listening, int stop_fd,
                                                   const LobbyOptions& options, Places& places, LobbyHooks hooks) {
  std::unique_ptr<Lobby> lobby(new Lobby(std::move(listening), stop_fd, options, places, std::move(hooks)));
  lobby->epoll_ = engine::FileDescriptor(::epoll_create1(EPOLL_CLOEXEC));
  lobby->wake_ = engine::FileDescriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (lobby->epoll_.get() < 0 || lobby->wake_.get() < 0)
    return engine::fail(engine::ErrorCode::unavailable, "this process may open no more files");
  for (const int descriptor : {lobby->listening_.get(), stop_fd, lobby->wake_.get()})
    if (!lobby->watch(descriptor, EPOLLIN))
      return engine::fail(engine::ErrorCode::unavailable, "this process may watch no more files");
  return lobby;
}

void Lobby::start() {
  thread_ = std::thread([this] { run(); });
}

Lobby::~Lobby() { end(); }

void Lobby::take(std::unique_ptr<Visit> visit) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  handed_in_.push_back(std::move(visit));
  if (handed_in_.size() == 1) wake();
}

void Lobby::cut() {
  const std::lock_guard lock(mutex_);
  cut_ = true;
  wake();
}

void Lobby::end() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    wake();
  }
  if (thread_.joinable()) thread_.join();
}

void Lobby::wake() const {
  const std::uint64_t one = 1;
  while (::write(wake_.get(), &one, sizeof one) < 0 && errno == EINTR) continue;
}

/// False where the system has no memory for it, or the user watches too much already.
bool Lobby::watch(int descriptor, unsigned events) const {
  epoll_event event{};
  event.events = events;
  event.data.fd = descriptor;
  return ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, descriptor, &event) == 0;
}

void Lobby::watch_no_more(int descriptor) const { ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor, nullptr); }

int Lobby::milliseconds_to_wait() const {
  auto until = accept_again_;
  if (!by_due_.empty()) until = std::min(until, by_due_.begin()->first);
  if (until == Clock::time_point::max()) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
  return int(std::clamp<std::int64_t>(left.count(), 0, 3'600'000));
}

/// Does something that may run out of memory: whom that meets loses the connection, and the others go on.
///   socket  of the guest that it is about, if it is about one
template <class Step>
void Lobby::survive(const Step& step, int socket) {
  try {
    step();
  } catch (const std::exception& failure) {
    if (const auto guest = guests_.find(socket); guest != guests_.end()) const auto ended = unseat(guest);
    try {
      hooks_.complain(failure.what());
      // NOLINTNEXTLINE(bugprone-empty-catch): there is not even memory to say so
    } catch (const std::exception&) {
    }
  }
}

void Lobby::run() {
  std::array<epoll_event, 64> events{};
  for (;;) {
    const int count = ::epoll_wait(epoll_.get(), events.data(), int(events.size()), milliseconds_to_wait());
    for (int i = 0; i < count; ++i) {
      const int descriptor = events[std::size_t(i)].data.fd;
      if (descriptor == wake_.get()) {
        std::uint64_t times = 0;
        [[maybe_unused]] const ssize_t got = ::read(wake_.get(), &times, sizeof times);
      } else if (descriptor == stop_fd_) {
        close_doors();
      } else if (descriptor == listening_.get()) {
        survive([&] { accept_some(); });
      } else {
        survive([&] { serve(descriptor); }, descriptor);
      }
    }
    // Also where something always happens: a client that always has a byte more gains no time by it.
    survive([&] { end_those_whose_time_is_over(); });
    take_those_handed_in();
    Guests guests;
    std::vector<std::unique_ptr<Visit>> handed_in;  // both go without the lock: to close a thousand takes a while
    const std::lock_guard lock(mutex_);
    if (cut_ || ended_) {
      cut_ = false;
      guests.swap(guests_);
      by_due_.clear();
    }
    if (ended_) {
      handed_in.swap(handed_in_);
      listening_ = {};
      return;
    }
  }
}

void Lobby::take_those_handed_in() {
  std::vector<std::unique_ptr<Visit>> visits;
  {
    const std::lock_guard lock(mutex_);
    visits.swap(handed_in_);
  }
  for (auto& visit : visits) survive([&] { let_in(std::move(visit)); });
}

/// The server stops: only those go on whose request is under way.
void Lobby::close_doors() {
  doors_closed_ = true;
  watch_no_more(stop_fd_);
  listening_ = {};  // closed, and by that no longer watched
  accept_again_ = Clock::time_point::max();
  for (auto guest = guests_.begin(); guest != guests_.end();) {
    const auto here = guest++;
    const Next next = here->second.visit->next;
    if (next == Next::read_head || next == Next::say_goodbye) const auto ended = unseat(here);
  }
}

void Lobby::accept_some() {
  bool has_made_room = false;
  for (int i = 0; i < accepted_at_a_time; ++i) {
    const int socket = ::accept4(listening_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket >= 0) {
      accept(socket);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Only where our own connections are in the way, and once: what they leave others may take, and all would go.
      if (errno == EMFILE && !std::exchange(has_made_room, true) && make_room("")) continue;
      // Connections wait in the system's own line until some of ours end.
      watch_no_more(listening_.get());
      accept_again_ = Clock::now() + accept_pause;
      return;
    } else if (errno != EINTR && errno != ECONNABORTED) {
      return;
    }
  }
}

void Lobby::accept(int socket) {
  const int yes = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  // Bounds what the system holds for a client that takes nothing, and has a slow one be heard of while it is slow: it
  // is writable again when half of this has gone, not a third of megabytes.
  ::setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent_bytes, sizeof unsent_bytes);
  auto visit = std::make_unique<Visit>(engine::FileDescriptor(socket), options_.connection, stop_fd_, places_);
  const std::string& network = visit->place.network();
  const std::size_t limit = options_.max_connections_per_client;
  if (limit > 0 && places_.taken_by(network) > limit && !make_room(network))
    return refuse(std::move(visit), {429, "busy",
                                     "there may be " + std::to_string(limit) +
                                         " connections from one address; the service's option "
                                         "--max-connections-per-client sets this limit",
                                     ""});
  if (places_.taken() > options_.max_connections && !make_room(""))
    return refuse(std::move(visit), {503, "unavailable", "too many connections are open; try again soon", ""});
  let_in(std::move(visit));
}

/// Ends the visit that has the least claim to its place, as long as its client does nothing: one that has had its last
/// answer, then one that has asked for nothing yet, then one whose request is under way; of these, one of the network
/// with the most connections, and the one that has waited for longest.
///   network  of whom; empty: of anybody
///   returns  false: none is waited for
bool Lobby::make_room(const std::string& network) {
  auto least = guests_.end();
  std::tuple<Next, std::size_t, Clock::duration> claim;
  const auto now = Clock::now();
  for (auto guest = guests_.begin(); guest != guests_.end(); ++guest) {
    const std::string& own = guest->second.visit->place.network();
    if (!network.empty() && own != network) continue;
    const std::size_t others = options_.max_connections - std::min(options_.max_connections, places_.taken_by(own));
    const std::tuple own_claim(guest->second.visit->next, others, guest->second.since - now);
    if (least != guests_.end() && own_claim >= claim) continue;
    least = guest;
    claim = own_claim;
  }
  if (least == guests_.end()) return false;
  cut_off(least);
  return true;
}

/// Has those go whose clients take the least, where too much waits for too many: first whoever has taken nothing for
/// longest. What waits in line for a worker stays, for it is not the lobby's: where that alone is too much, whoever has
/// just come goes. One answer is always held, however large.
///   newest  socket of the guest that has just come
void Lobby::bound_unsent_bytes(int newest) {
  while (unsent_bytes_.total() > options_.max_unsent_bytes) {
    auto longest = guests_.end();
    for (auto guest = guests_.begin(); guest != guests_.end(); ++guest) {
      if (guest->first == newest || guest->second.visit->unsent.bytes() == 0) continue;
      if (longest == guests_.end() || guest->second.since < longest->second.since) longest = guest;
    }
    if (longest == guests_.end()) longest = guests_.find(newest);
    if (longest == guests_.end() || longest->second.visit->unsent.bytes() == unsent_bytes_.total()) return;
    cut_off(longest);
  }
}

/// Posts the refusal, and waits for the client to take it.
void Lobby::refuse(std::unique_ptr<Visit> visit, const Refusal& refusal) {
  hooks_.refuse(*visit, refusal);
  visit->next = Next::say_goodbye;
  let_in(std::move(visit));
}

/// A head is whole, or cannot be read.
void Lobby::go_on_with(std::unique_ptr<Visit> visit, const HeadText& text) {
  visit->arrived = Clock::now();
  ++visit->requests;
  auto head = text ? parse_head(**text) : tl::make_unexpected(text.error());
  if (!head) return refuse(std::move(visit), head.error());
  visit->head = std::move(*head);
  visit->connection.begin_body(visit->head);
  hooks_.ready(std::move(visit));
}

void Lobby::let_in(std::unique_ptr<Visit> visit) {
  Connection& connection = visit->connection;
  visit->unsent.set(unsent_bytes_, connection.bytes_held());
  switch (visit->next) {
    case Next::say_goodbye:
      connection.end_sending();
      if (!doors_closed_) seat(std::move(visit), EPOLLIN, Clock::now() + goodbye_time);
      return;
    case Next::read_head: {
      if (doors_closed_) return;
      const auto text = connection.take_head();  // of what came with the request before
      if (!text || *text) return go_on_with(std::move(visit), text);
      visit->arrived = Clock::now();
      const auto time =
          connection.head_has_begun() ? options_.connection.head_timeout : options_.connection.idle_timeout;
      return seat(std::move(visit), EPOLLIN, Clock::now() + time);
    }
    case Next::read_body:
      connection.begin_wait();
      return seat(std::move(visit), EPOLLIN, connection.body_due());
    case Next::send_on: {
      connection.begin_wait();
      const int socket = connection.socket();
      seat(std::move(visit), EPOLLOUT, connection.answer_due());
      return bound_unsent_bytes(socket);
    }
    case Next::begin_upload:  // the workers' business
    case Next::end:
      return;
  }
}

void Lobby::seat(std::unique_ptr<Visit> visit, unsigned events, Clock::time_point due) {
  const int socket = visit->connection.socket();
  const bool head_has_begun = visit->next == Next::read_head && visit->connection.head_has_begun();
  const auto guest = guests_.emplace(socket, Guest{std::move(visit), Clock::now(), due, head_has_begun}).first;
  try {
    by_due_.emplace(due, socket);
  } catch (const std::exception&) {
    guests_.erase(guest);  // nobody would ever look after it
    throw;
  }
  if (!watch(socket, events)) const auto ended = unseat(guest);
}

void Lobby::set_due(Guests::iterator guest, Clock::time_point due) {
  by_due_.erase({guest->second.due, guest->first});
  guest->second.due = due;
  by_due_.emplace(due, guest->first);
}

std::unique_ptr<Visit> Lobby::unseat(Guests::iterator guest) {
  watch_no_more(guest->first);
  by_due_.erase({guest->second.due, guest->first});
  auto visit = std::move(guest->second.visit);
  guests_.erase(guest);
  return visit;
}

/// Ends a visit to make room.
void Lobby::cut_off(Guests::iterator guest) {
  const auto ended = unseat(guest);
  hooks_.count_cut();
}

void Lobby::serve(int socket) {
  const auto guest = guests_.find(socket);
  if (guest == guests_.end()) return;  // it has been ended since
  Visit& visit = *guest->second.visit;
  switch (visit.next) {
    case Next::say_goodbye:
      if (!visit.connection.discard_now()) const auto ended = unseat(guest);
      return;
    case Next::read_head:
      return read_head(guest);
    case Next::read_body:
      return read_body(guest);
    case Next::send_on:
      visit.connection.end_answer_wait();
      return hooks_.ready(unseat(guest));
    case Next::begin_upload:
    case Next::end:
      return;
  }
}

void Lobby::read_head(Guests::iterator guest) {
  Connection& connection = guest->second.visit->connection;
  const auto arrival = connection.receive_now();
  if (arrival == Connection::Arrival::none) return;
  if (arrival == Connection::Arrival::end) {  // there is nobody to answer
    const auto ended = unseat(guest);
    return;
  }
  const auto text = connection.take_head();
  if (!text || *text) return go_on_with(unseat(guest), text);
  if (guest->second.head_has_begun || !connection.head_has_begun()) return;
  guest->second.head_has_begun = true;
  guest->second.visit->arrived = Clock::now();
  set_due(guest, Clock::now() + options_.connection.head_timeout);
}

void Lobby::read_body(Guests::iterator guest) {
  Connection& connection = guest->second.visit->connection;
  const auto arrival = connection.receive_now();
  if (arrival == Connection::Arrival::none) return;
  connection.end_body_wait();
  // What ends too early, the one who reads it finds out.
  if (arrival == Connection::Arrival::end || connection.body_is_here()) return hooks_.ready(unseat(guest));
  connection.begin_wait();
  set_due(guest, connection.body_due());
}

void Lobby::end_those_whose_time_is_over() {
  const auto now = Clock::now();
  while (!by_due_.empty() && by_due_.begin()->first <= now) {
    const auto guest = guests_.find(by_due_.begin()->second);
    if (guest == guests_.end()) return void(by_due_.erase(by_due_.begin()));  // it was lost for want of memory
    end_wait(guest);
  }
  if (accept_again_ > now) return;
  accept_again_ = watch(listening_.get(), EPOLLIN) ? Clock::time_point::max() : now + accept_pause;
}

void Lobby::end_wait(Guests::iterator guest) {
  auto visit = unseat(guest);
  switch (visit->next) {
    case Next::read_head:
      // Whoever said nothing at all has nothing to be answered.
      if (visit->connection.head_has_begun())
        refuse(std::move(visit), {408, "request_timeout", "the request's head did not arrive in time", ""});
      return;
    case Next::read_body:
      visit->connection.give_body_up();
      return hooks_.ready(std::move(visit));
    case Next::send_on:
      visit->connection.give_answer_up();
      visit->unsent.set(unsent_bytes_, 0);  // it waits for a thread with nothing: nobody is cut for it
      return hooks_.ready(std::move(visit));
    default:
      return;
  }
}

}  // namespace server::http
