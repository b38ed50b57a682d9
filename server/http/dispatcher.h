// From a request's head to its answer: the guards, in their order, then the route's handler. Knows sockets only through
// Connection, and no HTTP library.
#pragma once

#include <spdlog/logger.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "server/http/access_guard.h"
#include "server/http/connection.h"
#include "server/http/request_head.h"
#include "server/http/route_table.h"
#include "server/http/router.h"

namespace server::http {

/// Limits of what a client may send and hold open.
struct DispatcherOptions {
  std::uint64_t max_json_bytes = 1024 * 1024;               ///< Of a JSON body.
  std::uint64_t max_upload_bytes = std::uint64_t{4} << 30;  ///< Of an uploaded file.
  std::size_t max_streams = 16;                             ///< Streams of events open at a time, each on a thread.
};

/// Takes a multipart form apart while it arrives.
class FormReader {
 public:
  virtual ~FormReader() = default;
  /// Calls `part` for each part with its file name (empty: no file), then `data` for pieces of it. Either ends the
  /// reading by false.
  ///   returns  whether the form was read to its end
  [[nodiscard]] virtual bool read(const std::function<bool(const std::string& filename)>& part,
                                  const std::function<bool(std::string_view)>& data) = 0;
};

/// What is sent over the connection: a handler's Reply, a refusal or an error, with all headers.
struct Answer {
  int status = 200;
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  /// The body is `length` bytes of this file from `offset` on.
  struct FilePart {
    std::shared_ptr<const engine::FileDescriptor> descriptor;
    std::uint64_t offset = 0, length = 0;
  };
  std::optional<FilePart> file;
  std::function<void(EventSink&)> events;
  std::shared_ptr<const void> hold;  ///< Lives until the answer is sent.
  std::string refusal;               ///< Code of the error that this answer tells of; "" where it tells of none.
  std::string route = "-";           ///< Path of the route as declared; "-" if no route was found.
  std::vector<std::pair<std::string, std::string>> about = {};  ///< As of Reply.
};

/// A request that was held against the guards: its route and what its query says, or why it is refused.
struct CheckedRequest {
  std::optional<Refusal> refusal;
  RouteMatch match;
  std::map<std::string, std::string, std::less<>> query;
  TokenPtr token;  ///< Of whoever makes it; null where none is needed or none was found.
  /// It stands in the audit log: it is to change something, or is refused for its token.
  bool is_audited = false;
};

/// Safe to call from any thread. The guard and the logger outlive it.
class Dispatcher {
 public:
  Dispatcher(Router router, const AccessGuard& guard, spdlog::logger& logger, const DispatcherOptions& options,
             std::function<void(int)> count_stream)
      : routes_(std::move(router)),
        guard_(guard),
        logger_(logger),
        options_(options),
        count_stream_(std::move(count_stream)) {}

  /// Whether a head asks for a route that is answered although all else waits. Waits for nothing itself.
  [[nodiscard]] bool is_vital(const RequestHead& head) const;
  /// Holds a head against the guards; to be called once for each: wrong tokens are counted.
  ///   client  address that the client goes by
  [[nodiscard]] CheckedRequest check(const RequestHead& head, const std::string& client) const;
  /// Answers what was checked; reads its body, if it is let in. Never throws what a handler threw: that is logged as a
  /// bug and answered by 500.
  [[nodiscard]] Answer answer(const CheckedRequest& request, const RequestHead& head, const std::string& request_id,
                              Connection& connection, FormReader& form);
  /// The answer that tells a client of a refusal.
  [[nodiscard]] static Answer refused(const Refusal& refusal, const std::string& request_id);

 private:
  [[nodiscard]] tl::expected<void, Refusal> check_into(CheckedRequest& request, const RequestHead& head,
                                                       const std::string& client) const;
  /// Whose request it is, and whether they may make requests at all.
  [[nodiscard]] tl::expected<void, Refusal> check_token(CheckedRequest& request, const RequestHead& head,
                                                        const std::string& client) const;
  [[nodiscard]] tl::expected<void, Refusal> check_body(const RequestHead& head, const Route& route) const;
  [[nodiscard]] Result<Reply> handle(const CheckedRequest& request, const RequestHead& head,
                                     const std::string& request_id, Connection& connection, FormReader& form) const;
  [[nodiscard]] tl::expected<void, Refusal> fill(Answer& answer, Reply reply, const RequestHead& head);
  [[nodiscard]] tl::expected<void, Refusal> fill_with_file(Answer& answer, const Reply& reply,
                                                           const RequestHead& head) const;

  const RouteTable routes_;
  const AccessGuard& guard_;
  spdlog::logger& logger_;
  const DispatcherOptions options_;
  const std::function<void(int)> count_stream_;
  std::atomic<std::size_t> streams_ = 0;
};

/// The id a client gave its request, if it is fit to stand in logs, else a new one.
[[nodiscard]] std::string request_id_of(const RequestHead& head);

}  // namespace server::http
