// `splatdrag serve` as its users run it.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/server/http/raw_client.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

using http::ask;
using nlohmann::json;
using namespace std::chrono_literals;

/// A running program; killed with the object if it still runs.
class Program {
 public:
  ///   descriptors  that it may open; null: as many as this program
  Program(const support::TempDir& folder, std::vector<std::string> arguments, const rlimit* descriptors = nullptr)
      : out_(folder.path() / "stdout"), err_(folder.path() / "stderr") {
    arguments.insert(arguments.begin(), SPLATDRAG_PROGRAM);
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    for (const auto& file : {out_, err_}) support::write_file(file, "");
    pid_ = ::fork();
    if (pid_ != 0) return;
    for (const auto& [file, target] : {std::pair{out_, STDOUT_FILENO}, std::pair{err_, STDERR_FILENO}})
      ::dup2(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), target);
    if (descriptors != nullptr) ::setrlimit(RLIMIT_NOFILE, descriptors);
    ::execv(pointers.front(), pointers.data());
    ::_exit(127);
  }
  ~Program() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// From the line that says so; 0 if it never comes.
  [[nodiscard]] int port() const {
    for (int i = 0; i < 500; ++i) {
      const std::string text = out();
      const std::size_t colon = text.rfind(':');
      if (text.ends_with('\n') && colon != std::string::npos) return std::atoi(text.c_str() + colon + 1);
      std::this_thread::sleep_for(20ms);
    }
    return 0;
  }
  void signal(int number) const { ::kill(pid_, number); }
  /// Exit status; -1 if it does not end within ten seconds, or ends by a signal.
  int wait() {
    for (int i = 0; i < 500; ++i) {
      int status = 0;
      if (::waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = 0;
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
      }
      std::this_thread::sleep_for(20ms);
    }
    return -1;
  }
  [[nodiscard]] std::string out() const { return support::read_file(out_); }
  [[nodiscard]] std::string err() const { return support::read_file(err_); }

 private:
  const std::filesystem::path out_, err_;
  pid_t pid_ = 0;
};

class Serve : public testing::Test {
 protected:
  std::vector<std::string> arguments(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"serve", "--port", "0", "--data-dir", (data_.path() / "data").string()});
    return more;
  }

  support::TempDir data_, first_, second_;
};

TEST_F(Serve, SaysWhereItListensAndEndsWellWhenToldTo) {
  for (const int number : {SIGTERM, SIGINT}) {
    Program program(first_, arguments());
    const int port = program.port();
    ASSERT_NE(port, 0) << program.err();
    EXPECT_TRUE(program.out().starts_with("splatdrag ")) << program.out();
    EXPECT_NE(program.out().find(" is listening on http://127.0.0.1:"), std::string::npos);
    EXPECT_EQ(ask(port, "GET", "/healthz").status, 200);
    EXPECT_EQ(ask(port, "GET", "/readyz").status, 200);
    EXPECT_NE(ask(port, "GET", "/").body.find("</html>"), std::string::npos);
    EXPECT_EQ(json::parse(ask(port, "GET", "/v1/scenes").body), json::parse(R"({"scenes":[]})"));
    EXPECT_EQ(json::parse(ask(port, "GET", "/v1/edits").body), json::parse(R"({"edits":[]})"));
    EXPECT_NE(ask(port, "GET", "/metrics").body.find("\nsplatdrag_scenes 0\n"), std::string::npos);
    program.signal(number);
    EXPECT_EQ(program.wait(), 0) << program.err();
    const std::string log = program.err();
    EXPECT_EQ(json::parse(log.substr(0, log.find('\n')))["message"], "listening") << log;
  }
}

TEST_F(Serve, RefusesToBeAFrontOrAWorkerWithoutADatabase) {
  for (const char* role : {"front", "worker"}) {
    Program program(first_, arguments({"--role", role}));
    EXPECT_EQ(program.wait(), 2);
    EXPECT_NE(program.err().find("fronts and workers find each other by a database"), std::string::npos)
        << program.err();
  }
  EXPECT_FALSE(std::filesystem::exists(data_.path() / "data")) << "nothing has been made";
}

TEST_F(Serve, LeavesFilesTheirShareOfFewDescriptors) {
  const rlimit few{300, 300};
  Program program(first_, arguments({"--log-format", "text"}), &few);
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  EXPECT_NE(program.err().find("--max-connections is lowered files=300 connections=172"), std::string::npos)
      << program.err();
  EXPECT_EQ(ask(port, "GET", "/healthz").status, 200);
}

TEST_F(Serve, CountsWhatAnOperatorWatches) {
  Program program(first_, arguments());
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  EXPECT_EQ(ask(port, "POST", "/v1/scenes", "Content-Type: application/octet-stream\r\n", "ply\nnonsense\n").status,
            422);
  std::string metrics;  // an answer is counted once it has been sent
  const std::string refused = "\nsplatdrag_uploads_refused_total{reason=\"corrupt_data\"} 1\n";
  for (int i = 0; i < 100 && metrics.find(refused) == std::string::npos; ++i)
    metrics = ask(port, "GET", "/metrics").body;
  for (const std::string& expected : {refused, std::string("\nsplatdrag_oldest_queued_edit_seconds 0\n")})
    EXPECT_NE(metrics.find(expected), std::string::npos) << metrics;
  for (const std::string name : {"\nsplatdrag_disk_free_bytes ", "\nsplatdrag_disk_used_bytes "}) {
    const auto at = metrics.find(name);
    ASSERT_NE(at, std::string::npos) << metrics;
    EXPECT_GT(std::atof(metrics.c_str() + at + name.size()), 0) << name;
  }
}

TEST_F(Serve, SaysThatItEndsBeforeItDoes) {
  Program program(first_, arguments({"--unready-seconds", "2"}));
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  EXPECT_EQ(ask(port, "GET", "/readyz").status, 200);
  program.signal(SIGTERM);
  for (int i = 0; i < 100 && ask(port, "GET", "/readyz").status == 200; ++i) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(ask(port, "GET", "/readyz").status, 503);
  EXPECT_EQ(ask(port, "GET", "/v1/scenes").status, 200) << "it goes on serving meanwhile";
  EXPECT_EQ(program.wait(), 0);
}

TEST_F(Serve, ReadsItsTokenAgainOnHangup) {
  const auto file = first_.path() / "token";
  support::write_file(file, "first\n");
  Program program(second_, arguments({"--token-file", file.string(), "--trust-proxy", "--log-format", "text"}));
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  const auto status_with = [&](const std::string& token) {
    return ask(port, "GET", "/v1/scenes", "Authorization: Bearer " + token + "\r\n").status;
  };
  const auto hang_up_until = [&](const std::string& said) {
    program.signal(SIGHUP);
    for (int i = 0; i < 500 && program.err().find(said) == std::string::npos; ++i) std::this_thread::sleep_for(20ms);
  };
  EXPECT_EQ(status_with("first"), 200);
  support::write_file(file, "second\n");
  hang_up_until("read again");
  EXPECT_EQ(status_with("first"), 401);
  EXPECT_EQ(status_with("second"), 200);
  support::write_file(file, "");
  hang_up_until("the old tokens stay");
  EXPECT_EQ(status_with("second"), 200) << program.err();
  const auto open = [&](const std::string& proto) {
    return ask(port, "POST", "/v1/session", "Authorization: Bearer second\r\nX-Forwarded-Proto: " + proto + "\r\n")
        .header("set-cookie");
  };
  EXPECT_TRUE(open("https").ends_with("; Path=/; Secure")) << open("https");
  EXPECT_TRUE(open("http").ends_with("; Path=/"));
  program.signal(SIGTERM);
  EXPECT_EQ(program.wait(), 0);
}

TEST_F(Serve, SaysEveryLimitItKeeps) {
  Program program(first_, arguments({"--max-json-bytes", "2KiB", "--max-streams", "3", "--max-render-side", "777",
                                     "--max-queued", "5", "--max-upload-bytes", "1MiB", "--threads", "1",
                                     "--max-handles", "6", "--max-views", "7", "--max-image-side", "64"}));
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  const json info = json::parse(ask(port, "GET", "/v1/info").body);
  EXPECT_EQ(info["limits"]["json_bytes"], 2048);
  EXPECT_EQ(info["limits"]["streams"], 3);
  EXPECT_EQ(info["limits"]["render_side"], 777);
  EXPECT_EQ(info["limits"]["queued_edits"], 5);
  EXPECT_EQ(info["limits"]["upload_bytes"], 1 << 20);
  EXPECT_EQ(info["limits"]["handles"], 6);
  EXPECT_EQ(info["limits"]["views"], 7);
  EXPECT_EQ(info["limits"]["image_side"], 64);
  EXPECT_EQ(info["threads"], 1);
  EXPECT_EQ(ask(port, "POST", "/v1/edits", "Content-Type: application/json\r\n", std::string(2049, ' ')).status, 413);
}

TEST_F(Serve, TakesJsonUpToTheLimitItSays) {
  Program program(first_, arguments({"--max-json-bytes", "1MiB"}));
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  const auto limit = json::parse(ask(port, "GET", "/v1/info").body)["limits"]["json_bytes"].get<std::size_t>();
  EXPECT_EQ(limit, 1u << 20);
  const auto status = [&](std::size_t bytes) {
    return ask(port, "POST", "/v1/edits", "Content-Type: application/json\r\n", "{" + std::string(bytes - 2, ' ') + "}")
        .status;
  };
  EXPECT_EQ(status(limit), 400) << "handles are missing; the size is right";
  EXPECT_EQ(status(limit + 1), 413);
}

TEST_F(Serve, WantsItsToken) {
  support::write_file(first_.path() / "token", "hush\n");
  Program program(first_, arguments({"--token-file", (first_.path() / "token").string()}));
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  EXPECT_EQ(ask(port, "GET", "/v1/scenes").status, 401);
  EXPECT_EQ(ask(port, "GET", "/v1/scenes", "Authorization: Bearer hush\r\n").status, 200);
  program.signal(SIGTERM);
  EXPECT_EQ(program.wait(), 0);
  EXPECT_EQ(program.err().find("hush"), std::string::npos);
}

TEST_F(Serve, RefusesWhatWouldGoWrong) {
  Program program(first_, arguments());
  const int port = program.port();
  ASSERT_NE(port, 0) << program.err();
  const auto refused = [&](std::vector<std::string> more, const std::string& expected) {
    Program other(second_, std::move(more));
    const int status = other.wait();
    EXPECT_NE(other.err().find(expected), std::string::npos) << other.err();
    EXPECT_EQ(other.out(), "");
    return status;
  };
  EXPECT_EQ(refused(arguments(), "another service uses this data folder"), 12);
  EXPECT_NE(support::read_file(second_.path() / "stderr").find("(" + (data_.path() / "data").string() + ")"),
            std::string::npos);
  const std::string elsewhere = (second_.path() / "data").string();
  EXPECT_EQ(refused({"serve", "--port", std::to_string(port), "--data-dir", elsewhere}, "is taken"), 12);
  EXPECT_EQ(refused({"serve", "--port", "0", "--host", "0.0.0.0", "--data-dir", elsewhere}, "--token-file"), 2);
  support::write_file(second_.path() / "empty", "\n");
  EXPECT_EQ(refused({"serve", "--port", "0", "--data-dir", elsewhere, "--token-file", second_.path() / "empty"},
                    "the token file is empty"),
            2);
  const auto with_store = [&](const std::string& address) {
    return std::vector<std::string>{"serve", "--port", "0", "--data-dir", elsewhere, "--store", address};
  };
  const std::string nowhere = "postgresql://me:secret@/edits?host=" + second_.path().string();
  EXPECT_EQ(refused(with_store(nowhere), "error: the job store cannot be reached: No such file or directory ("), 12);
  EXPECT_EQ(refused(with_store("postgresql://me:se/secret@host/edits"), "cannot be read: expected postgresql://"), 2);
  EXPECT_EQ(support::read_file(second_.path() / "stderr").find("secret"), std::string::npos);
  EXPECT_EQ(refused({"serve"}, "--data-dir"), 2);
  EXPECT_EQ(refused({"serve", "--data-dir", elsewhere, "--lease-seconds", "1"}, "--lease-seconds"), 2);
  EXPECT_EQ(refused({"serve", "--data-dir", elsewhere, "--max-handles", "257"}, "--max-handles"), 2);
  EXPECT_EQ(refused({"serve", "--data-dir", elsewhere, "--max-scenes", "2.5"}, "--max-scenes"), 2);
  EXPECT_EQ(refused({"serve", "--data-dir", elsewhere, "--max-json-bytes", "2MiB"}, "--max-json-bytes"), 2);
  EXPECT_EQ(refused({"serve", "--data-dir", elsewhere, "--simd", "ABACUS"}, "--simd"), 2);
}

}  // namespace
}  // namespace server::cli
