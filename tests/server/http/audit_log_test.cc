#include "server/http/audit_log.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/server/http/test_server.h"
#include "tests/support/data.h"
#include "tests/support/full_disk.h"

namespace server::http {
namespace {

using nlohmann::json;

class AuditLogTest : public testing::Test {
 protected:
  static proto::AuditEntry entry(const std::string& id) {
    proto::AuditEntry made;
    made.request_id = id;
    return made;
  }
  /// Every line of the file; one that is no JSON is null.
  std::vector<json> lines(const std::filesystem::path& of) const {
    std::vector<json> found;
    std::ifstream in(of);
    for (std::string line; std::getline(in, line);) {
      const json parsed = json::parse(line, nullptr, false);
      found.push_back(parsed.is_discarded() ? json() : parsed);
    }
    return found;
  }

  support::TempDir folder;
  const std::filesystem::path file = folder.path() / "audit.jsonl";
  LogText service_log;
};

TEST_F(AuditLogTest, AppendsToWhatIsThere) {
  std::ofstream(file) << "{\"before\":1}\n{\"half";
  auto log = AuditLog::open(file, service_log.logger());
  ASSERT_TRUE(log) << log.error().message;
  (*log)->write(entry("a"));
  (*log)->write(entry("b"));
  const auto found = lines(file);
  ASSERT_EQ(found.size(), 4u);
  EXPECT_EQ(found[0]["before"], 1);
  EXPECT_TRUE(found[1].is_null()) << "what somebody left of a line stays one by itself";
  EXPECT_EQ(found[2]["request_id"], "a");
  EXPECT_EQ(found[3]["request_id"], "b");
  EXPECT_EQ((*log)->lost(), 0u);
}

TEST_F(AuditLogTest, IsReadableToItsOwnerAndItsGroup) {
  ASSERT_TRUE(AuditLog::open(file, service_log.logger()));
  const auto permissions = std::filesystem::status(file).permissions();
  EXPECT_EQ(permissions & std::filesystem::perms::others_all, std::filesystem::perms::none);
  EXPECT_NE(permissions & std::filesystem::perms::owner_read, std::filesystem::perms::none);
}

TEST_F(AuditLogTest, GoesOnInAnotherFileOfItsName) {
  auto log = AuditLog::open(file, service_log.logger());
  ASSERT_TRUE(log);
  (*log)->write(entry("a"));
  std::filesystem::rename(file, folder.path() / "audit.1");
  (*log)->write(entry("b"));
  ASSERT_TRUE((*log)->reopen());
  (*log)->write(entry("c"));
  EXPECT_EQ(lines(folder.path() / "audit.1").size(), 2u);
  ASSERT_EQ(lines(file).size(), 1u);
  EXPECT_EQ(lines(file)[0]["request_id"], "c");
  std::filesystem::remove(file);
  std::filesystem::create_directory(file);
  EXPECT_FALSE((*log)->reopen());
  (*log)->write(entry("d"));
  EXPECT_EQ((*log)->lost(), 0u) << "the old file is still there for it";
}

TEST_F(AuditLogTest, NamesAFileThatCannotBeOpened) {
  const auto log = AuditLog::open(folder.path() / "no" / "audit", service_log.logger());
  ASSERT_FALSE(log);
  EXPECT_EQ(log.error().code, engine::ErrorCode::not_found);
  EXPECT_EQ(log.error().where, (folder.path() / "no" / "audit").string());
}

TEST_F(AuditLogTest, KeepsNobodyWaitingForAPipeThatNobodyEmpties) {
  ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
  const auto log = AuditLog::open(file, service_log.logger());
  ASSERT_TRUE(log) << log.error().message;
  proto::AuditEntry entry;
  entry.route = std::string(4000, 'r');
  for (int i = 0; i < 1000 && (*log)->lost() == 0; ++i) (*log)->write(entry);  // a pipe holds 64 KiB
  EXPECT_GT((*log)->lost(), 0u);
}

TEST_F(AuditLogTest, OnAFullDiskTellsTheServicesLogAndLaterHowMuchItLacks) {
  auto log = AuditLog::open(file, service_log.logger());
  ASSERT_TRUE(log);
  (*log)->write(entry("a"));
  {
    const support::FullDisk full(std::filesystem::file_size(file) + 20);
    (*log)->write(entry("b"));
    (*log)->write(entry("c"));
  }
  EXPECT_EQ((*log)->lost(), 2u);
  (*log)->write(entry("d"));
  (*log)->write(entry("e"));
  const auto found = lines(file);
  ASSERT_EQ(found.size(), 5u);
  EXPECT_EQ(found[0]["request_id"], "a");
  EXPECT_TRUE(found[1].is_null()) << "what there was room for";
  EXPECT_EQ(found[2]["lost"], 2);
  EXPECT_EQ(found[3]["request_id"], "d");
  EXPECT_EQ(found[4]["request_id"], "e") << "and it is said once";
  for (const char* id : {"b", "c"})
    EXPECT_NE(service_log.text().find(std::string("request_id\\\":\\\"") + id), std::string::npos)
        << service_log.text();
}

TEST_F(AuditLogTest, KeepsLinesOfManyThreadsApart) {
  auto log = AuditLog::open(file, service_log.logger());
  ASSERT_TRUE(log);
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) (*log)->write(entry(std::string(std::size_t(i) * 20, 'x')));
    });
  threads.clear();
  const auto found = lines(file);
  EXPECT_EQ(found.size(), 400u);
  for (const json& line : found) EXPECT_FALSE(line.is_null());
}

class AuditedServer : public AuditLogTest {
 protected:
  AuditedServer() {
    const auto done = [](const Call& call) -> Result<Reply> {
      if (call.path("id") == "gone") return engine::fail(engine::ErrorCode::not_found, "there is none", "scene");
      return Reply::no_content();
    };
    const auto made = [](const Call&) -> Result<Reply> {
      Reply reply = Reply::json("{}", 202);
      reply.headers.emplace_back("Location", "/v1/edits/e000007");
      reply.about = {{"scene", "s000001"}};
      return reply;
    };
    Router routes;
    routes.add({.method = "GET", .path = "/v1/scenes/{id}", .handler = done, .access = Access::read});
    routes.add({.method = "DELETE", .path = "/v1/scenes/{id}/versions/{v}", .handler = done, .access = Access::edit});
    routes.add({.method = "POST",
                .path = "/v1/edits",
                .handler = made,
                .queries = {"validate_only"},
                .access = Access::edit,
                .reads_with = "validate_only"});
    routes.add({.method = "POST", .path = "/v1/session", .handler = made, .access = Access::token});
    ServerOptions options;
    options.audit = audit.get();
    server.emplace(std::move(routes), options,
                   AccessOptions{.tokens = {{.name = "viewer", .read = true, .secret = "r"},
                                            {.name = "editor", .edit = true, .secret = "hush"}},
                                 .allowed_hosts = {},
                                 .allowed_origins = {}});
  }
  RawAnswer ask_as(const std::string& secret, const std::string& method, const std::string& target) const {
    return ask(server->port(), method, target, "X-Request-Id: r1\r\nAuthorization: Bearer " + secret + "\r\n");
  }

  std::unique_ptr<AuditLog> audit = AuditLog::open(file, service_log.logger()).value();
  std::optional<TestServer> server;
};

TEST_F(AuditedServer, WritesWhoChangedWhatBeforeItAnswers) {
  EXPECT_EQ(ask_as("hush", "DELETE", "/v1/scenes/s000001/versions/3").status, 204);
  const auto removed = lines(file);
  ASSERT_EQ(removed.size(), 1u);
  EXPECT_EQ(removed[0]["request_id"], "r1");
  EXPECT_EQ(removed[0]["token"], "editor");
  EXPECT_EQ(removed[0]["address"], "127.0.0.1");
  EXPECT_EQ(removed[0]["method"], "DELETE");
  EXPECT_EQ(removed[0]["route"], "/v1/scenes/{id}/versions/{v}");
  EXPECT_EQ(removed[0]["scene"], "s000001");
  EXPECT_EQ(removed[0]["version"], "3");
  EXPECT_EQ(removed[0]["status"], 204);
  EXPECT_FALSE(removed[0].contains("refused"));
  EXPECT_EQ(removed[0]["time"].get<std::string>().size(), 24u);

  EXPECT_EQ(ask_as("hush", "POST", "/v1/edits").status, 202);
  EXPECT_EQ(ask_as("hush", "DELETE", "/v1/scenes/gone/versions/3").status, 404);
  EXPECT_EQ(ask_as("r", "POST", "/v1/session").status, 202);
  const auto all = lines(file);
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all[1]["edit"], "e000007");
  EXPECT_EQ(all[1]["scene"], "s000001");
  EXPECT_EQ(all[2]["refused"], "not_found");
  EXPECT_EQ(all[3]["token"], "viewer");
  EXPECT_EQ(support::read_file(file).find("hush"), std::string::npos);
}

TEST_F(AuditedServer, WritesWhoWasNotLetIn) {
  EXPECT_EQ(ask_as("wrong", "GET", "/v1/scenes/s000001").status, 401);
  EXPECT_EQ(ask_as("r", "DELETE", "/v1/scenes/s000001/versions/3").status, 403);
  EXPECT_EQ(ask_as("wrong", "GET", "/nowhere").status, 401);
  const auto found = lines(file);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_TRUE(found[0]["token"].is_null());
  EXPECT_EQ(found[0]["scene"], "s000001");
  EXPECT_EQ(found[0]["refused"], "unauthorized");
  EXPECT_EQ(found[1]["token"], "viewer");
  EXPECT_EQ(found[1]["status"], 403);
  EXPECT_EQ(found[1]["refused"], "forbidden");
  EXPECT_EQ(found[2]["route"], "-");
}

TEST_F(AuditedServer, IsSilentAboutWhoLooks) {
  EXPECT_EQ(ask_as("r", "GET", "/v1/scenes/s000001").status, 204);
  EXPECT_EQ(ask_as("r", "POST", "/v1/edits?validate_only=true").status, 202);
  EXPECT_EQ(ask_as("r", "GET", "/nowhere").status, 404);
  EXPECT_TRUE(lines(file).empty());
}

TEST_F(AuditedServer, DoesNotRefuseForAFullDisk) {
  {
    const support::FullDisk full(0);
    EXPECT_EQ(ask_as("hush", "DELETE", "/v1/scenes/s000001/versions/3").status, 204);
  }
  EXPECT_EQ(audit->lost(), 1u);
}

}  // namespace
}  // namespace server::http
