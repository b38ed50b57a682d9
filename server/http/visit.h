// A client's connection with the request it is about: what the lobby and the workers hand each other.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "server/http/connection.h"
#include "server/http/dispatcher.h"
#include "server/http/network.h"
#include "server/http/places.h"
#include "server/http/request_head.h"
#include "server/http/unsent_bytes.h"

namespace server::http {

/// What a visit does next.
enum class Next {
  say_goodbye,   ///< Wait for the client to take the end of the last answer and close.
  read_head,     ///< Wait for the next request.
  read_body,     ///< Wait for the small body of a request that was let in.
  send_on,       ///< Wait until the client takes more of its answer.
  begin_upload,  ///< Wait for a place among those whose bodies are read by a worker.
  end            ///< Close the connection.
};

/// Belongs to one thread at a time: the lobby's, or that of the worker who serves it.
struct Visit {
  Visit(engine::FileDescriptor socket, const ConnectionLimits& limits, int stop_fd, Places& places)
      : connection(std::move(socket), limits, stop_fd), place(places, network_of(connection.client())) {}

  /// Forgets the request, and gives back what its answer held.
  void end_request() {
    answer = {};
    checked.reset();
    under_way.reset();
    awaits_no_body = is_answered = false;
  }

  Connection connection;
  const Places::Place place;
  Next next = Next::read_head;
  int requests = 0;  ///< That have begun on this connection.

  // Of the request under way.
  RequestHead head;
  std::string client;  ///< The address its client goes by: the connection's, or what a trusted proxy says.
  std::string request_id;
  /// When its head was whole; until then, when its head or the connection began.
  std::chrono::steady_clock::time_point arrived = std::chrono::steady_clock::now();
  std::optional<CheckedRequest> checked;
  bool awaits_no_body = false;  ///< The body is here, or will be read by the worker who has the visit.
  bool is_answered = false;     ///< What is left is to send the answer.
  bool keep = false;            ///< Another request may follow on the connection.
  bool stepped_aside = false;   ///< Its worker does not count among the workers any more.
  Answer answer;
  std::shared_ptr<const void> under_way;  ///< Counted as long as this lives.
  UnsentBytes::Share unsent;              ///< Its connection's bytes_held() when the lobby saw it last.
};

}  // namespace server::http
