#include "server/http/log.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

namespace server::http {
namespace {

TEST(Log, WritesOneJsonObjectPerLine) {
  std::ostringstream out;
  const auto logger = make_logger(out, "info", LogFormat::json);
  ASSERT_TRUE(logger);
  log(**logger, spdlog::level::warn, "two\nlines", {{"name", "a\"b\xff"}, {"count", std::int64_t{3}}, {"ms", 0.5}});
  (*logger)->info("plain {}", 1);
  (*logger)->debug("not shown");
  std::istringstream lines(out.str());
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  const auto first = nlohmann::json::parse(line);
  EXPECT_EQ(first["level"], "warn");
  EXPECT_EQ(first["message"], "two\nlines");
  EXPECT_EQ(first["count"], 3);
  EXPECT_EQ(first["ms"], 0.5);
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_EQ(nlohmann::json::parse(line)["message"], "plain 1");
  EXPECT_FALSE(std::getline(lines, line));
}

TEST(Log, WritesForPeopleToo) {
  std::ostringstream out;
  const auto logger = make_logger(out, "debug", LogFormat::text);
  log(**logger, spdlog::level::info, "request", {{"status", std::int64_t{200}}, {"route", "/x\n/y"}});
  EXPECT_NE(out.str().find("Z info request status=200 route=/x /y\n"), std::string::npos) << out.str();
}

TEST(Log, KnowsItsLevels) {
  std::ostringstream out;
  EXPECT_TRUE(make_logger(out, "off", LogFormat::json));
  EXPECT_FALSE(make_logger(out, "loud", LogFormat::json));
}

}  // namespace
}  // namespace server::http
