#include "server/http/http_server.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::http {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;

json problem(const RawAnswer& answer) {
  EXPECT_EQ(answer.header("content-type"), "application/problem+json");
  const json body = json::parse(answer.body, nullptr, false);
  EXPECT_TRUE(body.is_object()) << answer.body;
  EXPECT_EQ(body.value("status", 0), answer.status);
  EXPECT_EQ(body.value("request_id", ""), answer.header("x-request-id"));
  return body;
}

class HttpServerTest : public testing::Test {
 protected:
  RawAnswer get(const std::string& target, const std::string& more = {}) {
    return ask(server.port(), "GET", target, more);
  }

  support::TempDir folder;
  TestServer server{sample_routes(folder.path())};
};

TEST_F(HttpServerTest, PassesPathQueryAndBodyDecoded) {
  EXPECT_EQ(get("/echo/a%20b%2Bc?q=x+y%26z").body, "name=a b+c q=x y&z body=");
  const auto answer =
      ask(server.port(), "POST", "/json", "Content-Type: application/json; charset=utf-8\r\n", "{\"a\":1}");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "name= q=(none) body={\"a\":1}");
}

TEST_F(HttpServerTest, SaysWhichRequestAnAnswerBelongsTo) {
  EXPECT_EQ(get("/json", "X-Request-Id: my-request_1.2\r\n").header("x-request-id"), "my-request_1.2");
  for (const std::string& bad : {std::string("has space"), std::string("<script>"), std::string(65, 'a')}) {
    const std::string made = get("/json", "X-Request-Id: " + bad + "\r\n").header("x-request-id");
    EXPECT_EQ(made.size(), 32u) << bad;
    EXPECT_NE(made, get("/json").header("x-request-id"));
  }
}

TEST_F(HttpServerTest, SendsHeadersThatKeepBrowsersCareful) {
  const auto answer = get("/json");
  EXPECT_EQ(answer.header("x-content-type-options"), "nosniff");
  EXPECT_EQ(answer.header("cache-control"), "private, no-cache");
  EXPECT_EQ(answer.header("content-security-policy"), "default-src 'none'; frame-ancestors 'none'");
}

TEST_F(HttpServerTest, RefusesAForeignHost) {
  for (const std::string& host : std::vector<std::string>{
           "evil.example", "evil.example:" + std::to_string(server.port()),
           "127.0.0.1.evil.example:" + std::to_string(server.port()), std::string("127.0.0.1:1"), std::string()}) {
    const auto answer = get("/json", "Host: " + host + "\r\n");
    EXPECT_EQ(answer.status, 421) << host;
    EXPECT_EQ(problem(answer)["code"], "misdirected_request");
  }
  for (const std::string name : {"localhost", "LocalHost", "127.0.0.1", "[::1]"})
    EXPECT_EQ(get("/json", "Host: " + name + ":" + std::to_string(server.port()) + "\r\n").status, 200) << name;
}

TEST(HttpServer, KnowsTheHostsAndOriginsItIsTold) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()), {},
                    {.tokens = {},
                     .allowed_hosts = {"splat.example", "other.example:99"},
                     .allowed_origins = {"https://front.example"}});
  const auto status = [&](const std::string& more) { return ask(server.port(), "GET", "/json", more).status; };
  EXPECT_EQ(status("Host: splat.example\r\n"), 200);
  EXPECT_EQ(status("Host: SPLAT.example:1234\r\n"), 200);
  EXPECT_EQ(status("Host: other.example:99\r\n"), 200);
  EXPECT_EQ(status("Host: other.example:98\r\n"), 421);
  EXPECT_EQ(status("Origin: https://front.example\r\n"), 200);
  EXPECT_EQ(status("Origin: https://back.example\r\n"), 403);
}

TEST_F(HttpServerTest, RefusesPagesOfOtherSites) {
  const std::string own = "127.0.0.1:" + std::to_string(server.port());
  EXPECT_EQ(get("/json", "Origin: http://" + own + "\r\n").status, 200);
  for (const std::string origin : {"https://evil.example", "null", "http://localhost:1"}) {
    const auto answer = get("/json", "Origin: " + origin + "\r\n");
    EXPECT_EQ(answer.status, 403) << origin;
    EXPECT_EQ(problem(answer)["code"], "forbidden");
  }
  EXPECT_EQ(ask(server.port(), "DELETE", "/thing", "Sec-Fetch-Site: cross-site\r\n").status, 403);
  EXPECT_EQ(ask(server.port(), "DELETE", "/thing", "Sec-Fetch-Site: same-origin\r\n").status, 204);
  EXPECT_EQ(get("/picture", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\n").status, 403);
  EXPECT_EQ(get("/", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\n").status, 200);
}

TEST(HttpServer, WantsItsTokenEverywhereButOnOpenRoutes) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()), {},
                    {.tokens = {only_token("correct horse")}, .allowed_hosts = {}, .allowed_origins = {}});
  const auto ask_with = [&](const std::string& target, const std::string& more) {
    return ask(server.port(), "GET", target, more);
  };
  EXPECT_EQ(ask_with("/open", "").status, 200);
  for (const std::string wrong : {"", "Authorization: Bearer wrong\r\n", "Authorization: Bearer correct hors\r\n",
                                  "Authorization: Bearer correct horse1\r\n", "Authorization: Bearer \r\n",
                                  "Authorization: Basic correct horse\r\n", "Cookie: splatdrag_session=\r\n",
                                  "Cookie: splatdrag_session=0123\r\n"}) {
    const auto answer = ask_with("/json", wrong);
    EXPECT_EQ(answer.status, 401) << wrong;
    EXPECT_EQ(answer.header("www-authenticate"), "Bearer");
    EXPECT_EQ(ask_with("/nowhere", wrong).status, 401) << "tells which routes there are";
  }
  EXPECT_EQ(ask_with("/json", "Authorization: bearer correct horse\r\n").status, 200);
  const std::string secret = server.guard.open_session(only_token("correct horse")).value();
  EXPECT_EQ(ask_with("/json", "Cookie: a=b; splatdrag_session=" + secret + "\r\n").status, 200);
  server.guard.close_session("splatdrag_session=" + secret);
  EXPECT_EQ(ask_with("/json", "Cookie: splatdrag_session=" + secret + "\r\n").status, 401);
}

TEST(HttpServer, AsksEachRouteForItsScope) {
  Router routes;
  const auto well = [](const Call& call) -> Result<Reply> {
    return Reply::json("{\"by\":\"" + (call.token() == nullptr ? "" : call.token()->name) + "\"}");
  };
  routes.add({.method = "GET", .path = "/see", .handler = well, .access = Access::read});
  routes.add({.method = "POST",
              .path = "/change",
              .handler = well,
              .body = Body::json,
              .queries = {"try"},
              .access = Access::edit,
              .reads_with = "try"});
  routes.add({.method = "GET", .path = "/forgotten", .handler = well});
  routes.add({.method = "POST", .path = "/sign-in", .handler = well, .access = Access::token});
  TestServer server(std::move(routes), {},
                    {.tokens = {{.name = "viewer", .read = true, .secret = "r"},
                                {.name = "editor", .edit = true, .secret = "e"},
                                {.name = "scraper", .admin = true, .secret = "a"}},
                     .allowed_hosts = {},
                     .allowed_origins = {}});
  const auto ask_as = [&](const std::string& secret, const std::string& method, const std::string& target) {
    return ask(server.port(), method, target, "Authorization: Bearer " + secret + "\r\n");
  };
  const auto statuses = [&](const std::string& secret) {
    return std::array{ask_as(secret, "GET", "/see").status, ask_as(secret, "POST", "/change").status,
                      ask_as(secret, "POST", "/change?try=true").status, ask_as(secret, "GET", "/forgotten").status};
  };
  EXPECT_EQ(statuses("r"), (std::array{200, 403, 200, 403}));
  EXPECT_EQ(statuses("e"), (std::array{200, 200, 200, 403})) << "who changes sees";
  EXPECT_EQ(statuses("a"), (std::array{403, 403, 403, 200})) << "an operator's token is no key to scenes";
  EXPECT_EQ(ask_as("r", "POST", "/change?try=false").status, 403);
  EXPECT_EQ(ask_as("r", "POST", "/change?try=true&try=false").status, 400);
  EXPECT_EQ(ask_as("r", "HEAD", "/see").status, 200);
  EXPECT_EQ(ask_as("a", "GET", "/nowhere").status, 404) << "whoever has a token may know what there is";
  EXPECT_EQ(ask_as("a", "POST", "/see").status, 405);

  const auto refused = ask_as("r", "POST", "/change");
  EXPECT_EQ(problem(refused)["code"], "forbidden");
  EXPECT_EQ(problem(refused)["detail"], "token \"viewer\" may not edit: it lacks the scope edit");
  EXPECT_EQ(refused.header("www-authenticate"), "Bearer error=\"insufficient_scope\", scope=\"edit\"");
  EXPECT_EQ(problem(ask_as("r", "GET", "/forgotten"))["detail"],
            "token \"viewer\" may not do what is for operators: it lacks the scope admin");
  EXPECT_EQ(ask_as("e", "GET", "/see").body, R"({"by":"editor"})");
  EXPECT_EQ(ask_as("a", "POST", "/sign-in").status, 200) << "of whatever scope";
  EXPECT_EQ(ask(server.port(), "POST", "/sign-in").status, 401);

  const auto session = server.guard.open_session(**server.guard.check_token("Bearer r", "a")).value();
  const std::string cookie = "Cookie: splatdrag_session=" + session + "\r\n";
  EXPECT_EQ(ask(server.port(), "GET", "/see", cookie).body, R"({"by":"viewer"})");
  EXPECT_EQ(ask(server.port(), "POST", "/change", cookie).status, 403) << "a session may do what its token may";
}

TEST_F(HttpServerTest, SaysWhatIsNotThere) {
  EXPECT_EQ(problem(get("/nowhere"))["code"], "not_found");
  EXPECT_EQ(get("/json/").status, 404);
  EXPECT_EQ(get("/echo/").status, 404);
  const auto answer = ask(server.port(), "PUT", "/json");
  EXPECT_EQ(answer.status, 405);
  EXPECT_EQ(answer.header("allow"), "GET, HEAD, POST");
  EXPECT_EQ(ask(server.port(), "BREW", "/json").status, 405);
}

TEST_F(HttpServerTest, RefusesUnknownAndRepeatedQueryParameters) {
  EXPECT_EQ(problem(get("/echo/x?p=1"))["where"], "p");
  EXPECT_EQ(problem(get("/echo/x?q=1&q=2"))["where"], "q");
  EXPECT_EQ(get("/echo/x?q=%zz").status, 400);
  EXPECT_EQ(get("/echo/x?q=%00").status, 400);
  EXPECT_EQ(get("/echo/x?q=%ff").status, 400);
}

TEST_F(HttpServerTest, LetsNoPathClimb) {
  for (const std::string path : {"/../etc/passwd", "/echo/..", "/echo/%2e%2e", "/echo/%2e%2e%2fetc", "/echo/a%2fb",
                                 "/echo/a%5cb", "/echo/%00", "/echo/%", "/echo/%4", "/echo/%c0%ae"})
    EXPECT_EQ(get(path).status, 400) << path;
}

TEST_F(HttpServerTest, WantsJsonWhereJsonBelongs) {
  for (const std::string type :
       {"", "Content-Type: text/plain\r\n", "Content-Type: application/x-www-form-urlencoded\r\n",
        "Content-Type: application/json; charset=latin1\r\n"}) {
    const auto answer = ask(server.port(), "POST", "/json", type, "{}");
    EXPECT_EQ(answer.status, 415) << type;
    EXPECT_EQ(problem(answer)["code"], "unsupported_media_type");
  }
  EXPECT_EQ(
      ask(server.port(), "POST", "/json", "Content-Type: application/json\r\nContent-Encoding: gzip\r\n", "{}").status,
      415);
}

TEST_F(HttpServerTest, TakesNoBodyWhereNoneBelongs) {
  EXPECT_EQ(ask(server.port(), "POST", "/echo/x").status, 200);
  EXPECT_EQ(ask(server.port(), "POST", "/echo/x", "Content-Type: application/json\r\n", " { } ").status, 200);
  EXPECT_EQ(ask(server.port(), "POST", "/echo/x", "", "{\"a\":1}").status, 400);
  EXPECT_EQ(ask(server.port(), "GET", "/json", "", "hello").status, 400);
}

TEST_F(HttpServerTest, TurnsErrorsIntoProblems) {
  const std::pair<int, int> expected[] = {{0, 400}, {1, 422}, {2, 404}, {3, 409}, {4, 422},  {5, 422},
                                          {6, 413}, {7, 507}, {8, 429}, {9, 503}, {10, 503}, {11, 500}};
  for (const auto& [code, status] : expected) {
    const auto answer = get("/fail/" + std::to_string(code));
    EXPECT_EQ(answer.status, status) << code;
    const json body = problem(answer);
    EXPECT_EQ(body["detail"], "it did not work");
    EXPECT_EQ(body["where"], "a.b[1]");
    EXPECT_EQ(answer.header("retry-after"), status == 429 || status == 503 ? "1" : "") << code;
  }
}

TEST_F(HttpServerTest, SurvivesABugInAHandlerAndTellsOnlyItsLog) {
  const auto answer = get("/bug");
  EXPECT_EQ(answer.status, 500);
  EXPECT_EQ(answer.body.find("secret"), std::string::npos);
  EXPECT_EQ(problem(answer)["code"], "internal");
  EXPECT_EQ(get("/json").status, 200);
  server.server->stop();
  EXPECT_NE(server.log.text().find("bug: secret inner state"), std::string::npos);
}

TEST_F(HttpServerTest, AnswersHeadLikeGetWithoutItsBody) {
  std::ofstream(folder.path() / "file.bin") << "0123456789";
  for (const std::string path : {"/json", "/file"}) {
    const auto with = get(path), without = ask(server.port(), "HEAD", path);
    EXPECT_EQ(without.status, 200);
    EXPECT_EQ(without.body, "");
    for (const char* header : {"content-length", "content-type", "etag", "accept-ranges"})
      EXPECT_EQ(without.header(header), with.header(header)) << path << " " << header;
  }
}

TEST_F(HttpServerTest, SavesTheBodyForAClientThatHasIt) {
  const auto first = get("/json");
  const std::string etag = first.header("etag");
  ASSERT_EQ(etag.front(), '"');
  for (const std::string& known : {etag, "W/" + etag, "\"other\", " + etag, std::string("*")}) {
    const auto again = get("/json", "If-None-Match: " + known + "\r\n");
    EXPECT_EQ(again.status, 304) << known;
    EXPECT_EQ(again.header("etag"), etag);
    EXPECT_EQ(again.header("content-length"), "");
  }
  EXPECT_EQ(get("/json", "If-None-Match: \"other\"\r\n").status, 200);
  EXPECT_EQ(get("/picture", "If-None-Match: \"pic1\"\r\n").status, 304);
  EXPECT_EQ(ask(server.port(), "HEAD", "/picture", "If-None-Match: \"pic1\"\r\n").status, 304);
  EXPECT_EQ(ask(server.port(), "POST", "/picture", "If-None-Match: \"pic1\"\r\n").status, 200)
      << "only what is read can be unmodified";
  EXPECT_EQ(get("/file", "If-None-Match: \"v1\"\r\n").status, 304);
}

TEST_F(HttpServerTest, KeepsItsConnectionAfterAnAnswerWithoutBody) {
  RawClient client(server.port());
  const std::string etag = get("/json").header("etag");
  for (int i = 0; i < 3; ++i) {
    client.send(request(server.port(), "GET", "/json", "If-None-Match: " + etag + "\r\n"));
    EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 304);
    client.send(request(server.port(), "DELETE", "/thing"));
    const auto gone = client.answer();
    ASSERT_TRUE(gone);
    EXPECT_EQ(gone->status, 204);
    EXPECT_EQ(gone->header("content-length"), "");
    client.send(request(server.port(), "HEAD", "/json"));
    EXPECT_EQ(client.answer(/*has_body=*/false).value_or(RawAnswer{}).status, 200);
  }
}

TEST_F(HttpServerTest, NegotiatesWhatItSends) {
  EXPECT_EQ(get("/picture").status, 200);
  EXPECT_EQ(get("/picture", "Accept: image/*;q=0.5, text/html\r\n").status, 200);
  EXPECT_EQ(get("/picture", "Accept: text/html\r\n").status, 422);
  EXPECT_EQ(get("/picture", "Accept: image/png;q=0, */*\r\n").status, 422);
}

TEST_F(HttpServerTest, LetsNoHeaderOfAHandlerBeginAnother) {
  const auto answer = get("/picture");
  EXPECT_EQ(answer.header("set-cookie"), "");
  EXPECT_EQ(answer.header("server-timing"), "render;dur=1Set-Cookie: evil=1");
}

TEST_F(HttpServerTest, NeverCompressesSoThatAnETagNamesBytes) {
  const auto answer = get("/json", "Accept-Encoding: gzip, br\r\n");
  EXPECT_EQ(answer.header("content-encoding"), "");
  EXPECT_EQ(answer.body, "{\"answer\":42}");
}

TEST_F(HttpServerTest, SendsPartsOfFiles) {
  std::ofstream(folder.path() / "file.bin") << "0123456789";
  const auto whole = get("/file");
  EXPECT_EQ(whole.body, "0123456789");
  EXPECT_EQ(whole.header("accept-ranges"), "bytes");
  EXPECT_EQ(whole.header("content-disposition"), "attachment; filename=\"file.bin\"");
  const auto part = get("/file", "Range: bytes=2-4\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "234");
  EXPECT_EQ(part.header("content-range"), "bytes 2-4/10");
  EXPECT_EQ(part.header("content-length"), "3");
  EXPECT_EQ(get("/file", "Range: bytes=7-\r\n").body, "789");
  EXPECT_EQ(get("/file", "Range: bytes=-2\r\n").body, "89");
  EXPECT_EQ(get("/file", "Range: bytes=8-99\r\n").body, "89");
  EXPECT_EQ(get("/file", "Range: bytes=0-1,3-4\r\n").status, 200);
  EXPECT_EQ(get("/file", "Range: lines=1-2\r\n").status, 200);
  EXPECT_EQ(get("/file", "Range: bytes=1-2\r\nIf-Range: \"v1\"\r\n").status, 206);
  EXPECT_EQ(get("/file", "Range: bytes=1-2\r\nIf-Range: \"v0\"\r\n").status, 200);
  const auto beyond = get("/file", "Range: bytes=10-\r\n");
  EXPECT_EQ(beyond.status, 416);
  EXPECT_EQ(beyond.header("content-range"), "bytes */10");
}

TEST_F(HttpServerTest, AnswersHeadAsIfNoPartWereAskedFor) {
  std::ofstream(folder.path() / "file.bin") << "0123456789";
  for (const char* range : {"Range: bytes=2-4\r\n", "Range: bytes=99-\r\n"}) {
    const auto answer = ask(server.port(), "HEAD", "/file", range);
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.header("content-length"), "10");
    EXPECT_EQ(answer.header("content-range"), "");
  }
}

TEST_F(HttpServerTest, SendsLargeAndEmptyFilesAndMissesMissingOnes) {
  EXPECT_EQ(get("/file").status, 503);
  std::ofstream(folder.path() / "file.bin").close();
  EXPECT_EQ(get("/file").status, 200);
  EXPECT_EQ(get("/file").header("content-length"), "0");
  std::string large(3'000'000, '\0');
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = char(i * 2654435761u >> 24);
  std::ofstream(folder.path() / "file.bin") << large;
  EXPECT_TRUE(get("/file").body == large);
}

TEST_F(HttpServerTest, AnswersSeveralRequestsSentAtOnceInOrder) {
  RawClient client(server.port());
  std::string all;
  for (const char* name : {"one", "two", "three"}) all += request(server.port(), "GET", std::string("/echo/") + name);
  all += request(server.port(), "POST", "/json", "Content-Type: application/json\r\n", "{\"four\":4}");
  all += request(server.port(), "GET", "/echo/five", "Connection: close\r\n");
  client.send(all);
  for (const std::string expected : {"name=one q=(none) body=", "name=two q=(none) body=", "name=three q=(none) body=",
                                     "name= q=(none) body={\"four\":4}", "name=five q=(none) body="})
    EXPECT_EQ(client.answer().value_or(RawAnswer{}).body, expected);
  EXPECT_TRUE(client.is_closed_within(2s));
}

TEST_F(HttpServerTest, AnswersAClientThatHasFinishedSending) {
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/echo/one") + request(server.port(), "GET", "/echo/two"));
  client.finish_sending();
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).body, "name=one q=(none) body=");
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).body, "name=two q=(none) body=");
}

TEST(HttpServer, TellsAHandlerThatItsClientHasGone) {
  std::atomic<int> waiting = 0, gone = 0;
  Router routes;
  routes.add({.method = "GET",
              .path = "/long",
              .handler = [&](const Call& call) -> Result<Reply> {
                EXPECT_FALSE(call.gone());
                ++waiting;
                for (int i = 0; i < 2000 && !call.gone(); ++i) std::this_thread::sleep_for(1ms);
                if (call.gone()) ++gone;
                return Reply::no_content();
              },
              .queries = {}});
  TestServer server(std::move(routes));
  {
    RawClient client(server.port());
    client.send(request(server.port(), "GET", "/long"));
    while (waiting == 0) std::this_thread::sleep_for(1ms);
  }
  for (int i = 0; i < 2000 && gone == 0; ++i) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(gone, 1);
}

TEST_F(HttpServerTest, SaysHowLongAConnectionIsKept) {
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/json"));
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).header("keep-alive"), "timeout=15");
  client.send(request(server.port(), "GET", "/json", "Connection: close\r\n"));
  const auto last = client.answer().value_or(RawAnswer{});
  EXPECT_EQ(last.header("keep-alive"), "");
  EXPECT_EQ(last.header("connection"), "close");
}

TEST_F(HttpServerTest, KeepsTheConnectionAfterARefusalWhoseBodyIsThere) {
  RawClient client(server.port());
  for (int i = 0; i < 2; ++i) {
    client.send(request(server.port(), "POST", "/nowhere", "", "0123456789"));
    EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 404);
  }
}

TEST(HttpServer, GivesBackWhatABrokenAnswerHeld) {
  bool held = true;
  Router routes;
  routes.add({"GET",
              "/broken",
              [&held](const Call&) -> Result<Reply> {
                Reply reply;
                reply.media_type = "text/event-stream";
                reply.events = [](EventSink&) { throw 42; };
                reply.hold = std::shared_ptr<const void>(nullptr, [&held](const void*) { held = false; });
                return reply;
              },
              Body::none,
              {},
              Access::open});
  TestServer server(std::move(routes));
  ask(server.port(), "GET", "/broken");
  server.server->stop();
  EXPECT_FALSE(held);
  const std::string text = server.metrics.text();
  EXPECT_NE(text.find("splatdrag_http_requests_in_flight 0"), std::string::npos);
  EXPECT_NE(text.find("splatdrag_http_streams_open 0"), std::string::npos);
  EXPECT_NE(server.log.text().find("bug: something was thrown that is no exception"), std::string::npos);
}

TEST_F(HttpServerTest, SpeaksToHttp10) {
  RawClient client(server.port());
  client.send("GET /json HTTP/1.0\r\nHost: 127.0.0.1:" + std::to_string(server.port()) + "\r\n\r\n");
  const auto answer = client.answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->header("connection"), "close");
  EXPECT_TRUE(client.is_closed_within(2s));
}

TEST(HttpServer, SaysThatAPortIsTaken) {
  support::TempDir folder;
  TestServer first(sample_routes(folder.path()));
  ServerOptions options;
  options.port = first.port();
  AccessGuard guard{AccessOptions{}};
  Metrics metrics;
  LogText log;
  const auto second = HttpServer::start(options, Router(), guard, metrics, log.logger());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, engine::ErrorCode::unavailable);
  EXPECT_EQ(second.error().where, "--port");
  EXPECT_NE(second.error().message.find(std::to_string(first.port())), std::string::npos);
}

TEST(HttpServer, SaysThatAHostIsNone) {
  ServerOptions options;
  options.host = "no such host";
  AccessGuard guard{AccessOptions{}};
  Metrics metrics;
  LogText log;
  const auto started = HttpServer::start(options, Router(), guard, metrics, log.logger());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().where, "--host");
}

TEST(HttpServer, FinishesWhatIsUnderWayWhenItStops) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient idle(server.port()), busy(server.port());
  busy.send(request(server.port(), "GET", "/slow"));
  std::this_thread::sleep_for(100ms);
  const auto began = std::chrono::steady_clock::now();
  server.server->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - began, 3s);
  const auto answer = busy.answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->header("connection"), "close");
  EXPECT_TRUE(idle.is_closed_within(1s));
}

TEST(HttpServer, LogsEachRequestWithoutSecretsOrQueries) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()), {},
                    {.tokens = {only_token("hush")}, .allowed_hosts = {}, .allowed_origins = {}});
  ask(server.port(), "GET", "/echo/private-name?q=private-query",
      "Authorization: Bearer hush\r\nCookie: splatdrag_session=hush2\r\nX-Request-Id: r1\r\n");
  server.server->stop();
  const std::string text = server.log.text();
  const json line = json::parse(text.substr(0, text.find('\n')));
  EXPECT_EQ(line["level"], "info");
  EXPECT_EQ(line["message"], "request");
  EXPECT_EQ(line["request_id"], "r1");
  EXPECT_EQ(line["method"], "GET");
  EXPECT_EQ(line["route"], "/echo/{name}");
  EXPECT_EQ(line["status"], 200);
  EXPECT_EQ(line["client"], "127.0.0.1");
  EXPECT_GT(line["bytes"], 100);
  EXPECT_GE(line["ms"], 0.0);
  EXPECT_EQ(line["time"].get<std::string>().size(), 24u);
  for (const char* secret : {"hush", "private"}) EXPECT_EQ(text.find(secret), std::string::npos) << text;
}

TEST(HttpServer, CountsRequestsByRouteAndNeverByPath) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  for (const char* path : {"/echo/a", "/echo/b", "/nowhere/1", "/nowhere/2"}) ask(server.port(), "GET", path);
  ask(server.port(), "BREW", "/coffee");
  server.server->stop();
  const std::string text = server.metrics.text();
  EXPECT_NE(text.find("splatdrag_http_requests_total{method=\"GET\",route=\"/echo/{name}\",status=\"200\"} 2"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("splatdrag_http_requests_total{method=\"GET\",route=\"-\",status=\"404\"} 2"), std::string::npos);
  EXPECT_NE(text.find("method=\"other\""), std::string::npos);
  EXPECT_NE(text.find("splatdrag_http_request_seconds_count{route=\"/echo/{name}\"} 2"), std::string::npos);
  EXPECT_NE(text.find("splatdrag_http_requests_in_flight 0"), std::string::npos);
  for (const char* path : {"nowhere", "coffee", "BREW"}) EXPECT_EQ(text.find(path), std::string::npos);
}

}  // namespace
}  // namespace server::http
