#include "server/http/request_head.h"

#include <gtest/gtest.h>

namespace server::http {
namespace {

TEST(ParseHead, TakesARequestApart) {
  const auto head = parse_head(
      "POST /v1/edits?validate_only=true&x HTTP/1.1\r\nHost: a:1\r\nContent-Length:  12 \r\nACCEPT: a/b\r\naccept: "
      "c/d\r\nExpect: 100-Continue\r\n\r\n");
  ASSERT_TRUE(head);
  EXPECT_EQ(head->method, "POST");
  EXPECT_EQ(head->path, "/v1/edits");
  EXPECT_EQ(head->query, "validate_only=true&x");
  EXPECT_EQ(head->content_length, 12u);
  EXPECT_EQ(head->header("accept"), "a/b, c/d");
  EXPECT_TRUE(head->expects_continue);
  EXPECT_TRUE(head->keep_alive);
  EXPECT_TRUE(head->has_body());
}

TEST(ParseHead, TakesATargetApartThatNamesAHost) {
  const auto head = [](const std::string& target) {
    return parse_head("GET " + target + " HTTP/1.1\r\nHost: b\r\nAccept: x\r\n\r\n");
  };
  const auto full = head("http://a.example:81/v1/info?x=http://c/#part");
  ASSERT_TRUE(full);
  EXPECT_EQ(full->header("host"), "a.example:81");
  EXPECT_EQ(full->count("host"), 1u);
  EXPECT_EQ(full->path, "/v1/info");
  EXPECT_EQ(full->query, "x=http://c/");
  const auto bare = head("https://[::1]?y");
  ASSERT_TRUE(bare);
  EXPECT_EQ(bare->header("host"), "[::1]");
  EXPECT_EQ(bare->path, "/");
  EXPECT_EQ(bare->query, "y");
  EXPECT_EQ(head("/http://a/")->header("host"), "b") << "that is a path";
  for (const char* wrong : {"http://", "http:///x", "http://user@a/", "http:/a", "ftp://a/", "a/b", "*", "//a\x7f"})
    EXPECT_EQ(head(wrong).error().status, 400) << wrong;
}

TEST(ParseHead, KnowsWhetherTheConnectionGoesOn) {
  const auto keeps = [](const std::string& version, const std::string& connection) {
    return parse_head("GET / " + version + "\r\nHost: a\r\nConnection: " + connection + "\r\n\r\n")->keep_alive;
  };
  EXPECT_TRUE(keeps("HTTP/1.1", "keep-alive"));
  EXPECT_FALSE(keeps("HTTP/1.1", "upgrade, Close"));
  EXPECT_FALSE(keeps("HTTP/1.0", "x"));
  EXPECT_TRUE(keeps("HTTP/1.0", "Keep-Alive"));
}

TEST(ParseHead, RefusesEveryCutOfAHead) {
  const std::string whole = "GET / HTTP/1.1\r\nHost: a\r\nA: b\r\n\r\n";
  ASSERT_TRUE(parse_head(whole));
  for (std::size_t cut = 0; cut < whole.size(); ++cut) EXPECT_FALSE(parse_head(whole.substr(0, cut))) << cut;
}

TEST(SplitList, LeavesQuotedCommasAlone) {
  EXPECT_EQ(split_list("a, \"b,c\" ,, d").size(), 3u);
  EXPECT_EQ(split_list("a, \"b,c\" ,, d")[1], "\"b,c\"");
  EXPECT_TRUE(split_list(" , ").empty());
}

}  // namespace
}  // namespace server::http
