#include "server/http/dispatcher.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <exception>
#include <new>

#include "server/http/call.h"
#include "server/http/log.h"
#include "server/http/negotiation.h"
#include "server/http/url.h"

namespace server::http {

using engine::ErrorCode;

namespace {

tl::unexpected<Refusal> refuse(int status, std::string code, std::string detail, std::string where = {}) {
  return tl::make_unexpected(Refusal{status, std::move(code), std::move(detail), std::move(where)});
}

bool has_header(const Answer& answer, std::string_view name) {
  return std::any_of(answer.headers.begin(), answer.headers.end(),
                     [&](const auto& header) { return same_ignoring_case(header.first, name); });
}

void set_default(Answer& answer, const std::string& name, std::string value) {
  if (!has_header(answer, name)) answer.headers.emplace_back(name, std::move(value));
}

/// A value as it may stand in a header: whatever would begin another line is dropped.
std::string header_value(std::string value) {
  std::erase_if(value, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  return value;
}

void add_common_headers(Answer& answer, const std::string& request_id) {
  set_default(answer, "X-Request-Id", request_id);
  set_default(answer, "X-Content-Type-Options", "nosniff");
  set_default(answer, "Cache-Control", "private, no-cache");
  set_default(answer, "Cross-Origin-Resource-Policy", "same-origin");
  set_default(answer, "Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'");
}

bool is_empty_object(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; });
  return text.empty() || text == "{}";
}

bool names_other_charset(const std::string& content_type) {
  const auto parameters = split_list(content_type, ';');
  return std::any_of(parameters.begin(), parameters.end(), [](std::string_view parameter) {
    return lower_case(parameter).starts_with("charset=") && !same_ignoring_case(parameter, "charset=utf-8") &&
           !same_ignoring_case(parameter, "charset=\"utf-8\"");
  });
}

/// A stream that ends with the token of whoever listens.
class GuardedSink final : public EventSink {
 public:
  GuardedSink(EventSink& sink, const AccessGuard& guard, TokenPtr token)
      : sink_(sink), guard_(guard), token_(std::move(token)) {}

  bool send(std::string_view event, std::string_view id, std::string_view data) override {
    return guard_.still_knows(token_.get()) && sink_.send(event, id, data);
  }
  bool keep_alive() override { return guard_.still_knows(token_.get()) && sink_.keep_alive(); }
  [[nodiscard]] bool open() const override { return guard_.still_knows(token_.get()) && sink_.open(); }

 private:
  EventSink& sink_;
  const AccessGuard& guard_;
  const TokenPtr token_;
};

/// What the token of a request needs; nothing: any will do.
std::optional<Scope> scope_of(const CheckedRequest& request) {
  const Route& route = *request.match.route;
  switch (route.access) {
    case Access::open:
    case Access::token:
      return std::nullopt;
    case Access::read:
      return Scope::read;
    case Access::edit: {
      const auto flag = request.query.find(route.reads_with);
      return flag != request.query.end() && flag->second == "true" ? Scope::read : Scope::edit;
    }
    case Access::admin:
      return Scope::admin;
  }
  return Scope::admin;
}

}  // namespace

std::string request_id_of(const RequestHead& head) {
  const std::string given = head.header("x-request-id");
  const bool sane = !given.empty() && given.size() <= 64 && std::all_of(given.begin(), given.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_' ||
           c == '.';
  });
  return sane ? given : random_id();
}

Answer Dispatcher::refused(const Refusal& refusal, const std::string& request_id) {
  Reply reply = Reply::refusal(refusal, request_id);
  Answer answer;
  answer.status = reply.status;
  answer.refusal = refusal.code;
  answer.headers = std::move(reply.headers);
  answer.headers.emplace_back("Content-Type", std::move(reply.media_type));
  answer.body = std::move(reply.body);
  add_common_headers(answer, request_id);
  return answer;
}

bool Dispatcher::is_vital(const RequestHead& head) const {
  if (!head.only_reads() || head.has_body()) return false;
  const auto segments = split_path(head.path);
  const Route* const route = segments ? routes_.find(head.method, *segments).route : nullptr;
  return route != nullptr && route->vital;
}

CheckedRequest Dispatcher::check(const RequestHead& head, const std::string& client) const {
  CheckedRequest request;
  if (auto checked = check_into(request, head, client); !checked) request.refusal = std::move(checked.error());
  return request;
}

tl::expected<void, Refusal> Dispatcher::check_into(CheckedRequest& request, const RequestHead& head,
                                                   const std::string& client) const {
  if (auto refusal = guard_.check_origin(head)) return tl::make_unexpected(std::move(*refusal));
  const auto segments = split_path(head.path);
  if (segments) request.match = routes_.find(head.method, *segments);
  const Route* const route = request.match.route;
  // Whoever has no token learns nothing about routes but those that are open to all.
  if (auto known = check_token(request, head, client); !known) {
    request.is_audited = true;
    return known;
  }
  if (!segments) return tl::make_unexpected(refusal_of(segments.error()));
  if (route == nullptr && !request.match.allow.empty())
    return refuse(405, "method_not_allowed", "this address takes " + request.match.allow);
  if (route == nullptr) return refuse(404, "not_found", routes_.of_others());
  const auto query = parse_query(head.query);
  if (!query) return tl::make_unexpected(refusal_of(query.error()));
  for (const auto& [name, value] : *query) {
    if (std::find(route->queries.begin(), route->queries.end(), name) == route->queries.end())
      return refuse(400, "invalid_argument", "this address has no such query parameter", name);
    if (!request.query.emplace(name, value).second)
      return refuse(400, "invalid_argument", "this query parameter is given twice", name);
  }
  const auto scope = scope_of(request);
  request.is_audited = route->method != "GET" && scope != Scope::read;
  if (scope)
    if (auto refusal = AccessGuard::check_scope(request.token.get(), *scope)) {
      request.is_audited = true;
      return tl::make_unexpected(std::move(*refusal));
    }
  return check_body(head, *route);
}

tl::expected<void, Refusal> Dispatcher::check_token(CheckedRequest& request, const RequestHead& head,
                                                    const std::string& client) const {
  const Route* const route = request.match.route;
  const Access access = route == nullptr ? Access::read : route->access;
  if (access == Access::open) {
    request.token = guard_.token_of_session(head.header("cookie"));
    return {};
  }
  auto token = access == Access::token ? guard_.check_token(head.header("authorization"), client)
                                       : guard_.check_access(head, client);
  if (!token) return tl::make_unexpected(std::move(token.error()));
  request.token = std::move(*token);
  return {};
}

tl::expected<void, Refusal> Dispatcher::check_body(const RequestHead& head, const Route& route) const {
  if (!head.has_body()) return {};
  const std::string coding = head.header("content-encoding");
  if (!coding.empty() && !same_ignoring_case(coding, "identity"))
    return refuse(415, "unsupported_media_type", "a request's body may not be compressed (Content-Encoding)");
  const std::string content_type = head.header("content-type"), media_type = media_type_of(content_type);
  const bool is_json = media_type == "application/json";
  if (route.body == Body::json && (!is_json || names_other_charset(content_type)))
    return refuse(415, "unsupported_media_type", "this address takes application/json, in UTF-8");
  if (route.body == Body::upload && media_type == "multipart/form-data" && !boundary_of(content_type))
    return refuse(400, "invalid_argument", "a multipart form needs a boundary in its Content-Type");
  const bool is_file = route.body == Body::upload && !is_json;
  const std::uint64_t limit = is_file ? options_.max_upload_bytes : options_.max_json_bytes;
  if (head.content_length.value_or(0) > limit)
    return refuse(413, "too_large",
                  "the request's body may have " + std::to_string(limit) + " bytes; the service's option " +
                      (is_file ? "--max-upload-bytes" : "--max-json-bytes") + " sets this limit");
  return {};
}

Result<Reply> Dispatcher::handle(const CheckedRequest& request, const RequestHead& head, const std::string& request_id,
                                 Connection& connection, FormReader& form) const {
  const Route& route = *request.match.route;
  const bool is_json = route.body == Body::upload && media_type_of(head.header("content-type")) == "application/json";
  std::string body;
  if (head.has_body() && (route.body != Body::upload || is_json)) {
    auto text = read_text(connection, options_.max_json_bytes, "--max-json-bytes");
    if (!text) return engine::propagate(text);
    if (route.body == Body::none && !is_empty_object(*text))
      return engine::fail(ErrorCode::invalid_argument, "this address takes no body");
    if (route.body != Body::none) body = std::move(*text);
  }
  const HttpCall call({head, request_id, request.match.values, request.query, std::move(body), is_json, connection,
                       form, options_.max_upload_bytes, request.token});
  auto reply = route.handler(call);
  if (reply && reply->events)
    reply->events = [this, token = request.token, events = std::move(reply->events)](EventSink& sink) {
      GuardedSink guarded(sink, guard_, token);
      events(guarded);
    };
  return reply;
}

tl::expected<void, Refusal> Dispatcher::fill_with_file(Answer& answer, const Reply& reply,
                                                       const RequestHead& head) const {
  auto file = std::make_shared<const engine::FileDescriptor>(::open(reply.file->c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (file->get() < 0 || ::fstat(file->get(), &status) != 0 || !S_ISREG(status.st_mode))
    return refuse(503, "unavailable", "the file cannot be read just now");
  const auto size = std::uint64_t(status.st_size);
  answer.headers.emplace_back("Accept-Ranges", "bytes");
  const std::string if_range = head.header("if-range");
  // A client that goes on with a download wants the rest of that very file, or all of the present one.
  // HEAD knows no ranges (RFC 9110, section 14.2).
  const bool may_split =
      head.method == "GET" && answer.status == 200 && (if_range.empty() || if_range == '"' + reply.etag + '"');
  const RangeChoice choice = may_split ? choose_range(head.header("range"), size) : RangeChoice{};
  if (choice.kind == RangeKind::unsatisfiable) {
    answer.headers.emplace_back("Content-Range", "bytes */" + std::to_string(size));
    return refuse(416, "invalid_argument", "the range begins beyond the file's " + std::to_string(size) + " bytes");
  }
  if (choice.kind == RangeKind::whole) {
    answer.file = Answer::FilePart{std::move(file), 0, size};
    return {};
  }
  const auto [first, last] = choice.range;
  answer.status = 206;
  answer.headers.emplace_back(
      "Content-Range", "bytes " + std::to_string(first) + "-" + std::to_string(last) + "/" + std::to_string(size));
  answer.file = Answer::FilePart{std::move(file), first, last - first + 1};
  return {};
}

tl::expected<void, Refusal> Dispatcher::fill(Answer& answer, Reply reply, const RequestHead& head) {
  for (auto& [name, value] : reply.headers) answer.headers.emplace_back(name, header_value(std::move(value)));
  answer.status = reply.status;
  answer.about = std::move(reply.about);
  answer.hold = std::move(reply.hold);
  const bool plain = !reply.file && !reply.events;
  if (reply.etag.empty() && head.only_reads() && reply.status == 200 && plain && reply.media_type == "application/json")
    reply.etag = etag_of(reply.body);
  if (!reply.etag.empty()) answer.headers.emplace_back("ETag", '"' + header_value(reply.etag) + '"');
  const std::string known = head.header("if-none-match");
  if (head.only_reads() && reply.status == 200 && !reply.etag.empty() && !known.empty() &&
      names_etag(known, reply.etag))
    answer.status = 304;
  if (answer.status == 204 || answer.status == 304) return {};
  answer.headers.emplace_back("Content-Type", header_value(reply.media_type));
  if (reply.file) return fill_with_file(answer, reply, head);
  if (!reply.events) {
    answer.body = std::move(reply.body);
    return {};
  }
  if (streams_.fetch_add(1) >= options_.max_streams) {
    --streams_;
    return refuse(429, "busy",
                  "there may be " + std::to_string(options_.max_streams) +
                      " streams of events at a time; the service's option --max-streams sets this limit");
  }
  count_stream_(1);
  answer.hold = std::shared_ptr<const void>(nullptr, [this, held = std::move(answer.hold)](const void*) {
    --streams_;
    count_stream_(-1);
  });
  answer.headers.emplace_back("X-Accel-Buffering", "no");  // a proxy that buffers would hold events back
  answer.events = std::move(reply.events);
  return {};
}

Answer Dispatcher::answer(const CheckedRequest& request, const RequestHead& head, const std::string& request_id,
                          Connection& connection, FormReader& form) {
  Answer answer;
  if (request.match.route != nullptr) answer.route = request.match.route->path;
  const auto refuse_with = [&](const Refusal& refusal) {
    Answer refusing = refused(refusal, request_id);
    refusing.route = answer.route;
    for (auto& header : answer.headers)
      if (header.first == "Content-Range") refusing.headers.push_back(std::move(header));
    if (refusal.status == 405) refusing.headers.emplace_back("Allow", request.match.allow);
    return refusing;
  };
  try {
    if (request.refusal) return refuse_with(*request.refusal);
    auto reply = handle(request, head, request_id, connection, form);
    if (!reply && connection.body_failure() == Connection::BodyFailure::too_slow)
      return refuse_with({408, "request_timeout", "the request's body arrived too slowly", ""});
    if (!reply) {
      if (reply.error().code == ErrorCode::internal)
        log(logger_, spdlog::level::err, "bug: " + reply.error().message,
            {{"request_id", request_id}, {"route", answer.route}});
      return refuse_with(refusal_of(reply.error()));
    }
    if (const auto filled = fill(answer, std::move(*reply), head); !filled) return refuse_with(filled.error());
  } catch (const std::bad_alloc&) {
    return refuse_with({503, "unavailable", "this machine has not enough memory for that just now", ""});
  } catch (const std::exception& bug) {
    log(logger_, spdlog::level::err, std::string("bug: ") + bug.what(),
        {{"request_id", request_id}, {"route", answer.route}});
    return refuse_with({500, "internal", "this is a bug of the service; its log says more", ""});
  }
  add_common_headers(answer, request_id);
  return answer;
}

}  // namespace server::http
