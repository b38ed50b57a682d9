// One client's connection: bytes in and out, with deadlines that a slow or silent client cannot stretch.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "server/http/request_head.h"

namespace server::http {

/// How long and how slow a client may be. All of it is a choice, none of it was measured: generous to a client on a bad
/// line, and short enough that silent clients cannot hold all threads.
struct ConnectionLimits {
  std::size_t max_head_bytes = 32 * 1024;
  std::chrono::milliseconds head_timeout{10'000};        ///< Time for a whole request head, from its first byte.
  std::chrono::milliseconds idle_timeout{5'000};         ///< Silence before the first request, and between two.
  std::chrono::milliseconds patience_when_crowded{250};  ///< Silence before the first request while others wait.
  std::chrono::milliseconds stall_timeout{10'000};       ///< Time in which at least a byte must come or be taken.
  std::uint64_t min_bytes_per_second = 8 * 1024;  ///< Least average rate of a body or an answer after `rate_grace`.
  std::chrono::milliseconds rate_grace{10'000};   ///< Time waited for a body or an answer before its rate counts.
};

/// What a connection needs to know of the server around it.
struct ConnectionHooks {
  int stop_fd = -1;               ///< Becomes readable when the server stops.
  std::function<bool()> crowded;  ///< Tells whether clients wait for a thread: idle connections then end.
};

/// Owns the socket, which is non-blocking. Used by one thread.
class Connection {
 public:
  Connection(int socket, const ConnectionLimits& limits, ConnectionHooks hooks);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// The head of the next request, up to and including its empty line. Nothing: the client has gone, or said nothing
  /// for too long, or the server stops; there is nobody to answer.
  ///   errors  400 not HTTP, 408 too slow, 431 too long
  [[nodiscard]] tl::expected<std::optional<std::string>, Refusal> read_head();

  /// The body that follows a head. To be called once per head.
  void begin_body(const RequestHead& head);
  /// Some bytes of the body, without its framing. If the client waits for "100 Continue", the first call sends it.
  ///   returns  0 at the body's end; -1 once it has failed
  [[nodiscard]] std::ptrdiff_t read_body(char* to, std::size_t size);
  enum class BodyFailure { none, truncated, too_slow, malformed };
  [[nodiscard]] BodyFailure body_failure() const { return failure_; }
  /// Whether all of the body has been read, so that the next request begins here. Reads and discards up to
  /// `max_bytes` bytes to get there.
  ///   wait  true: waits for what is still on its way; false: takes only what has arrived
  [[nodiscard]] bool finish_body(std::size_t max_bytes, bool wait);

  /// Sends all of the bytes.
  ///   returns  false: the client has gone or takes the answer too slowly
  [[nodiscard]] bool write(std::string_view bytes);
  /// An answer begins: its rate is measured from here.
  void begin_answer();
  [[nodiscard]] std::uint64_t bytes_written() const { return written_; }  ///< Since begin_answer().
  /// Whether the client is still there and the server is not stopping. A client that has only finished sending is
  /// there; one that has closed is found out by the first bytes it no longer takes.
  [[nodiscard]] bool open() const;
  /// Whether the client has closed its end, at least for sending, or the server is stopping.
  [[nodiscard]] bool closed_by_client() const;
  /// Ends the answer, and waits up to a second for the client to take it: closing on unread bytes would make the system
  /// drop what is still on its way.
  void linger();

  [[nodiscard]] std::string client() const;  ///< The client's address.

 private:
  using Clock = std::chrono::steady_clock;
  enum class Wait { ready, timeout, stopping };
  enum class Framing { length, chunk_size, chunk_data, chunk_end, trailer, done };

  [[nodiscard]] bool stopping() const;
  [[nodiscard]] bool readable_now() const;
  [[nodiscard]] Wait wait(short events, Clock::time_point until, bool watch_stop) const;
  [[nodiscard]] Wait wait_while_idle(Clock::time_point until) const;
  [[nodiscard]] std::ptrdiff_t receive();
  [[nodiscard]] bool fill_body_buffer();
  [[nodiscard]] std::optional<std::string> body_line();
  [[nodiscard]] bool next_chunk();
  bool fail(BodyFailure failure);  ///< Notes the failure; returns false.
  [[nodiscard]] bool too_slow(Clock::duration waited, std::uint64_t bytes) const;

  const int socket_;
  const ConnectionLimits limits_;
  const ConnectionHooks hooks_;
  std::string input_;  ///< UploadInfo, not yet consumed; begins at `consumed_`.
  std::size_t consumed_ = 0;
  bool has_answered_ = false;

  Framing framing_ = Framing::done;
  std::uint64_t remaining_ = 0;  ///< Bytes to come of the body, or of the chunk.
  std::size_t trailer_bytes_ = 0;
  bool continue_pending_ = false;
  bool may_wait_for_body_ = true;
  BodyFailure failure_ = BodyFailure::none;
  Clock::duration body_waited_{};
  std::uint64_t body_bytes_ = 0;

  Clock::duration write_waited_{};
  std::uint64_t written_ = 0;
};

}  // namespace server::http
