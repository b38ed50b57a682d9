#include "server/http/url.h"

#include <gtest/gtest.h>

namespace server::http {
namespace {

TEST(PercentDecode, UndoesEscapesAndRefusesWhatIsNoText) {
  EXPECT_EQ(percent_decode("a%20%C3%A9%2b+").value(), "a \xc3\xa9++");
  for (const char* bad : {"%", "%4", "%4g", "%g4", "%00", "%0a", "%7f", "%c3", "%c3%28", "%ed%a0%80", "%f4%90%80%80",
                          "%c0%af", "%e0%80%80", "\xff"})
    EXPECT_FALSE(percent_decode(bad)) << bad;
}

TEST(SplitPath, DecodesSegmentsAfterSplitting) {
  EXPECT_EQ(split_path("/v1/scenes/s%31").value(), (std::vector<std::string>{"v1", "scenes", "s1"}));
  EXPECT_EQ(split_path("/").value(), std::vector<std::string>{""});
  EXPECT_EQ(split_path("//a").value(), (std::vector<std::string>{"", "a"}));
  for (const char* bad : {"", "a", "/.", "/..", "/a/../b", "/%2E%2e/b", "/a%2fb", "/a%5Cb", "/a\\b"})
    EXPECT_FALSE(split_path(bad)) << bad;
  EXPECT_TRUE(split_path("/a..b/...")) << "dots alone do not climb";
}

TEST(ParseQuery, KeepsOrderAndNamesTheCulprit) {
  const auto query = parse_query("a=1&b=x+y%2B&c&&d==").value();
  ASSERT_EQ(query.size(), 4u);
  EXPECT_EQ(query[1].second, "x y+");
  EXPECT_EQ(query[2].second, "");
  EXPECT_EQ(query[3].second, "=");
  EXPECT_TRUE(parse_query("")->empty());
  EXPECT_EQ(parse_query("a=1&b=%").error().where, "b");
}

}  // namespace
}  // namespace server::http
