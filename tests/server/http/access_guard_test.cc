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

const Token owner = only_token("t");

bool lets_in(const AccessGuard& guard, const RequestHead& head) { return guard.check_access(head, "a").has_value(); }
int status_of(const AccessGuard& guard, const std::string& authorization, const std::string& client = "a") {
  const auto token = guard.check_token(authorization, client);
  return token ? 200 : token.error().status;
}

TEST(AccessGuard, KeepsABoundedNumberOfSessions) {
  AccessGuard guard({.tokens = {only_token("t")}, .allowed_hosts = {}, .allowed_origins = {}, .max_sessions = 3});
  std::vector<std::string> secrets;
  for (int i = 0; i < 5; ++i) secrets.push_back(guard.open_session(owner).value());
  for (int i = 0; i < 5; ++i) EXPECT_EQ(lets_in(guard, with_cookie(secrets[std::size_t(i)])), i >= 2) << i;
}

TEST(AccessGuard, ForgetsOldSessions) {
  AccessGuard guard({.tokens = {only_token("t")},
                     .allowed_hosts = {},
                     .allowed_origins = {},
                     .session_lifetime = std::chrono::seconds(0)});
  EXPECT_FALSE(lets_in(guard, with_cookie(guard.open_session(owner).value())));
}

TEST(AccessGuard, LooksAtNoTokenForAWhileAfterManyWrongOnes) {
  AccessGuard guard({.tokens = {only_token("t")}, .allowed_hosts = {}, .allowed_origins = {}});
  const std::string secret = guard.open_session(owner).value();
  for (int i = 0; i < 6; ++i) EXPECT_EQ(status_of(guard, "Bearer x" + std::to_string(i), "1.2.3.4"), 401);
  const auto braked = guard.check_token("Bearer t", "1.2.3.4");
  ASSERT_FALSE(braked);
  EXPECT_EQ(braked.error().status, 429);
  EXPECT_EQ(braked.error().retry_after, 1);
  EXPECT_EQ(status_of(guard, "Bearer t", "1.2.3.5"), 200);
  EXPECT_TRUE(guard.check_access(with_cookie(secret), "1.2.3.4")) << "a session goes on";
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
  const Token first{.name = "first", .read = true, .secret = "1"},
      second{.name = "second", .edit = true, .secret = "2"};
  AccessGuard guard({.tokens = {first, second}, .allowed_hosts = {}, .allowed_origins = {}});
  const auto open = [&](const std::string& secret) {
    return guard.open_session(**guard.check_token("Bearer " + secret, "a")).value();
  };
  const std::string of_first = open("1"), of_second = open("2");
  guard.replace_tokens({second, first});
  EXPECT_TRUE(lets_in(guard, with_cookie(of_first))) << "they only stand in another order";
  guard.replace_tokens({second});
  EXPECT_FALSE(lets_in(guard, with_cookie(of_first)));
  EXPECT_EQ(status_of(guard, "Bearer 1"), 401);
  EXPECT_TRUE(lets_in(guard, with_cookie(of_second)));
  for (const auto& change : {+[](Token& token) { token.secret = "3"; }, +[](Token& token) { token.name = "third"; },
                             +[](Token& token) { token.admin = true; }, +[](Token& token) { token.edit = false; }}) {
    guard.replace_tokens({second});
    const std::string session = open("2");
    Token changed = second;
    changed.read = true;
    change(changed);
    guard.replace_tokens({changed});
    EXPECT_FALSE(lets_in(guard, with_cookie(session)));
    EXPECT_FALSE(guard.still_knows(&second));
    EXPECT_TRUE(guard.still_knows(&changed));
  }
}

TEST(AccessGuard, OpensNoSessionForATokenThatWasTakenAwaySinceItWasLetIn) {
  const Token first{.name = "first", .read = true, .secret = "1"},
      second{.name = "second", .edit = true, .secret = "2"};
  AccessGuard guard({.tokens = {first, second}, .allowed_hosts = {}, .allowed_origins = {}});
  const TokenPtr let_in = *guard.check_token("Bearer 1", "a");
  guard.replace_tokens({second});
  EXPECT_FALSE(guard.open_session(*let_in));
}

TEST(AccessGuard, BrakesGuessesAtOtherTokensOfWhoeverHasOne) {
  const auto last_guess = [](std::vector<Token> tokens) {
    const AccessGuard guard({.tokens = std::move(tokens), .allowed_hosts = {}, .allowed_origins = {}});
    int status = 0;
    for (int i = 0; i < 20; ++i) {
      status = status_of(guard, "Bearer x" + std::to_string(i));
      (void)status_of(guard, "Bearer t");
    }
    return status;
  };
  EXPECT_EQ(
      last_guess({{.name = "viewer", .read = true, .secret = "t"}, {.name = "boss", .admin = true, .secret = "b"}}),
      429);
  EXPECT_EQ(last_guess({only_token("t")}), 401) << "whoever has the only one has nothing to guess";
}

TEST(AccessGuard, LooksAtTheTokenOfARequestBeforeItsCookie) {
  const Token viewer{.name = "viewer", .read = true, .secret = "1"}, boss{.name = "boss", .admin = true, .secret = "2"};
  AccessGuard guard({.tokens = {viewer, boss}, .allowed_hosts = {}, .allowed_origins = {}});
  RequestHead head = with_cookie(guard.open_session(viewer).value());
  const auto with = [&](const std::string& authorization) {
    RequestHead both = head;
    both.headers.emplace_back("authorization", authorization);
    const auto token = guard.check_access(both, "a");
    return token ? (*token)->name : std::to_string(token.error().status);
  };
  EXPECT_EQ(with("Bearer 2"), "boss");
  EXPECT_EQ(with("Bearer 3"), "401");
  EXPECT_EQ(with("Basic cHJveHk6cHJveHk="), "viewer") << "what a proxy asked for says nothing here";
}

TEST(AccessGuard, HoldsNoTokenAgainstWhatIsTooLongToBeOne) {
  const std::string longest(max_secret_bytes, 'x');
  const AccessGuard guard({.tokens = {only_token(longest)}, .allowed_hosts = {}, .allowed_origins = {}});
  EXPECT_EQ(status_of(guard, "Bearer " + longest), 200);
  EXPECT_EQ(status_of(guard, "Bearer " + longest + "x"), 401);
}

TEST(AccessGuard, ASessionOutlivesOtherQuotasAndHasThem) {
  Token token{.name = "studio", .edit = true, .secret = "1", .quotas = {.edits = 1}};
  AccessGuard guard({.tokens = {token}, .allowed_hosts = {}, .allowed_origins = {}});
  const RequestHead head = with_cookie(guard.open_session(**guard.check_token("Bearer 1", "a")).value());
  token.quotas.edits = 7;
  guard.replace_tokens({token});
  EXPECT_EQ(guard.check_access(head, "a").value()->quotas.edits, 7u);
}

TEST(AccessGuard, KnowsWhoseRequestItIs) {
  const AccessGuard guard({.tokens = {{.name = "first", .read = true, .secret = "1"},
                                      {.name = "second", .edit = true, .secret = "22"},
                                      {.name = "third", .admin = true, .secret = "12"}},
                           .allowed_hosts = {},
                           .allowed_origins = {}});
  EXPECT_EQ((*guard.check_token("Bearer 1", "a"))->name, "first");
  EXPECT_EQ((*guard.check_token("Bearer 22", "a"))->name, "second");
  EXPECT_EQ((*guard.check_token("Bearer 12", "a"))->name, "third");
  for (const char* wrong : {"2", "11", "2222", "1212", "222", ""})
    EXPECT_EQ(status_of(guard, std::string("Bearer ") + wrong), 401) << wrong;
}

TEST(AccessGuard, SaysWhatATokenLacks) {
  const Token viewer{.name = "viewer", .read = true, .secret = "1"};
  EXPECT_FALSE(AccessGuard::check_scope(&viewer, Scope::read));
  EXPECT_FALSE(AccessGuard::check_scope(nullptr, Scope::admin)) << "a service without tokens";
  const auto refusal = AccessGuard::check_scope(&viewer, Scope::edit);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->status, 403);
  EXPECT_EQ(refusal->code, "forbidden");
  EXPECT_EQ(refusal->detail, "token \"viewer\" may not edit: it lacks the scope edit");
  EXPECT_EQ(refusal->scope, "edit");
}

TEST(AccessGuard, WithoutATokenAdmitsAll) {
  const AccessGuard guard(AccessOptions{});
  EXPECT_FALSE(guard.needs_token());
  EXPECT_TRUE(lets_in(guard, RequestHead{}));
  EXPECT_EQ(status_of(guard, "Bearer "), 200);
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
