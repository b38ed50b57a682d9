// Clients that mean no good, or have a very bad line.
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <thread>
#include <vector>

#include "server/http/http_server.h"
#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::http {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// An answer within this time has waited for no limit, and not for the client to take it either (a second).
constexpr auto at_once = 900ms;

/// What is wrong with a request shows without waiting: the server is as patient as in service.
class Hostile : public testing::Test {
 protected:
  RawAnswer send(const std::string& bytes) {
    RawClient client(server.port());
    client.send(bytes);
    return client.answer().value_or(RawAnswer{});
  }
  std::string host() const { return "Host: 127.0.0.1:" + std::to_string(server.port()) + "\r\n"; }

  support::TempDir folder;
  TestServer server{sample_routes(folder.path())};
};

/// Clients that a limit on time must end.
class Dawdler : public testing::Test {
 protected:
  support::TempDir folder;
  TestServer server{sample_routes(folder.path()), impatient()};
};

TEST_F(Hostile, GarbageIsRefusedAtOnce) {
  for (const std::string& bytes :
       {std::string("\x16\x03\x01\x02\x00\x01\x00", 7), std::string("hello\r\n\r\n"), std::string("\0\0\0\0", 4),
        std::string("GET\r\n\r\n"), std::string("GET /\r\n\r\n"), std::string("GET / FTP/1.1\r\n\r\n"),
        std::string("GET / HTTP/1.1\nHost: x\n\n\r\n\r\n"), "G\xc3\xa9T / HTTP/1.1\r\n" + host() + "\r\n",
        "GET /\x80 HTTP/1.1\r\n" + host() + "\r\n", "GET ftp://evil/ HTTP/1.1\r\n" + host() + "\r\n",
        "GET evil HTTP/1.1\r\n" + host() + "\r\n", "OPTIONS * HTTP/1.1\r\n" + host() + "\r\n"}) {
    const auto began = Clock::now();
    EXPECT_EQ(send(bytes).status, 400) << bytes;
    EXPECT_LT(Clock::now() - began, at_once) << bytes;
  }
  EXPECT_EQ(send("GET / HTTP/2.0\r\n" + host() + "\r\n").status, 505);
  EXPECT_EQ(send("GET / HTTP/1.1\r\n\r\n").status, 400) << "no Host";
}

TEST_F(Hostile, ATargetThatNamesAHostIsHeldToIt) {
  const std::string own = "127.0.0.1:" + std::to_string(server.port());
  EXPECT_EQ(send("GET http://" + own + "/json HTTP/1.1\r\n" + host() + "\r\n").status, 200);
  EXPECT_EQ(send("GET HTTP://" + own + "/json HTTP/1.1\r\nHost: other.example\r\n\r\n").status, 200)
      << "the target's host counts, not the header's";
  EXPECT_EQ(send("GET http://evil.example/json HTTP/1.1\r\n" + host() + "\r\n").status, 421);
  EXPECT_EQ(send("GET http://evil.example/json HTTP/1.0\r\n\r\n").status, 421) << "it does name one";
  EXPECT_EQ(send("GET http://" + own + "/json HTTP/1.1\r\n\r\n").status, 400) << "HTTP/1.1 has a Host header still";
}

TEST_F(Hostile, OnlyHttp10MayNameNoHost) {
  EXPECT_EQ(send("GET /json HTTP/1.0\r\n\r\n").status, 200) << "a health check of a proxy";
  EXPECT_EQ(send("GET /json HTTP/1.0\r\nHost: evil.example\r\n\r\n").status, 421);
  EXPECT_EQ(send("GET /json HTTP/1.0\r\nHost:\r\n\r\n").status, 421);
  EXPECT_EQ(send("GET /json HTTP/1.1\r\nHost:\r\n\r\n").status, 421);
  for (const char* origin : {"http://evil.example", "http://", "https://"})
    EXPECT_EQ(send(std::string("GET /json HTTP/1.0\r\nOrigin: ") + origin + "\r\n\r\n").status, 403) << origin;
}

TEST_F(Hostile, HeadersThatCouldBeReadTwoWaysAreRefused) {
  const auto status = [&](const std::string& headers) {
    return send("POST /echo/x HTTP/1.1\r\n" + host() + headers + "\r\n").status;
  };
  EXPECT_EQ(status("Content-Length: 5\r\nContent-Length: 6\r\n"), 400);
  EXPECT_EQ(status("Content-Length: 5\r\nTransfer-Encoding: chunked\r\n"), 400);
  EXPECT_EQ(status("Content-Length: 5, 5\r\n"), 400);
  EXPECT_EQ(status("Content-Length: +5\r\n"), 400);
  EXPECT_EQ(status("Content-Length: -5\r\n"), 400);
  EXPECT_EQ(status("Content-Length: 99999999999999999999999\r\n"), 400);
  EXPECT_EQ(status("Content-Length:\r\n"), 400);
  EXPECT_EQ(status("Transfer-Encoding: gzip, chunked\r\n"), 501);
  EXPECT_EQ(status("Content-Length : 5\r\n"), 400);
  EXPECT_EQ(status("A: b\r\n c: d\r\n"), 400);
  EXPECT_EQ(status("A: b\rC: d\r\n"), 400);
  EXPECT_EQ(status(std::string("A: b\0c\r\n", 8)), 400);
  EXPECT_EQ(status("no colon\r\n"), 400);
  EXPECT_EQ(status("Host: again\r\n"), 400);
}

TEST_F(Hostile, AHeadMayNotBeEndless) {
  EXPECT_EQ(send("GET /json HTTP/1.1\r\n" + host() + "A: " + std::string(40'000, 'a')).status, 431);
  std::string many;
  for (int i = 0; i < 200; ++i) many += "A: b\r\n";
  EXPECT_EQ(send("GET /json HTTP/1.1\r\n" + host() + many + "\r\n").status, 431);
  EXPECT_EQ(send("GET /" + std::string(9'000, 'a') + " HTTP/1.1\r\n" + host() + "\r\n").status, 414);
  EXPECT_EQ(send("GET /" + std::string(8'000, 'a') + " HTTP/1.1\r\n" + host() + "\r\n").status, 404);
  EXPECT_EQ(send("GET /json HTTP/1.1\r\n" + host() + "Range: bytes=" + std::string(20'000, '0') + "\r\n\r\n").status,
            200);
}

TEST_F(Dawdler, AHeadThatDripsIsCutOff) {
  RawClient client(server.port());
  const auto began = Clock::now();
  client.send("GET /json HTTP/1.1\r\n");
  std::atomic<bool> done = false;
  std::thread drip([&] {
    while (!done && client.send("A")) std::this_thread::sleep_for(30ms);
  });
  const auto answer = client.answer();
  const auto took = Clock::now() - began;
  done = true;
  drip.join();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 408);
  EXPECT_GT(took, 300ms);
  EXPECT_LT(took, 2s);
}

TEST_F(Hostile, EmptyLinesBuyNoTime) {
  EXPECT_EQ(send("\r\n\r\n" + request(server.port(), "GET", "/json")).status, 200) << "two are forgiven";
  EXPECT_EQ(send("\r\n\r\n\r\n" + request(server.port(), "GET", "/json")).status, 400);
  RawClient client(server.port());
  const auto began = Clock::now();
  std::string lines;
  for (int i = 0; i < 10'000; ++i) lines += "\r\n";
  while (client.send(lines) && Clock::now() - began < 4s) continue;
  EXPECT_LT(Clock::now() - began, 3s) << "a refusal waits a second for the client to take it, no longer";
}

TEST_F(Dawdler, AHeadThatAlwaysHasAByteMoreIsCutOffToo) {
  ServerOptions options = impatient();
  options.lobby.connection.max_head_bytes = std::size_t{1} << 30;
  TestServer roomy(sample_routes(folder.path()), options);
  RawClient client(roomy.port());
  const auto began = Clock::now();
  client.send("GET /json HTTP/1.1\r\nA: ");
  const std::string piece(1000, 'a');
  while (client.send(piece) && Clock::now() - began < 3s) continue;
  EXPECT_LT(Clock::now() - began, 2s);
}

TEST_F(Hostile, ARefusalDoesNotWaitForTheBody) {
  const auto refused = [](int port, const std::string& target, const std::string& more) {
    RawClient client(port);
    const auto began = Clock::now();
    client.send(request(port, "POST", target, more + "Content-Length: 10\r\n"));
    const auto answer = client.answer().value_or(RawAnswer{});
    EXPECT_LT(Clock::now() - began, at_once) << target << " " << more;
    EXPECT_EQ(answer.header("connection"), "close");
    return answer.status;
  };
  EXPECT_EQ(refused(server.port(), "/nowhere", ""), 404);
  EXPECT_EQ(refused(server.port(), "/json", ""), 415);
  EXPECT_EQ(refused(server.port(), "/json", "Host: evil.example\r\n"), 421);
  EXPECT_EQ(refused(server.port(), "/json", "Origin: https://evil.example\r\n"), 403);
  TestServer closed(sample_routes(folder.path()), {},
                    {.tokens = {only_token("hush")}, .allowed_hosts = {}, .allowed_origins = {}});
  EXPECT_EQ(refused(closed.port(), "/json", ""), 401);
}

TEST_F(Hostile, ChunksHoldNoControlCharacters) {
  const auto status = [&](const std::string& body) {
    return send(request(server.port(), "POST", "/json",
                        "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n") +
                body)
        .status;
  };
  EXPECT_EQ(status("2;name=\"a\tb\"\r\n{}\r\n0\r\nName: value\r\n\r\n"), 200);
  EXPECT_EQ(status("2\n{}\r\n0\r\n\r\n"), 400);
  EXPECT_EQ(status("2;a\nb\r\n{}\r\n0\r\n\r\n"), 400);
  EXPECT_EQ(status("2;a\rb\r\n{}\r\n0\r\n\r\n"), 400);
  EXPECT_EQ(status("2;a" + std::string(1, '\0') + "\r\n{}\r\n0\r\n\r\n"), 400);
  EXPECT_EQ(status("2\r\n{}\r\n0\r\nName: a\nOther: b\r\n\r\n"), 400);
  EXPECT_EQ(status("2\r\n{}\r\n0\r\nName: a\x7f\r\n\r\n"), 400);
}

TEST_F(Dawdler, ABodyThatDripsIsCutOff) {
  RawClient client(server.port());
  const auto began = Clock::now();
  client.send(request(server.port(), "POST", "/upload", "Content-Length: 100000\r\n"));
  std::atomic<bool> done = false;
  std::thread drip([&] {
    while (!done && client.send("A")) std::this_thread::sleep_for(30ms);
  });
  const auto answer = client.answer();
  const auto took = Clock::now() - began;
  done = true;
  drip.join();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 408);
  EXPECT_GT(took, 500ms) << "a slow line deserves a little patience";
  EXPECT_LT(took, 3s);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "upload.bin"));
}

TEST_F(Dawdler, ABodyThatNeverComesIsNotWaitedFor) {
  RawClient client(server.port());
  client.send(request(server.port(), "POST", "/json", "Content-Type: application/json\r\nContent-Length: 10\r\n"));
  EXPECT_EQ(client.answer().value_or(RawAnswer{}).status, 408);
}

TEST_F(Dawdler, ASilentConnectionIsClosedWithoutAWord) {
  RawClient fresh(server.port()), used(server.port());
  used.send(request(server.port(), "GET", "/json"));
  EXPECT_EQ(used.answer().value_or(RawAnswer{}).status, 200);
  EXPECT_TRUE(fresh.is_closed_within(2s));
  EXPECT_TRUE(used.is_closed_within(2s));
}

TEST_F(Dawdler, AClientThatTakesNoAnswerIsCutOff) {
  std::ofstream(folder.path() / "file.bin") << std::string(50'000'000, 'x');
  RawClient client(server.port());
  client.send(request(server.port(), "GET", "/file"));
  const auto began = Clock::now();
  while (server.metrics.text().find("route=\"/file\"") == std::string::npos && Clock::now() - began < 5s)
    std::this_thread::sleep_for(20ms);
  EXPECT_LT(Clock::now() - began, 3s);
}

TEST_F(Hostile, AClientThatLeavesDoesNoHarm) {
  std::ofstream(folder.path() / "file.bin") << std::string(5'000'000, 'x');
  for (int i = 0; i < 20; ++i) {
    RawClient client(server.port());
    client.send(request(server.port(), "GET", i % 2 == 0 ? "/file" : "/events"));
  }
  EXPECT_EQ(send(request(server.port(), "GET", "/json")).status, 200);
}

TEST(HostileCrowd, ManyClientsAtOnceAreAllAnswered) {
  support::TempDir folder;
  ServerOptions options;
  options.workers.threads = 8;
  TestServer server(sample_routes(folder.path()), options);
  std::atomic<int> answered = 0;
  std::vector<std::thread> clients;
  for (int i = 0; i < 32; ++i)
    clients.emplace_back([&, i] {
      for (int k = 0; k < 10; ++k)
        if (ask(server.port(), "GET", "/echo/" + std::to_string(i)).body ==
            "name=" + std::to_string(i) + " q=(none) body=")
          ++answered;
    });
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(answered, 320);
}

TEST(HostileCrowd, StoppingDoesNotWaitForThoseWhoDrip) {
  support::TempDir folder;
  ServerOptions options;
  options.grace = 300ms;
  TestServer server(sample_routes(folder.path()), options);
  RawClient head(server.port()), body(server.port());
  head.send("GET /js");
  body.send(request(server.port(), "POST", "/upload", "Content-Length: 1000\r\n"));
  std::this_thread::sleep_for(100ms);
  const auto began = Clock::now();
  server.server->stop();
  EXPECT_LT(Clock::now() - began, 2s);
}

}  // namespace
}  // namespace server::http
