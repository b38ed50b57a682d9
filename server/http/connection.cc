#include "server/http/connection.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/sendfile.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

namespace server::http {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t receive_bytes = 64 * 1024;     // of an upload, per call of recv(); a choice
constexpr std::size_t arrival_bytes = 16 * 1024;     // of a head or a small body, per call of recv(); a choice
constexpr std::size_t small_body_bytes = 64 * 1024;  // that every connection may have in memory at a time; a choice
constexpr std::size_t file_piece = 1024 * 1024;      // per call of sendfile(); a choice
constexpr std::size_t max_chunk_line = 256;          // bytes: a size and the extensions that follow it; a choice
constexpr std::size_t max_trailer_bytes = 8 * 1024;  // of all trailer fields, which we ignore; a choice
constexpr std::size_t max_empty_lines = 2;           // before a request (RFC 9112, section 2.2)
constexpr std::string_view continue_line = "HTTP/1.1 100 Continue\r\n\r\n";

bool would_block() { return errno == EAGAIN || errno == EWOULDBLOCK; }

int milliseconds_until(std::chrono::steady_clock::time_point until) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
  return int(std::clamp<std::int64_t>(left.count(), 0, 3'600'000));
}

Refusal not_http() { return {400, "invalid_argument", "that is no HTTP request", ""}; }

std::string address_of_peer(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (::getpeername(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return "unknown";
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* const bytes = address.ss_family == AF_INET6
                                ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(address).sin6_addr)
                                : static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(address).sin_addr);
  return ::inet_ntop(address.ss_family, bytes, text.data(), text.size()) == nullptr ? "unknown" : text.data();
}

}  // namespace

Connection::Connection(engine::FileDescriptor socket, const ConnectionLimits& limits, int stop_fd)
    : socket_(std::move(socket)), limits_(limits), stop_fd_(stop_fd), client_(address_of_peer(socket_.get())) {}

bool Connection::stopping() const {
  pollfd stop{stop_fd_, POLLIN, 0};
  return stop_fd_ >= 0 && ::poll(&stop, 1, 0) > 0;
}

Connection::Wait Connection::wait(short events, Clock::time_point until) const {
  pollfd watched{socket_.get(), events, 0};
  // Time that is over is over even if there is something to read: a client that always has a byte more gains none.
  while (Clock::now() < until) {
    const int ready = ::poll(&watched, 1, milliseconds_until(until));
    if (ready > 0) return Wait::ready;
  }
  return Wait::timeout;
}

/// Appends what has arrived to the input. 0: the client has closed; -1: nothing there, or a failure.
std::ptrdiff_t Connection::receive(std::size_t max_bytes) {
  if (consumed_ > 0) {
    input_.erase(0, consumed_);
    consumed_ = 0;
  }
  const std::size_t before = input_.size();
  input_.resize(before + max_bytes);
  const ssize_t got = ::recv(socket_.get(), input_.data() + before, max_bytes, 0);
  const int error = errno;
  input_.resize(before + std::size_t(std::max<ssize_t>(got, 0)));
  errno = error;
  return got;
}

Connection::Arrival Connection::receive_now() {
  const std::ptrdiff_t got = receive(arrival_bytes);
  if (got > 0) {
    body_bytes_ += std::uint64_t(got);
    return Arrival::some;
  }
  return got < 0 && (would_block() || errno == EINTR) ? Arrival::none : Arrival::end;
}

tl::expected<std::optional<std::string>, Refusal> Connection::take_head() {
  for (; std::string_view(input_).substr(consumed_).starts_with("\r\n"); consumed_ += 2)
    if (++empty_lines_ > max_empty_lines) return tl::make_unexpected(not_http());
  const std::string_view arrived = std::string_view(input_).substr(consumed_);
  // What does not begin like a method is no HTTP (a TLS handshake, say), and need not be waited for.
  if (!arrived.empty() && arrived != "\r" && !(arrived.front() >= 'A' && arrived.front() <= 'Z'))
    return tl::make_unexpected(not_http());
  const std::size_t end = arrived.find("\r\n\r\n", searched_);
  const std::size_t length = end == std::string_view::npos ? arrived.size() : end + 4;
  if (length + 2 * empty_lines_ > limits_.max_head_bytes)
    return tl::make_unexpected(Refusal{
        431, "too_large", "the head of a request may have " + std::to_string(limits_.max_head_bytes) + " bytes", ""});
  if (end == std::string_view::npos) {
    searched_ = arrived.size() < 3 ? 0 : arrived.size() - 3;
    if (!arrived.empty()) return std::nullopt;
    std::string().swap(input_);  // many are idle at a time: what they have no use for is given back
    consumed_ = 0;
    return std::nullopt;
  }
  std::string head(arrived.substr(0, length));
  consumed_ += length;
  searched_ = empty_lines_ = 0;
  return head;
}

void Connection::begin_body(const RequestHead& head) {
  remaining_ = head.content_length.value_or(0);
  framing_ = head.chunked ? Framing::chunk_size : remaining_ > 0 ? Framing::length : Framing::done;
  trailer_bytes_ = 0;
  continue_pending_ = head.expects_continue && framing_ != Framing::done;
  may_wait_for_body_ = true;
  failure_ = BodyFailure::none;
  body_waited_ = {};
  body_bytes_ = 0;
}

bool Connection::body_is_here() const {
  return framing_ == Framing::done || (framing_ == Framing::length && input_.size() - consumed_ >= remaining_);
}

bool Connection::body_is_small() const {
  return framing_ == Framing::length && remaining_ <= small_body_bytes && !continue_pending_;
}

bool Connection::fail(BodyFailure failure) {
  failure_ = failure;
  return false;
}

bool Connection::too_slow(Clock::duration waited, std::uint64_t bytes) const {
  if (waited <= limits_.rate_grace) return false;
  return double(bytes) < std::chrono::duration<double>(waited).count() * double(limits_.min_bytes_per_second);
}

Connection::Clock::time_point Connection::due(Clock::duration waited, std::uint64_t bytes) const {
  const auto stalled = waiting_since_ + limits_.stall_timeout;
  if (limits_.min_bytes_per_second == 0) return stalled;
  // The bytes so far pay for so much time; the grace is given to all.
  const std::chrono::duration<double> paid(double(bytes) / double(limits_.min_bytes_per_second));
  const auto allowed = std::max<Clock::duration>(
      limits_.rate_grace,
      std::chrono::duration_cast<Clock::duration>(std::min(paid, std::chrono::duration<double>(24h))));
  return std::min(stalled, waiting_since_ + allowed - waited);
}

void Connection::begin_wait() { waiting_since_ = Clock::now(); }

/// Waits for more bytes of the body and appends them to the input.
bool Connection::fill_body_buffer() {
  if (continue_pending_) {
    continue_pending_ = false;
    if (!write(continue_line)) return fail(BodyFailure::truncated);
  }
  for (;;) {
    const std::ptrdiff_t got = receive(receive_bytes);
    if (got > 0) {
      body_bytes_ += std::uint64_t(got);
      return true;
    }
    if (got == 0 || (!would_block() && errno != EINTR)) return fail(BodyFailure::truncated);
    if (!may_wait_for_body_) return fail(BodyFailure::too_slow);
    const auto began = Clock::now();
    const Wait waited = wait(POLLIN, began + limits_.stall_timeout);
    body_waited_ += Clock::now() - began;
    if (waited == Wait::timeout || too_slow(body_waited_, body_bytes_)) return fail(BodyFailure::too_slow);
  }
}

/// A line of chunked framing, without its CRLF.
std::optional<std::string> Connection::body_line() {
  for (;;) {
    const std::string_view arrived = std::string_view(input_).substr(consumed_);
    const std::size_t end = arrived.find("\r\n");
    // The last byte of an incomplete line may be half of its CRLF.
    const bool ends_in_cr = end == std::string_view::npos && arrived.ends_with('\r');
    if (std::min(end, arrived.size()) > max_chunk_line ||
        !is_header_text(arrived.substr(0, std::min(end, arrived.size() - (ends_in_cr ? 1 : 0))))) {
      failure_ = BodyFailure::malformed;
      return std::nullopt;
    }
    if (end != std::string_view::npos) {
      std::string line(arrived.substr(0, end));
      consumed_ += end + 2;
      return line;
    }
    if (!fill_body_buffer()) return std::nullopt;
  }
}

/// Reads framing up to the next byte of the body, or its end.
bool Connection::next_chunk() {
  if (framing_ == Framing::chunk_end) {
    const auto line = body_line();
    if (!line) return false;
    if (!line->empty()) return fail(BodyFailure::malformed);
    framing_ = Framing::chunk_size;
  }
  if (framing_ == Framing::chunk_size) {
    const auto line = body_line();
    if (!line) return false;
    const auto read = std::from_chars(line->data(), line->data() + line->size(), remaining_, 16);
    const std::string_view rest(read.ptr, std::size_t(line->data() + line->size() - read.ptr));
    if (read.ec != std::errc{} || !(rest.empty() || trim(rest).starts_with(';'))) return fail(BodyFailure::malformed);
    framing_ = remaining_ > 0 ? Framing::chunk_data : Framing::trailer;
  }
  while (framing_ == Framing::trailer) {
    const auto line = body_line();
    if (!line) return false;
    trailer_bytes_ += line->size() + 2;
    if (trailer_bytes_ > max_trailer_bytes) return fail(BodyFailure::malformed);
    if (line->empty()) framing_ = Framing::done;
  }
  return true;
}

std::ptrdiff_t Connection::read_body(char* to, std::size_t size) {
  if (failure_ != BodyFailure::none) return -1;
  if (framing_ != Framing::length && framing_ != Framing::chunk_data && framing_ != Framing::done && !next_chunk())
    return -1;
  if (framing_ == Framing::done) return 0;
  if (consumed_ == input_.size() && !fill_body_buffer()) return -1;
  const std::size_t taken = std::size_t(std::min<std::uint64_t>({size, input_.size() - consumed_, remaining_}));
  std::memcpy(to, input_.data() + consumed_, taken);
  consumed_ += taken;
  remaining_ -= taken;
  if (remaining_ == 0) framing_ = framing_ == Framing::length ? Framing::done : Framing::chunk_end;
  return std::ptrdiff_t(taken);
}

bool Connection::finish_body(std::size_t max_bytes, bool wait) {
  may_wait_for_body_ = wait;
  if (framing_ == Framing::done) return true;
  // A client that waits for "100 Continue" may send its body after all, or may not: nobody knows. Close.
  if (continue_pending_) return false;
  std::array<char, 4096> discarded;
  for (std::size_t total = 0; total <= max_bytes;) {
    const std::ptrdiff_t got = read_body(discarded.data(), discarded.size());
    if (got <= 0) return got == 0;
    total += std::size_t(got);
  }
  return false;
}

void Connection::begin_answer() {
  write_waited_ = {};
  written_ = 0;
}

void Connection::give_answer_up() {
  broken_ = true;
  std::string().swap(output_);  // whoever ends the visit may have to wait for a thread: not with all of it
  sent_ = 0;
  file_.reset();
  file_left_ = 0;
}

Connection::Sending Connection::stopped_sending() {
  if (would_block()) return Sending::waiting;
  broken_ = true;
  return Sending::broken;
}

/// Sends of `bytes` what the client takes, and leaves there what it does not.
Connection::Sending Connection::send_some(std::string_view& bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return stopped_sending();
    written_ += std::uint64_t(sent);
    bytes.remove_prefix(std::size_t(sent));
  }
  return Sending::done;
}

bool Connection::post(std::string_view bytes) {
  if (broken_) return false;
  if (sent_ == output_.size() && send_some(bytes) == Sending::broken) return false;
  output_.append(bytes);
  return true;
}

void Connection::post_file(std::shared_ptr<const engine::FileDescriptor> file, std::uint64_t offset,
                           std::uint64_t length) {
  file_ = std::move(file);
  file_offset_ = offset;
  file_left_ = length;
}

Connection::Sending Connection::send_now(std::uint64_t max_bytes) {
  if (broken_) return Sending::broken;
  std::string_view rest = std::string_view(output_).substr(sent_);
  const Sending posted = send_some(rest);
  sent_ = output_.size() - rest.size();
  if (posted != Sending::done) return posted;
  std::string().swap(output_);
  sent_ = 0;
  while (file_left_ > 0 && max_bytes > 0) {
    off_t offset = off_t(file_offset_);  // there is no MSG_NOSIGNAL here: httplib has the process ignore SIGPIPE
    const std::size_t piece = std::size_t(std::min({file_left_, max_bytes, std::uint64_t{file_piece}}));
    const ssize_t sent = ::sendfile(socket_.get(), file_->get(), &offset, piece);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return stopped_sending();
    // A file that has become shorter cannot be sent as promised; breaking off says so.
    if (sent == 0) broken_ = true;
    if (sent == 0) return Sending::broken;
    written_ += std::uint64_t(sent);
    file_offset_ += std::uint64_t(sent);
    file_left_ -= std::uint64_t(sent);
    max_bytes -= std::uint64_t(sent);
  }
  if (file_left_ > 0) return Sending::waiting;
  file_.reset();
  return Sending::done;
}

bool Connection::write(std::string_view bytes) {
  if (!post(bytes)) return false;
  for (;;) {
    const Sending sending = send_now(0);
    if (sending != Sending::waiting) return sending == Sending::done;
    begin_wait();
    const Wait waited = wait(POLLOUT, waiting_since_ + limits_.stall_timeout);
    end_answer_wait();
    if (waited == Wait::timeout || too_slow(write_waited_, written_)) return false;
  }
}

bool Connection::closed_by_client() const {
  if (stopping()) return true;
  pollfd peer{socket_.get(), POLLRDHUP, 0};
  return ::poll(&peer, 1, 0) != 0;
}

bool Connection::open() const {
  if (stopping()) return false;
  pollfd peer{socket_.get(), 0, 0};  // POLLERR and POLLHUP come unasked
  return ::poll(&peer, 1, 0) == 0;
}

void Connection::end_sending() { ::shutdown(socket_.get(), SHUT_WR); }

bool Connection::discard_now() {
  std::array<char, 16 * 1024> discarded;
  const ssize_t got = ::recv(socket_.get(), discarded.data(), discarded.size(), 0);
  return got > 0 || (got < 0 && (would_block() || errno == EINTR));
}

void Connection::cut() { ::shutdown(socket_.get(), SHUT_RDWR); }

}  // namespace server::http
