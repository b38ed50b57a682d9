#include "server/http/library_messages.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "server/http/log.h"

namespace server::http {
namespace {

using nlohmann::json;

/// What is said in the log while `speak` does, entry by entry; each line has to be JSON.
template <class Speak>
std::vector<std::string> said_while(Speak speak) {
  std::ostringstream out;
  const auto logger = *make_logger(out, "info", LogFormat::json);
  {
    const LibraryMessages messages(*logger);
    speak();
  }
  std::vector<std::string> said;
  std::istringstream lines(out.str());
  for (std::string line; std::getline(lines, line);) {
    const json entry = json::parse(line);
    EXPECT_EQ(entry.at("level"), "warn");
    said.push_back(entry.at("said"));
  }
  return said;
}

#ifdef __GLIBC__

TEST(LibraryMessages, AreEntriesOfTheLogLineByLine) {
  const auto said = said_while([] {
    std::fprintf(stderr, "libpng warning: %s", "iCCP: known incorrect sRGB profile");  // in pieces, as libpng prints
    std::fprintf(stderr, "\n");
    std::fputs("two\n\nlines \"quoted\"\xff\n", stderr);
    std::fputs("no end", stderr);
  });
  EXPECT_EQ(said, (std::vector<std::string>{"libpng warning: iCCP: known incorrect sRGB profile", "two",
                                            "lines \"quoted\"\xef\xbf\xbd", "no end"}));
}

TEST(LibraryMessages, AreCutWhereTheyHaveNoEnd) {
  const auto said = said_while([] { std::fputs(std::string(100'000, 'x').c_str(), stderr); });
  ASSERT_FALSE(said.empty());
  for (const std::string& entry : said) EXPECT_LE(entry.size(), 1000u);
}

TEST(LibraryMessages, OfManyThreadsAreWholeLines) {
  const auto said = said_while([] {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t)
      threads.emplace_back([] {
        for (int i = 0; i < 200; ++i) std::fputs("0123456789\n", stderr);
      });
  });
  EXPECT_EQ(said, std::vector<std::string>(800, "0123456789"));
}

#endif

TEST(LibraryMessages, LeavesStderrAsItWas) {
  std::FILE* const before = stderr;
  (void)said_while([] {});
  EXPECT_EQ(stderr, before);
}

}  // namespace
}  // namespace server::http
