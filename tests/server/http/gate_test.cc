#include "server/http/gate.h"

#include <gtest/gtest.h>

#include <set>

namespace server::http {
namespace {

RequestHead with_cookie(const std::string& secret) {
  RequestHead head;
  head.headers = {{"cookie", "splatdrag_session=" + secret}};
  return head;
}

TEST(Gate, KeepsABoundedNumberOfSessions) {
  Gate gate({.token = "t", .allowed_hosts = {}, .allowed_origins = {}, .max_sessions = 3});
  std::vector<std::string> secrets;
  for (int i = 0; i < 5; ++i) secrets.push_back(gate.open_session());
  for (int i = 0; i < 5; ++i) EXPECT_EQ(gate.admits(with_cookie(secrets[std::size_t(i)])), i >= 2) << i;
}

TEST(Gate, ForgetsOldSessions) {
  Gate gate({.token = "t", .allowed_hosts = {}, .allowed_origins = {}, .session_lifetime = std::chrono::seconds(0)});
  EXPECT_FALSE(gate.admits(with_cookie(gate.open_session())));
}

TEST(Gate, WithoutATokenAdmitsAll) {
  const Gate gate(GateOptions{});
  EXPECT_FALSE(gate.needs_token());
  EXPECT_TRUE(gate.admits(RequestHead{}));
  EXPECT_FALSE(gate.is_token("Bearer "));
}

TEST(Gate, KnowsItsNameWithoutAPortOnlyOnPort80) {
  Gate gate(GateOptions{});
  gate.bound_to("::1", 80);
  RequestHead head;
  for (const char* host : {"[::1]", "[::1]:80", "localhost", "127.0.0.1:80"}) {
    head.headers = {{"host", host}};
    EXPECT_FALSE(gate.check_origin(head)) << host;
  }
  head.headers = {{"host", "[::1]:81"}};
  EXPECT_TRUE(gate.check_origin(head));
}

TEST(RandomId, IsNeverTheSame) {
  std::set<std::string> ids;
  for (int i = 0; i < 1000; ++i) ids.insert(random_id());
  EXPECT_EQ(ids.size(), 1000u);
}

}  // namespace
}  // namespace server::http
