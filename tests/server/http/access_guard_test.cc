#include "server/http/access_guard.h"

#include <gtest/gtest.h>

#include <set>

namespace server::http {
namespace {

RequestHead with_cookie(const std::string& secret) {
  RequestHead head;
  head.headers = {{"cookie", "splatdrag_session=" + secret}};
  return head;
}

TEST(AccessGuard, KeepsABoundedNumberOfSessions) {
  AccessGuard guard({.token = "t", .allowed_hosts = {}, .allowed_origins = {}, .max_sessions = 3});
  std::vector<std::string> secrets;
  for (int i = 0; i < 5; ++i) secrets.push_back(guard.open_session());
  for (int i = 0; i < 5; ++i) EXPECT_EQ(guard.admits(with_cookie(secrets[std::size_t(i)])), i >= 2) << i;
}

TEST(AccessGuard, ForgetsOldSessions) {
  AccessGuard guard(
      {.token = "t", .allowed_hosts = {}, .allowed_origins = {}, .session_lifetime = std::chrono::seconds(0)});
  EXPECT_FALSE(guard.admits(with_cookie(guard.open_session())));
}

TEST(AccessGuard, WithoutATokenAdmitsAll) {
  const AccessGuard guard(AccessOptions{});
  EXPECT_FALSE(guard.needs_token());
  EXPECT_TRUE(guard.admits(RequestHead{}));
  EXPECT_FALSE(guard.is_token("Bearer "));
}

TEST(AccessGuard, KnowsItsNameWithoutAPortOnlyOnPort80) {
  AccessGuard guard(AccessOptions{});
  guard.bound_to("::1", 80);
  RequestHead head;
  for (const char* host : {"[::1]", "[::1]:80", "localhost", "127.0.0.1:80"}) {
    head.headers = {{"host", host}};
    EXPECT_FALSE(guard.check_origin(head)) << host;
  }
  head.headers = {{"host", "[::1]:81"}};
  EXPECT_TRUE(guard.check_origin(head));
}

TEST(RandomId, IsNeverTheSame) {
  std::set<std::string> ids;
  for (int i = 0; i < 1000; ++i) ids.insert(random_id());
  EXPECT_EQ(ids.size(), 1000u);
}

}  // namespace
}  // namespace server::http
