// Many clients at a time, most of them slow: what they make the server wait for costs others nothing.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <fstream>
#include <mutex>
#include <thread>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "server/http/http_server.h"
#include "server/http/network.h"
#include "server/http/places.h"
#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::http {
namespace {

using namespace std::chrono_literals;
using Clients = std::vector<std::unique_ptr<RawClient>>;

/// Longer than anything here takes, so that a test that hangs fails.
constexpr auto patience = 20s;

/// Handlers wait here until it is opened, for so many of them.
class Gate {
 public:
  ~Gate() { open(1'000'000); }
  void pass(const std::string& name) {
    std::unique_lock lock(mutex_);
    names_.push_back(name);
    changed_.notify_all();
    changed_.wait_for(lock, patience, [this] { return let_through_ > 0; });
    --let_through_;
  }
  void open(int times) {
    const std::lock_guard lock(mutex_);
    let_through_ += times;
    changed_.notify_all();
  }
  /// Whether so many have come, since the beginning.
  bool has_seen(int number) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, patience, [&] { return int(names_.size()) >= number; });
  }
  [[nodiscard]] std::string name(std::size_t number) {
    const std::lock_guard lock(mutex_);
    return names_.at(number);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> names_;
  int let_through_ = 0;
};

/// Bytes of an answer that no socket holds.
constexpr std::size_t large_bytes = 20'000'000;

/// The sample routes, /healthz, /large, /gate, which waits there, and /swallow, which reads an upload and says how long
/// it was.
Router routes_with(Gate& gate, const std::filesystem::path& folder) {
  Router routes = sample_routes(folder);
  const auto well = [](const Call&) -> Result<Reply> { return Reply::json("{}"); };
  routes.add({"GET", "/healthz", well, Body::none, {}, Access::open, /*vital=*/true});
  const auto wait = [&gate](const Call& call) -> Result<Reply> {
    gate.pass(call.header("X-Name"));
    return Reply::json("{}");
  };
  const auto large = [](const Call&) -> Result<Reply> { return Reply::json(std::string(large_bytes, '1')); };
  routes.add({"GET", "/large", large, Body::none, {}, Access::open});
  routes.add({"GET", "/gate", wait, Body::none, {}, Access::open});
  const auto swallow = [folder, number = std::make_shared<std::atomic<int>>(0)](const Call& call) -> Result<Reply> {
    const auto file = folder / ("upload" + std::to_string(++*number));
    const auto received = call.receive(file);
    if (!received) return engine::propagate(received);
    return Reply::json(std::to_string(received->bytes), 201);
  };
  routes.add({"POST", "/swallow", swallow, Body::upload, {}, Access::open});
  return routes;
}

/// While it lives, this process may open only so many files more.
class NoMoreFiles {
 public:
  explicit NoMoreFiles(std::size_t left) {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    rlimit low = before_;
    low.rlim_cur = std::min<rlim_t>(before_.rlim_cur, 512);
    ::setrlimit(RLIMIT_NOFILE, &low);
    for (int fd = ::dup(0); fd >= 0; fd = ::dup(0)) taken_.emplace_back(fd);
    taken_.resize(taken_.size() - left);
  }
  ~NoMoreFiles() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoMoreFiles(const NoMoreFiles&) = delete;
  NoMoreFiles& operator=(const NoMoreFiles&) = delete;

 private:
  rlimit before_{};
  std::vector<engine::FileDescriptor> taken_;
};

class Crowd : public testing::Test {
 protected:
  void start(const ServerOptions& options = {}, const AccessOptions& access = {}) {
    server = std::make_unique<TestServer>(routes_with(gate, folder.path()), options, access);
  }
  [[nodiscard]] int port() const { return server->port(); }
  [[nodiscard]] int status(const std::string& target, const std::string& more = {}) const {
    return ask(port(), "GET", target, more).status;
  }
  Clients clients(std::size_t number, const std::string& bytes, const std::string& from = "127.0.0.1") {
    Clients all;
    for (std::size_t i = 0; i < number; ++i) {
      all.push_back(std::make_unique<RawClient>(port(), from));
      if (!bytes.empty()) all.back()->send(bytes);
    }
    return all;
  }
  [[nodiscard]] std::string gate_request(const std::string& more = {}) const {
    return request(port(), "GET", "/gate", more);
  }
  /// Waits until the metrics say so.
  [[nodiscard]] bool says(const std::string& line) const {
    for (int i = 0; i < 1000; ++i, std::this_thread::sleep_for(20ms))
      if (server->metrics.text().find("\n" + line + "\n") != std::string::npos) return true;
    return false;
  }

  support::TempDir folder;
  Gate gate;
  std::unique_ptr<TestServer> server;
};

/// Sends a byte of `bytes` to each client in turn, again and again, while it lives.
class Drip {
 public:
  explicit Drip(const Clients& clients, char byte = 'A')
      : thread_([this, &clients, byte](const std::stop_token& stop) {
          for (; !stop.stop_requested(); std::this_thread::sleep_for(5ms), ++rounds_)
            for (const auto& client : clients) client->send({&byte, 1});
        }) {}
  [[nodiscard]] int rounds() const { return rounds_; }

 private:
  std::atomic<int> rounds_ = 0;
  std::jthread thread_;
};

TEST_F(Crowd, AnswersOthersWhileTwoHundredHeadsDrip) {
  ServerOptions options;
  options.workers.threads = 2;
  options.workers.max_per_client = 256;  // in the end they all ask at once
  start(options);
  const Clients slow = clients(200, "GET /json HTTP/1.1\r\nX: ");
  {
    const Drip drip(slow);
    for (int i = 0; i < 50; ++i) EXPECT_EQ(status("/json"), 200);
    while (drip.rounds() < 3) std::this_thread::sleep_for(1ms);
    EXPECT_EQ(status("/json"), 200);
  }
  for (const auto& client : slow) {
    EXPECT_FALSE(client->is_closed_within(0ms));
    client->send("\r\nHost: 127.0.0.1:" + std::to_string(port()) + "\r\n\r\n");
  }
  for (const auto& client : slow)
    EXPECT_EQ(client->answer().value_or(RawAnswer{}).status, 200) << "they come to an end";
}

TEST_F(Crowd, PollersThatKeepTheirConnectionsLeaveRoomForAnother) {
  ServerOptions options;
  options.workers.threads = 2;
  start(options);
  const std::string poll = request(port(), "GET", "/json");
  const Clients pollers = clients(64, poll);
  for (const auto& poller : pollers) EXPECT_EQ(poller->answer().value_or(RawAnswer{}).status, 200);
  RawClient another(port());
  another.send(poll);
  EXPECT_EQ(another.answer().value_or(RawAnswer{}).status, 200);
  for (const auto& poller : pollers) {
    poller->send(poll);
    EXPECT_EQ(poller->answer().value_or(RawAnswer{}).status, 200) << "on the same connection";
  }
}

TEST_F(Crowd, SmallBodiesThatDripHoldNoThread) {
  ServerOptions options;
  options.workers.threads = 1;
  start(options);
  const std::size_t length = 5000;
  const std::string head = request(
      port(), "POST", "/json", "Content-Type: application/json\r\nContent-Length: " + std::to_string(length) + "\r\n");
  const Clients slow = clients(20, head);
  std::size_t sent = 0;
  {
    const Drip drip(slow);
    while (drip.rounds() < 3) std::this_thread::sleep_for(1ms);
    for (int i = 0; i < 20; ++i) EXPECT_EQ(status("/json"), 200);
    sent = std::size_t(drip.rounds());
  }
  ASSERT_LT(sent + 1, length) << "they were not done by then";
  for (const auto& client : slow) client->send(std::string(length, 'A'));  // and a bit more, which is no request
  for (const auto& client : slow) {
    const auto answer = client->answer().value_or(RawAnswer{});
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.body, "name= q=(none) body=" + std::string(length, 'A'));
  }
}

TEST_F(Crowd, UploadsThatDripLeaveThreadsToOthers) {
  ServerOptions options;
  options.workers.threads = 3;
  options.workers.max_uploads = 8;  // one thread is left to others however many that are
  start(options);
  const std::size_t length = 1'000'000;
  const std::string head = request(port(), "POST", "/swallow", "Content-Length: " + std::to_string(length) + "\r\n");
  const Clients slow = clients(6, head);
  {
    const Drip drip(slow);
    while (drip.rounds() < 3) std::this_thread::sleep_for(1ms);
    for (int i = 0; i < 20; ++i) EXPECT_EQ(status("/json"), 200);
  }
  std::vector<std::jthread> senders;  // those that wait for their turn cannot send yet
  for (const auto& client : slow)
    senders.emplace_back([&client] {
      client->send(std::string(length, 'A'));
      EXPECT_EQ(client->answer().value_or(RawAnswer{}).body, std::to_string(length));
    });
}

TEST_F(Crowd, OneClientsUploadsLeavePlacesToAnothers) {
  ServerOptions options;
  options.workers.threads = 8;
  options.workers.max_uploads = 4;
  AccessOptions access;
  access.trust_proxy = true;
  start(options, access);
  const std::string length = "Content-Length: 200000\r\n";
  const Clients slow = clients(12, request(port(), "POST", "/swallow", length + "X-Forwarded-For: 10.0.0.1\r\n"));
  const Drip drip(slow);
  while (drip.rounds() < 3) std::this_thread::sleep_for(1ms);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(ask(port(), "POST", "/swallow", "X-Forwarded-For: 10.0.0.2\r\n", std::string(200'000, 'B')).status, 201);
}

TEST_F(Crowd, UploadsBeyondThoseThatMayWaitAreTurnedAway) {
  ServerOptions options;
  options.workers.threads = 2;
  options.workers.max_waiting = 1;
  start(options);
  const Clients slow = clients(2, request(port(), "POST", "/swallow", "Content-Length: 1000000\r\n"));
  ASSERT_TRUE(says("splatdrag_http_requests_in_flight 1"));
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 1"));
  RawClient one_too_many(port());
  one_too_many.send(request(port(), "POST", "/swallow", "Content-Length: 1000000\r\n"));
  const auto refused = one_too_many.answer().value_or(RawAnswer{});
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.header("retry-after"), "1");
  EXPECT_EQ(status("/json"), 200);
}

TEST_F(Crowd, ReadersThatTakeNothingHoldNoThread) {
  std::string large(20'000'000, '\0');
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = char(i * 2654435761u >> 24);
  std::ofstream(folder.path() / "file.bin") << large;
  ServerOptions options;
  options.workers.threads = 1;
  start(options);
  const Clients slow = clients(20, request(port(), "GET", "/file"));
  for (int i = 0; i < 20; ++i) EXPECT_EQ(status("/json"), 200);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(slow[i]->answer().value_or(RawAnswer{}).body == large) << i;
}

TEST_F(Crowd, AnswersThatNobodyTakesAreBoundedInMemory) {
  ServerOptions options;
  options.workers.threads = 1;  // so that the first waits for its reader before the second does
  options.lobby.max_unsent_bytes = large_bytes + large_bytes / 2;
  start(options);
  const std::string ask_for_much = request(port(), "GET", "/large");
  RawClient first(port()), second(port());
  first.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_requests_in_flight 1"));
  second.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_connections_cut_total 1"));
  EXPECT_FALSE(first.answer()) << "it broke off";
  EXPECT_EQ(second.answer().value_or(RawAnswer{}).body.size(), large_bytes);
}

TEST_F(Crowd, AnswersThatWaitForAThreadToGoOnCountInThatBound) {
  ServerOptions options;
  options.workers.threads = 1;
  options.lobby.max_unsent_bytes = large_bytes + large_bytes / 2;
  start(options);
  const std::string ask_for_much = request(port(), "GET", "/large");
  RawClient first(port()), busy(port()), second(port()), busy_after_it(port());
  first.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_requests_in_flight 1"));
  busy.send(gate_request());
  ASSERT_TRUE(gate.has_seen(1));
  second.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 1"));
  busy_after_it.send(gate_request());
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 2"));
  std::size_t taken = 0;
  std::jthread reader([&] { taken = first.answer().value_or(RawAnswer{}).body.size(); });
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 3")) << "the first can go on, once there is a thread";
  gate.open(1);
  ASSERT_TRUE(gate.has_seen(2));
  ASSERT_TRUE(says("splatdrag_http_connections_cut_total 1")) << "what the second holds is too much beside the first";
  EXPECT_FALSE(second.answer()) << "it broke off";
  gate.open(1);
  reader.join();
  EXPECT_EQ(taken, large_bytes);
}

TEST_F(Crowd, AnAnswerThatIsGivenUpPushesNoOtherOut) {
  ServerOptions options;
  options.workers.threads = 1;
  options.lobby.max_unsent_bytes = large_bytes + large_bytes / 2;
  options.lobby.connection.stall_timeout = 1s;
  start(options);
  const std::string ask_for_much = request(port(), "GET", "/large");
  RawClient busy(port()), dead(port()), busy_after_it(port()), live(port()), busy_to_the_end(port());
  busy.send(gate_request());
  ASSERT_TRUE(gate.has_seen(1));
  dead.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 1"));
  busy_after_it.send(gate_request());
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 2"));
  gate.open(1);
  ASSERT_TRUE(gate.has_seen(2));
  live.send(ask_for_much);
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 1"));
  busy_to_the_end.send(gate_request());
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 3")) << "the dead one's time is over: it is to be ended, too";
  std::size_t taken = 0;
  std::jthread reader([&] { taken = live.answer().value_or(RawAnswer{}).body.size(); });
  gate.open(1);
  ASSERT_TRUE(gate.has_seen(3)) << "by now both have been answered, and one was given up";
  gate.open(1);
  reader.join();
  EXPECT_EQ(taken, large_bytes);
  EXPECT_FALSE(dead.answer()) << "it broke off";
  EXPECT_TRUE(says("splatdrag_http_connections_cut_total 0"));
}

TEST_F(Crowd, StreamsOfEventsHaveThreadsOfTheirOwn) {
  ServerOptions options;
  options.workers.threads = 1;
  options.dispatcher.max_streams = 2;
  start(options);
  const Clients streams = clients(2, request(port(), "GET", "/events"));
  for (const auto& stream : streams) stream->read_until("\"n\":3}");
  EXPECT_EQ(status("/json"), 200);
  EXPECT_EQ(status("/events"), 429);
  for (const auto& stream : streams) EXPECT_NE(stream->read_until("tick").find("tick"), std::string::npos);
}

TEST_F(Crowd, HealthIsAnsweredWhileAllElseWaits) {
  ServerOptions options;
  options.workers.threads = 2;
  options.workers.max_waiting = 1;
  start(options);
  const Clients busy = clients(3, gate_request());
  ASSERT_TRUE(gate.has_seen(2));
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 1"));
  const auto refused = ask(port(), "GET", "/json");
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.header("retry-after"), "1");
  EXPECT_EQ(status("/healthz"), 200);
  EXPECT_EQ(ask(port(), "HEAD", "/healthz").status, 200);
  EXPECT_NE(server->metrics.text().find("splatdrag_http_connections_refused_total "), std::string::npos);
  gate.open(3);
  for (const auto& client : busy) EXPECT_EQ(client->answer().value_or(RawAnswer{}).status, 200);
  EXPECT_EQ(status("/json"), 200) << "and then it serves again";
}

TEST_F(Crowd, HealthIsAnsweredToAClientThatHasAllItMayHave) {
  ServerOptions options;
  options.workers.max_per_client = 2;
  start(options);
  const Clients busy = clients(2, gate_request());
  ASSERT_TRUE(gate.has_seen(2));
  EXPECT_EQ(status("/json"), 503);
  EXPECT_EQ(status("/healthz"), 200) << "a proxy that all come through asks for it, too";
  gate.open(2);
}

TEST_F(Crowd, StreamsOfEventsAreNoWorkOfTheirClient) {
  ServerOptions options;
  options.workers.max_per_client = 2;
  options.dispatcher.max_streams = 2;
  start(options);
  Clients streams = clients(2, request(port(), "GET", "/events"));
  for (const auto& stream : streams) stream->read_until("\"n\":3}");
  const Clients busy = clients(2, gate_request());
  ASSERT_TRUE(gate.has_seen(2));
  EXPECT_EQ(status("/json"), 503) << "two other requests are";
  streams.clear();
  ASSERT_TRUE(says("splatdrag_http_streams_open 0"));
  EXPECT_EQ(status("/json"), 503) << "and the streams' end takes nothing off them";
  gate.open(2);
}

TEST_F(Crowd, ARequestThatIsTurnedAwayIsAnsweredUnderItsOwnName) {
  ServerOptions options;
  options.workers.max_per_client = 1;
  start(options);
  const Clients busy = clients(1, gate_request());
  ASSERT_TRUE(gate.has_seen(1));
  RawClient client(port());
  client.send(request(port(), "HEAD", "/json", "X-Request-Id: mine\r\n"));
  const auto refused = client.answer(/*has_body=*/false).value_or(RawAnswer{});
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.header("x-request-id"), "mine");
  EXPECT_TRUE(client.is_closed_within(patience)) << "HEAD has no body";
  gate.open(1);
  server->server->stop();
  EXPECT_NE(server->log.text().find("\"request_id\":\"mine\",\"method\":\"HEAD\",\"route\":\"-\",\"status\":503"),
            std::string::npos)
      << server->log.text();
}

TEST_F(Crowd, WhoIsTurnedAwayHasTakenNoLongerThanItWasThere) {
  const auto began = std::chrono::steady_clock::now();
  ServerOptions options = impatient();
  options.lobby.max_connections_per_client = 2;
  start(options);
  RawClient slow(port());
  slow.send("GET /js");
  EXPECT_EQ(slow.answer().value_or(RawAnswer{}).status, 408);
  const Clients busy = clients(2, gate_request());
  ASSERT_TRUE(gate.has_seen(2));
  EXPECT_EQ(status("/json"), 429);
  gate.open(2);
  server->server->stop();
  const std::chrono::duration<double, std::milli> there = std::chrono::steady_clock::now() - began;
  for (const char* refused : {"\"status\":408", "\"status\":429"}) {
    const std::string log = server->log.text();
    const std::size_t line = log.find(refused), time = log.find("\"ms\":", line);
    ASSERT_NE(line, std::string::npos) << log;
    ASSERT_NE(time, std::string::npos) << log;
    EXPECT_LE(std::stod(log.substr(time + 5)), there.count()) << log.substr(line, 200);
  }
}

TEST_F(Crowd, WhereNoFileCanBeOpenedOneThatWaitsMakesRoom) {
  start();
  const Clients idle = clients(4, "");
  ASSERT_TRUE(says("splatdrag_http_connections_open 4"));
  {
    const NoMoreFiles full(/*left=*/1);  // for the client itself
    RawClient newest(port());
    newest.send(request(port(), "GET", "/json"));
    EXPECT_EQ(newest.answer().value_or(RawAnswer{}).status, 200);
  }
  EXPECT_TRUE(says("splatdrag_http_connections_cut_total 1"));
  EXPECT_TRUE(idle[0]->is_closed_within(patience));
  idle[3]->send(request(port(), "GET", "/json"));
  EXPECT_EQ(idle[3]->answer().value_or(RawAnswer{}).status, 200) << "another one is still there";
}

TEST_F(Crowd, WhereNoFileCanBeOpenedAndNobodyWaitsItIsTriedAgain) {
  start();
  auto full = std::make_unique<NoMoreFiles>(/*left=*/1);
  RawClient newest(port());
  newest.send(request(port(), "GET", "/json"));
  std::this_thread::sleep_for(100ms);
  full.reset();
  EXPECT_EQ(newest.answer().value_or(RawAnswer{}).status, 200);
}

TEST_F(Crowd, WhoHasNothingInWorkComesBeforeWhoHas) {
  ServerOptions options;
  options.workers.threads = 2;
  AccessOptions access;
  access.trust_proxy = true;
  start(options, access);
  const Clients first = clients(4, gate_request("X-Forwarded-For: 10.0.0.1\r\nX-Name: first\r\n"));
  ASSERT_TRUE(gate.has_seen(2));
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 2"));
  RawClient second(port());
  second.send(gate_request("X-Forwarded-For: 10.0.0.2\r\nX-Name: second\r\n"));
  ASSERT_TRUE(says("splatdrag_http_requests_waiting 3"));
  gate.open(1);  // one of the first client's is done
  ASSERT_TRUE(gate.has_seen(3));
  EXPECT_EQ(gate.name(2), "second");
  gate.open(4);
  EXPECT_EQ(second.answer().value_or(RawAnswer{}).status, 200);
}

TEST_F(Crowd, BehindAProxyTheForwardedAddressIsTheClient) {
  ServerOptions options;
  options.workers.max_per_client = 2;
  options.lobby.max_connections_per_client = 1;  // which does not hold for the proxy's
  AccessOptions access;
  access.trust_proxy = true;
  start(options, access);
  const Clients busy = clients(2, gate_request("X-Forwarded-For: 10.0.0.1\r\n"));
  ASSERT_TRUE(gate.has_seen(2));
  EXPECT_EQ(status("/json", "X-Forwarded-For: 10.0.0.1\r\n"), 503);
  EXPECT_EQ(status("/json", "X-Forwarded-For: 10.0.0.2\r\n"), 200);
  gate.open(2);
}

TEST_F(Crowd, AnAddressWithTooManyConnectionsLosesTheOneThatWaitsLongest) {
  ServerOptions options;
  options.lobby.max_connections_per_client = 3;
  start(options);
  Clients idle = clients(1, "GET /json");
  ASSERT_TRUE(says("splatdrag_http_connections_open 1"));
  for (auto& client : clients(2, "")) idle.push_back(std::move(client));
  RawClient elsewhere(port(), "127.0.0.2");
  ASSERT_TRUE(says("splatdrag_http_connections_open 4"));
  EXPECT_EQ(status("/json"), 200);
  EXPECT_TRUE(idle[0]->is_closed_within(patience));
  EXPECT_TRUE(says("splatdrag_http_connections_cut_total 1"));
  idle[2]->send(request(port(), "GET", "/json"));
  EXPECT_EQ(idle[2]->answer().value_or(RawAnswer{}).status, 200) << "another one is still there";
  elsewhere.send(request(port(), "GET", "/json"));
  EXPECT_EQ(elsewhere.answer().value_or(RawAnswer{}).status, 200) << "and so is another address's";
}

TEST_F(Crowd, AnAddressWhoseConnectionsAreAllBusyGetsNoMore) {
  ServerOptions options;
  options.lobby.max_connections_per_client = 2;
  start(options);
  const Clients busy = clients(2, gate_request());
  ASSERT_TRUE(gate.has_seen(2));
  EXPECT_EQ(status("/json"), 429);
  EXPECT_TRUE(says("splatdrag_http_connections_refused_total 1"));
  RawClient elsewhere(port(), "127.0.0.2");
  elsewhere.send(request(port(), "GET", "/json"));
  EXPECT_EQ(elsewhere.answer().value_or(RawAnswer{}).status, 200);
  gate.open(2);
}

TEST_F(Crowd, WhereAllPlacesAreTakenOneThatWaitsMakesRoom) {
  ServerOptions options;
  options.lobby.max_connections = 4;
  start(options);
  const Clients idle = clients(4, "");
  ASSERT_TRUE(says("splatdrag_http_connections_open 4"));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(status("/json"), 200);
  EXPECT_TRUE(idle[0]->is_closed_within(patience));
}

TEST_F(Crowd, AReaderThatIsSlowIsLastToMakeRoom) {
  std::ofstream(folder.path() / "file.bin") << std::string(20'000'000, 'x');
  ServerOptions options;
  options.lobby.max_connections = 5;
  start(options);
  RawClient reader(port());
  reader.send(request(port(), "GET", "/file"));
  ASSERT_TRUE(says("splatdrag_http_requests_in_flight 1"));
  const Clients idle = clients(4, "");
  ASSERT_TRUE(says("splatdrag_http_connections_open 5"));
  // As many as wait without a request: a connection whose answer has just been taken may still be a worker's.
  for (int i = 0; i < 4; ++i) EXPECT_EQ(status("/json"), 200);
  EXPECT_EQ(reader.answer().value_or(RawAnswer{}).body.size(), 20'000'000u) << "it goes on";
}

TEST_F(Crowd, StoppingEndsEveryWait) {
  std::ofstream(folder.path() / "file.bin") << std::string(50'000'000, 'x');
  ServerOptions options;
  options.workers.threads = 4;
  options.grace = 300ms;
  start(options);
  Clients all;
  const auto add = [&](std::size_t number, const std::string& bytes) {
    for (auto& client : clients(number, bytes)) all.push_back(std::move(client));
  };
  add(3, "");
  add(3, "GET /json HTTP/1.1\r\n");
  add(3, "\r\n");
  add(3, request(port(), "POST", "/json", "Content-Type: application/json\r\nContent-Length: 1000\r\n"));
  add(6, request(port(), "POST", "/swallow", "Content-Length: 1000000\r\n"));
  add(3, request(port(), "GET", "/file"));
  add(2, request(port(), "GET", "/events"));
  add(3, request(port(), "GET", "/nowhere", "Content-Length: 1000000\r\n"));
  ASSERT_TRUE(says("splatdrag_http_streams_open 2"));
  server->server->stop();
  EXPECT_NE(server->metrics.text().find("\nsplatdrag_http_connections_open 0\n"), std::string::npos);
  EXPECT_NE(server->metrics.text().find("\nsplatdrag_http_requests_in_flight 0\n"), std::string::npos);
  EXPECT_NE(server->metrics.text().find("\nsplatdrag_http_streams_open 0\n"), std::string::npos);
}

TEST_F(Crowd, AnAnswerThatIsBeingTakenIsFinishedWhenItStops) {
  const std::string large(20'000'000, 'x');
  std::ofstream(folder.path() / "file.bin") << large;
  start();
  RawClient reader(port());
  reader.send(request(port(), "GET", "/file"));
  ASSERT_TRUE(says("splatdrag_http_requests_in_flight 1"));
  std::jthread stopper([&] { server->server->stop(); });
  std::this_thread::sleep_for(100ms);
  EXPECT_TRUE(reader.answer().value_or(RawAnswer{}).body == large);
}

TEST(Network, IsAnIpv4AddressOrTheFirstHalfOfAnIpv6One) {
  EXPECT_EQ(network_of("10.0.0.1"), network_of("::ffff:10.0.0.1"));
  EXPECT_NE(network_of("10.0.0.1"), network_of("10.0.0.2"));
  EXPECT_EQ(network_of("2001:db8:1:2::7"), network_of("2001:db8:1:2:ffff::1"));
  EXPECT_NE(network_of("2001:db8:1:2::7"), network_of("2001:db8:1:3::7"));
  EXPECT_EQ(network_of("unknown"), "unknown");
}

TEST(Places, AreCountedByNetworkAsLongAsTheyAreTaken) {
  int told = 0;
  Places places([&](int change) { told += change; });
  EXPECT_TRUE(places.empty_within(0ms));
  {
    const Places::Place one(places, "a"), two(places, "a"), three(places, "b");
    EXPECT_EQ(places.taken(), 3u);
    EXPECT_EQ(places.taken_by("a"), 2u);
    EXPECT_EQ(places.taken_by("c"), 0u);
    EXPECT_EQ(told, 3);
    EXPECT_FALSE(places.empty_within(1ms));
  }
  EXPECT_EQ(places.taken_by("a"), 0u);
  EXPECT_EQ(told, 0);
  EXPECT_TRUE(places.empty_within(0ms));
}

}  // namespace
}  // namespace server::http
