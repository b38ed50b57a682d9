// One client's connection: bytes in and out, with deadlines that a slow or silent client cannot stretch. Heads, small
// bodies and answers are moved without waiting, so that a client that takes its time needs no thread; who has a thread
// may also wait: for the pieces of an upload, and for an event to be taken.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "engine/core/file_descriptor.h"
#include "server/http/request_head.h"

namespace server::http {

/// How long and how slow a client may be. All of it is a choice, none of it was measured: generous to a client on a bad
/// line, and short enough that what silent clients hold is given back.
struct ConnectionLimits {
  std::size_t max_head_bytes = 32 * 1024;
  std::chrono::milliseconds head_timeout{10'000};   ///< Time for a whole request head, from its first byte.
  std::chrono::milliseconds idle_timeout{15'000};   ///< Silence before the first request, and between two.
  std::chrono::milliseconds stall_timeout{10'000};  ///< Time in which at least a byte must come or be taken.
  std::uint64_t min_bytes_per_second = 8 * 1024;    ///< Least average rate of a body or an answer after `rate_grace`.
  std::chrono::milliseconds rate_grace{10'000};     ///< Time waited for a body or an answer before its rate counts.
};

/// Owns the socket, which is non-blocking. Used by one thread at a time.
class Connection {
 public:
  using Clock = std::chrono::steady_clock;

  ///   stop_fd  becomes readable when the server stops
  Connection(engine::FileDescriptor socket, const ConnectionLimits& limits, int stop_fd);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  [[nodiscard]] int socket() const { return socket_.get(); }
  [[nodiscard]] const std::string& client() const { return client_; }  ///< The client's address.

  /// Takes what has arrived, up to a few KiB; never waits.
  enum class Arrival { some, none, end };
  [[nodiscard]] Arrival receive_now();
  /// The head of the next request, up to and including its empty line, of what has been received. Nothing: it is not
  /// whole yet.
  ///   errors  400 not HTTP, 431 too long
  [[nodiscard]] tl::expected<std::optional<std::string>, Refusal> take_head();
  /// Whether a head has begun that is not whole yet.
  [[nodiscard]] bool head_has_begun() const { return consumed_ < input_.size() || empty_lines_ > 0; }

  /// The body that follows a head. To be called once per head.
  void begin_body(const RequestHead& head);
  /// Whether reading the body to its end would wait for nothing.
  [[nodiscard]] bool body_is_here() const;
  /// Whether the body is one to be received before anything is done about it: its length is told, and small, and its
  /// client does not wait to be asked for it.
  [[nodiscard]] bool body_is_small() const;
  /// Some bytes of the body, without its framing; waits for them. If the client waits for "100 Continue", the first
  /// call sends it.
  ///   returns  0 at the body's end; -1 once it has failed
  [[nodiscard]] std::ptrdiff_t read_body(char* to, std::size_t size);
  enum class BodyFailure { none, truncated, too_slow, malformed };
  [[nodiscard]] BodyFailure body_failure() const { return failure_; }
  /// Whether all of the body has been read, so that the next request begins here. Reads and discards up to
  /// `max_bytes` bytes to get there.
  ///   wait  true: waits for what is still on its way; false: takes only what has arrived
  [[nodiscard]] bool finish_body(std::size_t max_bytes, bool wait);
  /// The body has not arrived in time.
  void give_body_up() { failure_ = BodyFailure::too_slow; }

  /// An answer begins: its rate is measured from here.
  void begin_answer();
  /// The client takes it too slowly: nothing more is sent, and what was posted is held no longer.
  void give_answer_up();
  /// Bytes that follow those before. They are sent as far as the client takes them at once; the rest waits for
  /// send_now() or write().
  ///   returns  false: the client has gone
  bool post(std::string_view bytes);
  /// Bytes of a file that follow what was posted: sent by send_now().
  void post_file(std::shared_ptr<const engine::FileDescriptor> file, std::uint64_t offset, std::uint64_t length);
  /// Sends what was posted, as far as the client takes it at once; not more than `max_bytes` of a file.
  enum class Sending { done, waiting, broken };
  [[nodiscard]] Sending send_now(std::uint64_t max_bytes);
  /// Sends all of the bytes, and what was posted before; waits for the client to take them.
  ///   returns  false: the client has gone or takes the answer too slowly
  [[nodiscard]] bool write(std::string_view bytes);
  /// Bytes in memory for what was posted: all of it until the last of it is sent.
  [[nodiscard]] std::size_t bytes_held() const { return output_.size(); }
  [[nodiscard]] std::uint64_t bytes_written() const { return written_; }  ///< Since begin_answer().

  /// The client is waited for, without a thread: for more of a body, or until it takes more of an answer.
  void begin_wait();
  void end_body_wait() { body_waited_ += Clock::now() - waiting_since_; }
  void end_answer_wait() { write_waited_ += Clock::now() - waiting_since_; }
  /// When such a wait is over at the latest, as things stand now: nothing has come, or too little.
  [[nodiscard]] Clock::time_point body_due() const { return due(body_waited_, body_bytes_); }
  [[nodiscard]] Clock::time_point answer_due() const { return due(write_waited_, written_); }

  /// Whether the client is still there and the server is not stopping. A client that has only finished sending is
  /// there; one that has closed is found out by the first bytes it no longer takes.
  [[nodiscard]] bool open() const;
  /// Whether the client has closed its end, at least for sending, or the server is stopping.
  [[nodiscard]] bool closed_by_client() const;
  /// Nothing more will be sent. Closing on unread bytes would make the system drop what is still on its way: what
  /// arrives is to be discarded until the client has closed its end, too.
  void end_sending();
  /// Throws away what has arrived.
  ///   returns  whether the client may still send more
  [[nodiscard]] bool discard_now();
  /// Ends both directions, as seen by both sides; safe to call while another thread uses the connection.
  void cut();

 private:
  enum class Wait { ready, timeout };
  enum class Framing { length, chunk_size, chunk_data, chunk_end, trailer, done };

  [[nodiscard]] bool stopping() const;
  [[nodiscard]] Wait wait(short events, Clock::time_point until) const;
  [[nodiscard]] std::ptrdiff_t receive(std::size_t max_bytes);
  [[nodiscard]] bool fill_body_buffer();
  [[nodiscard]] std::optional<std::string> body_line();
  [[nodiscard]] bool next_chunk();
  [[nodiscard]] Sending send_some(std::string_view& bytes);
  [[nodiscard]] Sending stopped_sending();  ///< By errno.
  bool fail(BodyFailure failure);           ///< Notes the failure; returns false.
  [[nodiscard]] bool too_slow(Clock::duration waited, std::uint64_t bytes) const;
  [[nodiscard]] Clock::time_point due(Clock::duration waited, std::uint64_t bytes) const;

  const engine::FileDescriptor socket_;
  const ConnectionLimits limits_;
  const int stop_fd_;
  const std::string client_;
  std::string input_;  ///< Received, not yet consumed; begins at `consumed_`.
  std::size_t consumed_ = 0;
  std::size_t searched_ = 0, empty_lines_ = 0;  ///< Of the head that is on its way.

  Framing framing_ = Framing::done;
  std::uint64_t remaining_ = 0;  ///< Bytes to come of the body, or of the chunk.
  std::size_t trailer_bytes_ = 0;
  bool continue_pending_ = false;
  bool may_wait_for_body_ = true;
  BodyFailure failure_ = BodyFailure::none;
  Clock::duration body_waited_{};
  std::uint64_t body_bytes_ = 0;
  Clock::time_point waiting_since_;

  std::string output_;  ///< Posted, not yet sent; begins at `sent_`.
  std::size_t sent_ = 0;
  std::shared_ptr<const engine::FileDescriptor>
      file_;  ///< To be sent after it: `file_left_` bytes from `file_offset_`.
  std::uint64_t file_offset_ = 0, file_left_ = 0;
  bool broken_ = false;
  Clock::duration write_waited_{};
  std::uint64_t written_ = 0;
};

}  // namespace server::http
