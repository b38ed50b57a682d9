#include <gtest/gtest.h>

#include <thread>

#include "server/http/http_server.h"
#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::http {
namespace {

using namespace std::chrono_literals;

TEST(Events, ArriveAsTheyHappen) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/events"));
  const std::string text = client.read_until("\"n\":3}");
  EXPECT_NE(text.find("Content-Type: text/event-stream"), std::string::npos) << text;
  EXPECT_NE(text.find("event: tick\nid: 1\ndata: {\"n\":1}\n\n"), std::string::npos) << text;
}

TEST(Events, ReachAClientThatHasFinishedSending) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/events"));
  client.finish_sending();
  EXPECT_NE(client.read_until("\"n\":3}").find("\"n\":3}"), std::string::npos);
}

TEST(Events, EndTheirAnswerWhenTheyAreOver) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/two-events"));
  const auto answer = client.answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->body,
            "event: edit\nid: 1\ndata: first\ndata: second\n\n: still here\n\nevent: edit\nid: 2\ndata: last\n\n");
  client.send(request(server.port(), "GET", "/json"));
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 200) << "the connection can be used again";
}

TEST(Events, ReachHttp10AndAnswerHead) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient old(server.port());
  old.send("GET /two-events HTTP/1.0\r\nHost: localhost:" + std::to_string(server.port()) + "\r\n\r\n");
  const auto answer = old.answer();
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->body.starts_with("event: edit\nid: 1\n")) << answer->body;
  EXPECT_EQ(ask(server.port(), "HEAD", "/events").status, 200);
}

TEST(Events, EndWithTheTokenOfWhoeverListens) {
  support::TempDir folder;
  const Token keeps{.name = "keeps", .read = true, .secret = "1"}, loses{.name = "loses", .read = true, .secret = "2"};
  TestServer server(sample_routes(folder.path()), {},
                    {.tokens = {keeps, loses}, .allowed_hosts = {}, .allowed_origins = {}});
  RawClient kept(server.port()), lost(server.port());
  kept.send(request(server.port(), "GET", "/events", "Authorization: Bearer 1\r\n"));
  lost.send(request(server.port(), "GET", "/events", "Authorization: Bearer 2\r\n"));
  EXPECT_NE(lost.read_until("\"n\":3}").find("\"n\":3}"), std::string::npos);
  server.guard.replace_tokens({keeps});
  EXPECT_TRUE(lost.read_until("0\r\n\r\n").ends_with("0\r\n\r\n")) << "the answer is whole, and over";
  kept.read_until("\"n\":3}");
  EXPECT_NE(kept.read_until("\"n\":").find("\"n\":"), std::string::npos);
}

TEST(Events, AreCappedInNumber) {
  support::TempDir folder;
  ServerOptions options;
  options.dispatcher.max_streams = 2;
  TestServer server(sample_routes(folder.path()), options);
  {
    RawClient first(server.port()), second(server.port());
    for (RawClient* client : {&first, &second}) {
      client->send(request(server.port(), "GET", "/events"));
      client->read_until("data:");
    }
    EXPECT_NE(server.metrics.text().find("splatdrag_http_streams_open 2"), std::string::npos);
    const auto refused = ask(server.port(), "GET", "/events");
    EXPECT_EQ(refused.status, 429);
    EXPECT_NE(refused.body.find("--max-streams"), std::string::npos);
  }
  // Both have gone; their places are free again once the server has noticed.
  for (int i = 0; i < 100 && server.metrics.text().find("streams_open 0") == std::string::npos; ++i)
    std::this_thread::sleep_for(20ms);
  EXPECT_EQ(ask(server.port(), "HEAD", "/events").status, 200);
}

TEST(Events, EndWhenTheServerStops) {
  support::TempDir folder;
  TestServer server(sample_routes(folder.path()));
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/events"));
  client.read_until("data:");
  const auto began = std::chrono::steady_clock::now();
  server.server->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - began, 2s);
}

}  // namespace
}  // namespace server::http
