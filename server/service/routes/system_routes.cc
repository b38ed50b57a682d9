#include "server/service/routes/system_routes.h"

#include <memory>
#include <string>
#include <utility>

#include "server/http/negotiation.h"

namespace server::service::routes {
namespace {

using engine::Result;
using http::Access;
using http::Body;
using http::Call;
using http::Reply;

/// The page runs its own scripts and nothing else; pictures may also come from memory (a render as a blob).
constexpr const char* page_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "font-src 'self'; worker-src 'self'; manifest-src 'self'; form-action 'none'; base-uri 'none'; "
    "frame-ancestors 'none'";

void get(http::Router& router, const std::string& path, http::Handler handler, Access access) {
  router.add({"GET", path, std::move(handler), Body::none, {}, access});
}

Reply file_reply(const std::string& name, std::string_view bytes, const std::string& etag) {
  Reply reply;
  reply.media_type = http::media_type_of_file(name);
  reply.etag = etag;
  reply.body = bytes;
  return reply;
}

/// Where a client names no encodings it gets none: it may be unable to undo it.
bool takes_gzip(const Call& call) {
  const std::string encodings = call.header("accept-encoding");
  return !encodings.empty() && http::accepts(encodings, "gzip");
}

void add_page(http::Router& router, const std::vector<EmbeddedFile>& page) {
  for (const EmbeddedFile& file : page) {
    const auto handler = [file, etag = http::etag_of(file.bytes)](const Call& call) -> Result<Reply> {
      const bool packed = !file.gzip.empty() && takes_gzip(call);
      // Other bytes are another representation: its tag is another one.
      Reply reply = packed ? file_reply(std::string(file.name), file.gzip, etag + "-gzip")
                           : file_reply(std::string(file.name), file.bytes, etag);
      reply.headers = {{"Vary", "Accept-Encoding"},
                       {"Content-Security-Policy", page_policy},
                       {"Referrer-Policy", "no-referrer"},
                       {"X-Frame-Options", "DENY"},
                       {"Cross-Origin-Opener-Policy", "same-origin"}};
      if (packed) reply.headers.emplace_back("Content-Encoding", "gzip");
      return reply;
    };
    get(router, "/" + std::string(file.name), handler, Access::open);
    if (file.name == "index.html") get(router, "/", handler, Access::open);
  }
}

/// A cookie that scripts cannot read and that no other site's request carries.
std::string cookie(const std::string& value, const std::string& more) {
  return std::string(http::AccessGuard::cookie_name) + "=" + value + "; HttpOnly; SameSite=Strict; Path=/" + more;
}

void add_session(http::Router& router, http::AccessGuard& guard) {
  const auto open = [&guard](const Call& call) -> Result<Reply> {
    Reply reply = Reply::no_content();
    const http::TokenPtr token = call.token();
    if (token == nullptr) return reply;
    const bool secure = guard.is_secure(call.header("x-forwarded-proto"));
    const auto session = guard.open_session(*token);
    if (!session) return engine::fail(engine::ErrorCode::unavailable, "the token was taken away just now");
    reply.headers.emplace_back("Set-Cookie", cookie(*session, secure ? "; Secure" : ""));
    return reply;
  };
  const auto close = [&guard](const Call& call) -> Result<Reply> {
    guard.close_session(call.header("cookie"));
    Reply reply = Reply::no_content();
    reply.headers.emplace_back("Set-Cookie", cookie("", "; Max-Age=0"));
    return reply;
  };
  router.add({"POST", "/v1/session", open, Body::none, {}, Access::token});
  router.add({"DELETE", "/v1/session", close, Body::none, {}, Access::open});
}

}  // namespace

void add_health_routes(http::Router& router, const http::Metrics& metrics, const Trouble& trouble) {
  const auto healthy = [](const Call&) -> Result<Reply> { return Reply::json(R"({"status":"ok"})"); };
  router.add({"GET", "/healthz", healthy, Body::none, {}, Access::open, /*vital=*/true});
  const auto ready = [trouble](const Call&) -> Result<Reply> {
    if (const auto error = trouble())
      return engine::fail(engine::ErrorCode::unavailable, "the service cannot work: " + error->message, error->where);
    return Reply::json(R"({"ready":true})");
  };
  router.add({"GET", "/readyz", ready, Body::none, {}, Access::open, /*vital=*/true});
  const auto numbers = [&metrics](const Call&) -> Result<Reply> {
    Reply reply;
    reply.media_type = http::Metrics::media_type;
    reply.body = metrics.text();
    return reply;
  };
  get(router, "/metrics", numbers, Access::admin);
}

void add_system_routes(http::Router& router, const SystemRouteDependencies& dependencies) {
  add_health_routes(router, dependencies.metrics, dependencies.trouble);
  const auto contract = [bytes = dependencies.contract, etag = http::etag_of(dependencies.contract)](
                            const Call&) -> Result<Reply> { return file_reply("openapi.yaml", bytes, etag); };
  get(router, "/openapi.yaml", contract, Access::read);
  // Who gets as far as the handler is authorised.
  const auto info = [text = proto::to_json(dependencies.info, true)](const Call&) -> Result<Reply> {
    return Reply::json(text);
  };
  get(router, "/v1/info", info, Access::read);
  add_session(router, dependencies.guard);
  add_page(router, dependencies.page);
}

}  // namespace server::service::routes
