#include "server/http/router.h"

#include "proto/error_code.h"
#include "proto/problem.h"

namespace server::http {

Reply Reply::json(std::string text, int status) {
  Reply reply;
  reply.status = status;
  reply.body = std::move(text);
  return reply;
}

Reply Reply::not_modified(std::string etag) {
  Reply reply;
  reply.status = 304;
  reply.etag = std::move(etag);
  return reply;
}

Reply Reply::no_content() {
  Reply reply;
  reply.status = 204;
  return reply;
}

Refusal refusal_of(const engine::Error& error) {
  Refusal refusal{proto::http_status(error.code), std::string(proto::name_of(error.code)), error.message, error.where};
  // Time alone gives nothing back of most quotas; a route that knows better says so.
  if (error.code == engine::ErrorCode::quota_exceeded) refusal.retry_after = 0;
  return refusal;
}

Reply Reply::refusal(const Refusal& refusal, const std::string& request_id) {
  Reply reply;
  reply.status = refusal.status;
  reply.media_type = "application/problem+json";
  reply.body = proto::to_json(proto::Problem{refusal.status, refusal.code, refusal.detail, refusal.where, request_id});
  if (refusal.status == 401) reply.headers.emplace_back("WWW-Authenticate", "Bearer");
  if (!refusal.scope.empty())  // RFC 6750, section 3.1
    reply.headers.emplace_back("WWW-Authenticate",
                               "Bearer error=\"insufficient_scope\", scope=\"" + refusal.scope + '"');
  if ((refusal.status == 429 || refusal.status == 503) && refusal.retry_after > 0)
    reply.headers.emplace_back("Retry-After", std::to_string(refusal.retry_after));
  return reply;
}

}  // namespace server::http
