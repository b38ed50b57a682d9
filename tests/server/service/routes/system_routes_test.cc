#include "server/service/routes/system_routes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/server/http/test_server.h"

namespace server::service::routes {
namespace {

using http::RawAnswer;
using nlohmann::json;

class SystemRoutes : public testing::Test {
 protected:
  /// The routes are made over the parts of the server that is to serve them, so those come first.
  struct Service {
    explicit Service(std::vector<http::Token> tokens, std::optional<engine::Error> trouble = std::nullopt)
        : guard({.tokens = std::move(tokens), .allowed_hosts = {}, .allowed_origins = {}}) {
      http::Router router;
      proto::ServiceInfo info;
      info.version = "1.2.3";
      info.correctors = {{"none", true, ""}, {"sd", false, "this build has no libtorch"}};
      info.limits.handles = 256;
      info.token_required = guard.needs_token();
      const std::vector<EmbeddedFile> page{
          {"index.html", "<!doctype html>", ""}, {"main.js", "start()", "as gzip"}, {"icons/a.svg", "<svg/>", ""}};
      add_system_routes(router, {guard, metrics, info, [trouble] { return trouble; }, page, "openapi: 3.1.0\n"});
      http::ServerOptions options;
      options.port = 0;
      server = http::HttpServer::start(options, std::move(router), guard, metrics, log.logger()).value();
    }
    RawAnswer get(const std::string& path, const std::string& more = "") const {
      return http::ask(server->port(), "GET", path, more);
    }
    RawAnswer ask(const std::string& method, const std::string& path, const std::string& more = "") const {
      return http::ask(server->port(), method, path, more);
    }

    http::LogText log;
    http::AccessGuard guard;
    http::Metrics metrics;
    std::unique_ptr<http::HttpServer> server;
  };

  Service open{{}};
};

TEST_F(SystemRoutes, SayThatTheServiceLives) {
  EXPECT_EQ(open.get("/healthz").body, R"({"status":"ok"})");
  EXPECT_EQ(open.get("/readyz").body, R"({"ready":true})");
  const Service broken({}, engine::Error{engine::ErrorCode::no_space, "the disk is full", "jobs.sqlite"});
  EXPECT_EQ(broken.get("/healthz").status, 200);
  const RawAnswer answer = broken.get("/readyz");
  EXPECT_EQ(answer.status, 503);
  EXPECT_EQ(json::parse(answer.body)["code"], "unavailable");
  EXPECT_NE(answer.body.find("the disk is full"), std::string::npos);
}

TEST_F(SystemRoutes, SayWhatTheServiceCanDo) {
  const json info = json::parse(open.get("/v1/info").body);
  EXPECT_EQ(info["version"], "1.2.3");
  EXPECT_EQ(info["correctors"][0], json::parse(R"({"name":"none","available":true,"reason":null})"));
  EXPECT_EQ(info["correctors"][1]["reason"], "this build has no libtorch");
  EXPECT_EQ(info["limits"]["handles"], 256);
  EXPECT_EQ(info["token_required"], false);
  EXPECT_EQ(info["session"], true);
}

TEST_F(SystemRoutes, HandOutMetricsAndContract) {
  open.get("/healthz");
  RawAnswer metrics;  // an answer is counted once it has been sent, which may be a moment after we have read it
  for (int attempt = 0; attempt < 100 && metrics.body.find("route=\"/healthz\"") == std::string::npos; ++attempt)
    metrics = open.get("/metrics");
  EXPECT_EQ(metrics.header("content-type"), "text/plain; version=0.0.4; charset=utf-8");
  EXPECT_NE(metrics.body.find("route=\"/healthz\""), std::string::npos);
  const RawAnswer contract = open.get("/openapi.yaml");
  EXPECT_EQ(contract.header("content-type"), "application/yaml");
  EXPECT_EQ(contract.body, "openapi: 3.1.0\n");
}

TEST_F(SystemRoutes, ServeThePageUnderAStrictPolicy) {
  for (const auto& [path, type, body] :
       std::vector<std::array<std::string, 3>>{{"/", "text/html; charset=utf-8", "<!doctype html>"},
                                               {"/index.html", "text/html; charset=utf-8", "<!doctype html>"},
                                               {"/main.js", "text/javascript; charset=utf-8", "start()"},
                                               {"/icons/a.svg", "image/svg+xml", "<svg/>"}}) {
    const RawAnswer answer = open.get(path);
    EXPECT_EQ(answer.status, 200) << path;
    EXPECT_EQ(answer.header("content-type"), type);
    EXPECT_EQ(answer.body, body);
    EXPECT_NE(answer.header("content-security-policy").find("script-src 'self';"), std::string::npos);
    EXPECT_EQ(answer.header("content-security-policy").find("unsafe"), std::string::npos);
    EXPECT_EQ(answer.headers.count("content-security-policy"), 1u);
    EXPECT_EQ(answer.header("x-frame-options"), "DENY");
    EXPECT_EQ(answer.header("referrer-policy"), "no-referrer");
    EXPECT_EQ(open.get(path, "If-None-Match: " + answer.header("etag") + "\r\n").status, 304);
  }
  EXPECT_EQ(open.get("/icons").status, 404);
  EXPECT_EQ(open.get("/missing.js").status, 404);
}

TEST_F(SystemRoutes, SwapATokenForACookie) {
  const Service service({http::only_token("hush"), {.name = "viewer", .read = true, .secret = "r"}});
  EXPECT_EQ(service.get("/v1/info").status, 401);
  for (const char* path : {"/healthz", "/readyz", "/", "/main.js"}) EXPECT_EQ(service.get(path).status, 200) << path;
  for (const char* path : {"/metrics", "/openapi.yaml"}) EXPECT_EQ(service.get(path).status, 401) << path;
  const RawAnswer wrong = service.ask("POST", "/v1/session", "Authorization: Bearer hus\r\n");
  EXPECT_EQ(wrong.status, 401);
  EXPECT_EQ(wrong.header("set-cookie"), "");
  EXPECT_EQ(json::parse(wrong.body)["request_id"], wrong.header("x-request-id"));
  const RawAnswer right = service.ask("POST", "/v1/session", "Authorization: Bearer hush\r\n");
  EXPECT_EQ(right.status, 204);
  const std::string cookie = right.header("set-cookie");
  EXPECT_NE(cookie.find("; HttpOnly; SameSite=Strict; Path=/"), std::string::npos) << cookie;
  EXPECT_EQ(cookie.find("hush"), std::string::npos);
  const std::string pair = "Cookie: " + cookie.substr(0, cookie.find(';')) + "\r\n";
  EXPECT_EQ(service.get("/v1/info", pair).status, 200);
  EXPECT_EQ(service.ask("POST", "/v1/session", pair).status, 401) << "a cookie begets no cookie";
  EXPECT_EQ(service.get("/metrics", pair).status, 200);
  EXPECT_EQ(service.get("/metrics", "Authorization: Bearer r\r\n").status, 403) << "they are for operators";
  EXPECT_EQ(service.get("/v1/info", "Authorization: Bearer r\r\n").status, 200);
  const RawAnswer closed = service.ask("DELETE", "/v1/session", pair);
  EXPECT_EQ(closed.status, 204);
  EXPECT_NE(closed.header("set-cookie").find("Max-Age=0"), std::string::npos);
  EXPECT_EQ(service.get("/v1/info", pair).status, 401);
}

TEST_F(SystemRoutes, WantNoSessionWithoutAToken) {
  const RawAnswer answer = open.ask("POST", "/v1/session");
  EXPECT_EQ(answer.status, 204);
  EXPECT_EQ(answer.header("set-cookie"), "");
}

TEST_F(SystemRoutes, SendThePageCompressedToWhoTakesThat) {
  const RawAnswer plain = open.get("/main.js");
  const RawAnswer packed = open.get("/main.js", "Accept-Encoding: deflate, gzip;q=0.8\r\n");
  EXPECT_EQ(plain.body, "start()");
  EXPECT_EQ(plain.header("content-encoding"), "");
  EXPECT_EQ(packed.body, "as gzip");
  EXPECT_EQ(packed.header("content-encoding"), "gzip");
  EXPECT_EQ(packed.header("content-type"), plain.header("content-type"));
  for (const RawAnswer& answer : {plain, packed}) EXPECT_EQ(answer.header("vary"), "Accept-Encoding");
  EXPECT_NE(packed.header("etag"), plain.header("etag")) << "a cache must not take one for the other";
  const std::string known = "If-None-Match: " + packed.header("etag") + "\r\n";
  EXPECT_EQ(open.get("/main.js", "Accept-Encoding: gzip\r\n" + known).status, 304);
  EXPECT_EQ(open.get("/main.js", known).status, 200);
  for (const char* refusal : {"gzip;q=0", "identity", "br", ""})
    EXPECT_EQ(open.get("/main.js", std::string("Accept-Encoding: ") + refusal + "\r\n").body, "start()") << refusal;
  EXPECT_EQ(open.get("/icons/a.svg", "Accept-Encoding: gzip\r\n").body, "<svg/>") << "where it is not at hand";
}

TEST(EmbeddedFiles, HoldThePageAndTheContract) {
  const auto page = page_files();
  const auto index =
      std::find_if(page.begin(), page.end(), [](const EmbeddedFile& f) { return f.name == "index.html"; });
  ASSERT_NE(index, page.end());
  EXPECT_NE(index->bytes.find("</html>"), std::string_view::npos);
  std::size_t sent = 0;
  for (const EmbeddedFile& file : page) {
    EXPECT_TRUE(file.gzip.starts_with("\x1f\x8b\x08")) << file.name;
    sent += file.gzip.size();
  }
  EXPECT_LT(sent, 250'000u) << "a page that is there at once on a slow line";
  ASSERT_EQ(contract_files().size(), 1u);
  EXPECT_TRUE(contract_files().front().bytes.starts_with("openapi: ")) << contract_files().front().bytes.substr(0, 20);
}

}  // namespace
}  // namespace server::service::routes
