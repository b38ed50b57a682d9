// Routes: what a request is to its handler, what a handler answers, and the table that connects them. A handler sees no
// HTTP library; it gets a Call, and gives a Reply or an Error, which becomes problem+json.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "server/http/request_head.h"
#include "server/http/token.h"

namespace server::http {

using engine::Result;

/// An upload that has arrived in a file.
struct UploadInfo {
  std::string filename;     ///< Base name that the client gave; may be empty.
  std::uint64_t bytes = 0;  ///< Size of the file.
};

/// What a request says, to its handler.
class Call {
 public:
  virtual ~Call() = default;

  [[nodiscard]] virtual const std::string& request_id() const = 0;
  /// The token that the request came with, or its session was opened with; null where the service has none.
  [[nodiscard]] virtual TokenPtr token() const { return nullptr; }
  /// The part of the path that stands for {name} in the route.
  [[nodiscard]] virtual const std::string& path(std::string_view name) const = 0;
  /// Query parameters by name; one given twice, or not declared by the route, has been refused already.
  [[nodiscard]] virtual std::optional<std::string> query(std::string_view name) const = 0;
  /// A header; empty if there is none.
  [[nodiscard]] virtual std::string header(std::string_view name) const = 0;
  /// Whether there is one, be it empty.
  [[nodiscard]] virtual bool has_header(std::string_view name) const = 0;
  /// The JSON text of a Body::json route.
  [[nodiscard]] virtual const std::string& body() const = 0;
  /// Whether a Body::upload request is JSON; its text is then body().
  [[nodiscard]] virtual bool is_json() const = 0;
  /// Body::upload: streams the raw body, or the one file of a multipart form, into a new file, which is on disk when
  /// this returns. On an error nothing is left of it.
  ///   errors  too_large: names the limit; invalid_argument: a form without a file or with several, a body that ends
  ///           early; no_space; unavailable
  [[nodiscard]] virtual Result<UploadInfo> receive(const std::filesystem::path& file) const = 0;
  /// Whether a GET names this entity tag as one that its client has (If-None-Match): then Reply::not_modified() saves
  /// the work.
  [[nodiscard]] virtual bool has(const std::string& etag) const = 0;
  /// Whether nobody waits for the answer any more, or the server is stopping; for work that takes long. A client that
  /// has closed its end has gone; so is one taken to be that has only said that it sends no more, for the two look the
  /// same from here.
  [[nodiscard]] virtual bool gone() const { return false; }
  /// Whether the Accept header takes this media type (none given: all).
  [[nodiscard]] virtual bool accepts(std::string_view media_type) const = 0;
};

/// The client's end of a stream of server-sent events.
class EventSink {
 public:
  virtual ~EventSink() = default;
  /// Writes one event; false once the client has gone or the server is stopping.
  virtual bool send(std::string_view event, std::string_view id, std::string_view data) = 0;
  /// A comment line, so that a dead connection is noticed and a live one stays open.
  virtual bool keep_alive() = 0;
  /// Whether there is still someone to write to: false once the client has gone or the server is stopping. Cheap; a
  /// stream that waits for news asks every second or so, so that it never holds up a server that wants to stop.
  [[nodiscard]] virtual bool open() const = 0;
};

/// How an error is answered.
[[nodiscard]] Refusal refusal_of(const engine::Error& error);

/// What a handler says to a request; the dispatcher makes an Answer of it.
struct Reply {
  int status = 200;
  std::string media_type = "application/json";
  std::string body;
  /// The entity tag: strong, without quotes. If it is empty on a 200 to a GET with a JSON body, a hash of the body is
  /// used. A GET whose
  /// If-None-Match names it is answered by 304 without body.
  std::string etag;
  std::vector<std::pair<std::string, std::string>> headers;
  /// The body is this file's bytes; Range is honoured. `hold` keeps whatever must live until it is sent.
  std::optional<std::filesystem::path> file;
  std::shared_ptr<const void> hold;
  /// The body is a stream of events: called once on the connection's thread, returns when the stream is over. Counts
  /// against the limit of streams (busy).
  std::function<void(EventSink&)> events;

  /// What the audit log says of it beside what its path and Location name: "scene" and "s000001".
  std::vector<std::pair<std::string, std::string>> about = {};

  [[nodiscard]] static Reply json(std::string text, int status = 200);
  [[nodiscard]] static Reply not_modified(std::string etag);
  [[nodiscard]] static Reply no_content();
  /// problem+json, with the headers that its status wants.
  [[nodiscard]] static Reply refusal(const Refusal& refusal, const std::string& request_id);
};

using Handler = std::function<Result<Reply>(const Call&)>;

enum class Body { none, json, upload };
/// What a route wants, where the service has tokens.
enum class Access {
  open,   ///< Nothing: health, signing out, and the page's own files.
  token,  ///< A token in the request itself, no cookie: signing in.
  read,   ///< A token, or a session's cookie, of Scope::read. The same for those that follow.
  edit,
  admin
};

/// One entry of the table.
struct Route {
  std::string method;  ///< "GET", "POST", "PUT", "PATCH", "DELETE"
  std::string path;    ///< "/v1/scenes/{id}", as in openapi.yaml
  Handler handler;
  Body body = Body::none;
  std::vector<std::string> queries = {};  ///< Names of the query parameters that the route knows.
  Access access = Access::admin;          ///< A route that nothing is said of is for operators.
  /// Answered although all threads are busy, on one that does nothing else: a GET whose handler waits for nobody.
  bool vital = false;
  /// Of a route that changes something: the query parameter with which it changes nothing, if that is "true". Then
  /// Scope::read is enough.
  std::string reads_with = {};
};

/// The routes of the service, in the order they were added.
class Router {
 public:
  void add(Route route) { routes_.push_back(std::move(route)); }
  [[nodiscard]] const std::vector<Route>& routes() const { return routes_; }
  /// What those are told who ask for an address that no route has.
  void say_of_others(std::string sentence) { of_others_ = std::move(sentence); }
  [[nodiscard]] const std::string& of_others() const { return of_others_; }

 private:
  std::vector<Route> routes_;
  std::string of_others_ = "there is no such address in this service";
};

}  // namespace server::http
