#include "server/service/routes/edit_routes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/numbers.h"
#include "proto/edit_request.h"
#include "proto/edit_status.h"
#include "server/edits/convert.h"
#include "server/http/negotiation.h"

namespace server::service::routes {
namespace {

using edits::EditService;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;
using http::Call;
using http::Reply;
using std::chrono::steady_clock;

// Choices, not measurements:
constexpr int max_listed = 1000;                             // edits in one answer, as openapi.yaml says
constexpr std::size_t max_key_bytes = 200;                   // of an Idempotency-Key, as openapi.yaml says
constexpr double longest_retry_seconds = 3600;               // what is left of an edit is an estimate
constexpr std::chrono::milliseconds look_around_every{500};  // between two looks of a stream whether it is to end

Result<bool> flag(const Call& call, const std::string& name) {
  const auto text = call.query(name);
  if (!text || *text == "false") return false;
  if (*text == "true") return true;
  return fail(ErrorCode::invalid_argument, name + " is true or false", name);
}

/// A part of the path that is a number; what is none names nothing that exists.
Result<int> number_in_path(const Call& call, const std::string& name) {
  if (const auto number = engine::number_in<int>(call.path(name))) return *number;
  return fail(ErrorCode::not_found, "the path has a whole number here", name);
}

/// Empty: the client gave none. One that is there and empty is a client's mistake: it believes itself safe to repeat.
Result<std::string> idempotency_key(const Call& call) {
  if (!call.has_header("Idempotency-Key")) return std::string();
  const std::string key = call.header("Idempotency-Key");
  const bool printable = std::all_of(key.begin(), key.end(), [](char c) { return c >= ' ' && c <= '~'; });
  if (!key.empty() && key.size() <= max_key_bytes && printable) return key;
  return fail(ErrorCode::invalid_argument, "an idempotency key has 1 to 200 printable ASCII characters",
              "Idempotency-Key");
}

/// A 200 with the edit, or the error.
Result<Reply> reply_with(const Result<proto::EditStatus>& status) {
  if (!status) return propagate(status);
  return Reply::json(proto::to_json(*status));
}

engine::Error beyond(const std::string& limit, const std::string& option, std::string where) {
  return {ErrorCode::too_large, "the limit is " + limit + "; the service's option " + option + " sets it",
          std::move(where)};
}

/// Holds a value against a limit. What is not given is left to the preset, or is the limit where that is less.
Result<void> check(std::optional<int>& value, int usual, int limit, const std::string& option,
                   const std::string& where) {
  if (value && *value > limit) return tl::make_unexpected(beyond(std::to_string(limit), option, where));
  if (!value && usual > limit) value = limit;
  return {};
}

/// The edit that a request's body asks for.
Result<proto::EditRequest> requested(const Call& call, const EditLimits& limits) {
  auto request = proto::parse_edit_request(call.body());
  if (!request) return request;
  if (request->handles.size() > limits.handles)
    return tl::make_unexpected(beyond(std::to_string(limits.handles), "--max-handles", "handles"));
  const engine::edit::Params usual = edits::preset_params(edits::preset_of(*request));
  proto::Params& params = request->params;
  if (auto ok = check(params.views, usual.views, limits.views, "--max-views", "params.views"); !ok)
    return propagate(ok);
  if (auto ok = check(params.max_image_side, usual.max_image_side, limits.image_side, "--max-image-side",
                      "params.max_image_side");
      !ok)
    return propagate(ok);
  return request;
}

Result<Reply> post_preview(const Call& call, EditService& service, const EditLimits& limits) {
  const auto request = requested(call, limits);
  if (!request) return propagate(request);
  const auto preview = service.preview(*request);
  if (!preview) return propagate(preview);
  return Reply::json(proto::to_json(*preview));
}

int seconds_until_tomorrow() {
  const auto now = std::chrono::system_clock::now();
  return int(std::chrono::ceil<std::chrono::seconds>(std::chrono::ceil<std::chrono::days>(now) - now).count());
}

/// An edit that there is no room for. A full queue takes none before the running one is done, and mostly so does a
/// quota of edits; whoever asks each second until then only takes time from it. A quota of seconds is that of a day.
Reply no_room(const Call& call, const engine::Error& error, EditService& service) {
  http::Refusal refusal = http::refusal_of(error);
  const double seconds = std::ceil(service.seconds_until_room().value_or(1));
  refusal.retry_after = error.code == ErrorCode::quota_exceeded && error.where == "seconds"
                            ? seconds_until_tomorrow()
                            : int(std::clamp(seconds, 1.0, longest_retry_seconds));
  return Reply::refusal(refusal, call.request_id());
}

EditService::Requester requester_of(const Call& call) {
  const http::TokenPtr token = call.token();
  if (token == nullptr) return {};
  EditService::Requester requester{.name = token->name, .quota = {.active = token->quotas.edits}};
  if (token->quotas.seconds) requester.quota.worked_per_day = std::chrono::seconds(*token->quotas.seconds);
  return requester;
}

Result<Reply> post_edit(const Call& call, EditService& service, const EditLimits& limits) {
  const auto only_validate = flag(call, "validate_only");
  if (!only_validate) return propagate(only_validate);
  const auto key = idempotency_key(call);
  if (!key) return propagate(key);
  const auto request = requested(call, limits);
  if (!request) return propagate(request);
  if (*only_validate) {
    const auto estimate = service.estimate(*request);
    if (!estimate) return propagate(estimate);
    return Reply::json(proto::to_json(*estimate));
  }
  const auto submission = service.submit(*request, *key, requester_of(call));
  if (!submission &&
      (submission.error().code == ErrorCode::busy || submission.error().code == ErrorCode::quota_exceeded))
    return no_room(call, submission.error(), service);
  if (!submission) return propagate(submission);
  Reply reply = Reply::json(proto::to_json(submission->status), 202);
  reply.headers.emplace_back("Location", "/v1/edits/" + submission->status.id);
  reply.headers.emplace_back("Retry-After", "1");
  reply.about = {{"scene", submission->status.scene}};
  if (!submission->created) reply.headers.emplace_back("Idempotent-Replayed", "true");
  return reply;
}

Result<Reply> list_edits(const Call& call, EditService& service) {
  EditService::Filter filter;
  filter.scene = call.query("scene");
  const auto active = flag(call, "active");
  if (!active) return propagate(active);
  filter.active_only = *active;
  if (const auto text = call.query("limit")) {
    const auto limit = engine::number_in<int>(*text);
    if (!limit || *limit < 1 || *limit > max_listed)
      return fail(ErrorCode::invalid_argument, "limit is a whole number from 1 to 1000", "limit");
    filter.limit = std::size_t(*limit);
  }
  const auto edits = service.list(filter);
  if (!edits) return propagate(edits);
  return Reply::json(proto::to_json(*edits));
}

/// Sends the edit whenever its JSON is another, until it has ended, is gone, or nobody listens any more.
void stream(const std::string& id, EditService& service, const EditRouteOptions& options, http::EventSink& sink) {
  std::string sent;
  std::uint64_t events = 0;
  auto last_sign = steady_clock::now();
  while (sink.open()) {
    const auto seen = service.version();  // before the look: what happens in between ends the wait at once
    const auto status = service.find(id);
    if (!status) return;
    if (std::string now = proto::to_json(*status); now != sent) {
      if (!sink.send("edit", std::to_string(++events), now)) return;
      sent = std::move(now);
      last_sign = steady_clock::now();
    }
    if (status->ended) return;
    if (steady_clock::now() - last_sign >= options.keep_alive) {
      if (!sink.keep_alive()) return;
      last_sign = steady_clock::now();
    }
    service.wait_for_change(seen, std::min(look_around_every, options.keep_alive));
  }
}

Result<Reply> get_events(const Call& call, EditService& service, const EditRouteOptions& options) {
  const std::string& id = call.path("id");
  if (const auto status = service.find(id); !status) return propagate(status);
  Reply reply;
  reply.media_type = "text/event-stream";
  reply.events = [id, &service, options](http::EventSink& sink) { stream(id, service, options, sink); };
  return reply;
}

Result<Reply> get_interval_render(const Call& call, EditService& service) {
  const auto interval = number_in_path(call, "u");
  if (!interval) return propagate(interval);
  const auto view = number_in_path(call, "k");
  if (!view) return propagate(view);
  const auto stage = call.query("stage");
  if (!stage)
    return fail(ErrorCode::invalid_argument, "say which: stage is before, deformed, corrected or optimised", "stage");
  auto picture = service.interval_picture(call.path("id"), *interval, *view, *stage);
  if (!picture) return propagate(picture);
  Reply reply;
  reply.media_type = "image/jpeg";
  reply.etag = http::etag_of(*picture);
  if (call.has(reply.etag)) return Reply::not_modified(std::move(reply.etag));
  reply.body = std::move(*picture);
  return reply;
}

Result<Reply> delete_edit(const Call& call, EditService& service) {
  if (const auto removed = service.remove(call.path("id")); !removed) return propagate(removed);
  return Reply::no_content();
}

}  // namespace

void add_edit_routes(http::Router& router, EditService& service, const EditRouteOptions& options) {
  using http::Access;
  using http::Body;
  const auto add = [&](const char* method, const char* path, Access access, auto answer, Body body = Body::none,
                       const std::vector<std::string>& queries = {}, const std::string& reads_with = {}) {
    router.add({.method = method,
                .path = path,
                .handler = [&service, answer](const Call& call) -> Result<Reply> { return answer(call, service); },
                .body = body,
                .queries = queries,
                .access = access,
                .reads_with = reads_with});
  };
  const EditLimits limits = options.limits;
  add(
      "POST", "/v1/previews", Access::read,
      [limits](const Call& call, EditService& s) { return post_preview(call, s, limits); }, Body::json);
  add(
      "POST", "/v1/edits", Access::edit,
      [limits](const Call& call, EditService& s) { return post_edit(call, s, limits); }, Body::json, {"validate_only"},
      "validate_only");
  add("GET", "/v1/edits", Access::read, list_edits, Body::none, {"scene", "active", "limit"});
  add("GET", "/v1/edits/{id}", Access::read,
      [](const Call& call, EditService& s) { return reply_with(s.find(call.path("id"))); });
  add("DELETE", "/v1/edits/{id}", Access::edit, delete_edit);
  add("GET", "/v1/edits/{id}/events", Access::read,
      [options](const Call& call, EditService& s) { return get_events(call, s, options); });
  add("GET", "/v1/edits/{id}/intervals/{u}/renders/{k}", Access::read, get_interval_render, Body::none, {"stage"});
  add("POST", "/v1/edits/{id}/stop", Access::edit,
      [](const Call& call, EditService& s) { return reply_with(s.stop(call.path("id"))); });
  add("POST", "/v1/edits/{id}/cancel", Access::edit,
      [](const Call& call, EditService& s) { return reply_with(s.cancel(call.path("id"))); });
  add("POST", "/v1/edits/{id}/requeue", Access::admin,
      [](const Call& call, EditService& s) { return reply_with(s.requeue(call.path("id"))); });
}

}  // namespace server::service::routes
