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
