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
  for (int i = 0; i < 5; ++i) EXPECT_EQ(!guard.check_access(with_cookie(secrets[std::size_t(i)]), "a"), i >= 2) << i;
}

TEST(AccessGuard, ForgetsOldSessions) {
  AccessGuard guard(
      {.token = "t", .allowed_hosts = {}, .allowed_origins = {}, .session_lifetime = std::chrono::seconds(0)});
  EXPECT_TRUE(guard.check_access(with_cookie(guard.open_session()), "a"));
}

TEST(AccessGuard, LooksAtNoTokenForAWhileAfterManyWrongOnes) {
  AccessGuard guard({.token = "t", .allowed_hosts = {}, .allowed_origins = {}});
  const std::string secret = guard.open_session();
  for (int i = 0; i < 6; ++i) EXPECT_EQ(guard.check_token("Bearer x" + std::to_string(i), "1.2.3.4")->status, 401);
  const auto braked = guard.check_token("Bearer t", "1.2.3.4");
  ASSERT_TRUE(braked);
  EXPECT_EQ(braked->status, 429);
  EXPECT_EQ(braked->retry_after, 1);
  EXPECT_FALSE(guard.check_token("Bearer t", "1.2.3.5"));
  EXPECT_FALSE(guard.check_access(with_cookie(secret), "1.2.3.4")) << "a session goes on";
}

TEST(AccessGuard, BelievesAProxyOnlyIfTold) {
  AccessOptions options;
  const AccessGuard guard(options);
  EXPECT_EQ(guard.address_of("10.0.0.1", "6.6.6.6, 1.2.3.4"), "10.0.0.1");
  EXPECT_FALSE(guard.is_secure("https"));
  options.trust_proxy = true;
  const AccessGuard behind(options);
  EXPECT_EQ(behind.address_of("10.0.0.1", "6.6.6.6, 1.2.3.4"), "1.2.3.4");
  EXPECT_EQ(behind.address_of("10.0.0.1", ""), "10.0.0.1");
  EXPECT_TRUE(behind.is_secure("http, https"));
  EXPECT_FALSE(behind.is_secure("https, http"));
  EXPECT_FALSE(behind.is_secure(""));
}

TEST(AccessGuard, EndsSessionsWithTheTokenTheyWereOpenedWith) {
  AccessGuard guard({.token = "t", .allowed_hosts = {}, .allowed_origins = {}});
  const std::string secret = guard.open_session();
  guard.replace_token("t");
  EXPECT_FALSE(guard.check_access(with_cookie(secret), "a"));
  guard.replace_token("u");
  EXPECT_TRUE(guard.check_access(with_cookie(secret), "a"));
  EXPECT_TRUE(guard.check_token("Bearer t", "a"));
  EXPECT_FALSE(guard.check_token("Bearer u", "a"));
}

TEST(AccessGuard, WithoutATokenAdmitsAll) {
  const AccessGuard guard(AccessOptions{});
  EXPECT_FALSE(guard.needs_token());
  EXPECT_FALSE(guard.check_access(RequestHead{}, "a"));
  EXPECT_TRUE(guard.check_token("Bearer ", "a"));
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
