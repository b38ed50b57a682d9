#include "server/cli/progress_display.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

namespace server::cli {
namespace {

using namespace std::chrono_literals;
using Time = std::chrono::steady_clock::time_point;

TEST(ProgressDisplay, PrintsALineEveryFewPercentWhereThereIsNoTerminal) {
  std::ostringstream out;
  Time now{};
  {
    ProgressDisplay display(out, ProgressDisplay::Style::lines, [&] { return now; });
    for (int i = 0; i <= 1000; ++i)
      display.show({.interval = 1, .intervals = 2, .stage = engine::edit::Stage::mask, .fraction = i / 1000.0});
    display.show({.interval = 2, .intervals = 2, .stage = engine::edit::Stage::finish, .fraction = 1});
  }
  const std::string text = out.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 21) << text;
  EXPECT_EQ(text.find_first_of("\r\x1b"), std::string::npos);
  EXPECT_NE(text.find("0 %  interval 1 of 2  mask\n"), std::string::npos) << text;
  EXPECT_NE(text.find("100 %"), std::string::npos);
}

TEST(ProgressDisplay, GuessesTheTimeLeft) {
  std::ostringstream out;
  Time now{};
  ProgressDisplay display(out, ProgressDisplay::Style::lines, [&] { return now; });
  display.show({.stage = engine::edit::Stage::views, .fraction = 0});
  now += 10s;
  display.show({.stage = engine::edit::Stage::views, .fraction = 0.25});
  EXPECT_NE(out.str().find("25 %  views  about 30 s left"), std::string::npos) << out.str();
  now += 290s;
  display.show({.stage = engine::edit::Stage::views, .fraction = 0.5});
  EXPECT_NE(out.str().find("about 5 min left"), std::string::npos) << out.str();
  display.show({.stage = engine::edit::Stage::finish, .fraction = 1});
  EXPECT_EQ(out.str().find("left", out.str().find("100 %")), std::string::npos) << out.str();
}

TEST(ProgressDisplay, TellsTheTimeLeftThatItIsGiven) {
  std::ostringstream out;
  Time now{};
  ProgressDisplay display(out, ProgressDisplay::Style::lines, [&] { return now; });
  display.show({.stage = engine::edit::Stage::views, .fraction = 0, .seconds_left = 41.2});
  EXPECT_NE(out.str().find("0 %  views  about 42 s left"), std::string::npos) << out.str();
  now += 10s;
  display.show({.stage = engine::edit::Stage::mask, .fraction = 0.5, .seconds_left = 100});
  EXPECT_NE(out.str().find("50 %  mask  about 2 min left"), std::string::npos) << out.str();
}

TEST(ProgressDisplay, RedrawsOneLineOnATerminalAndRemovesItAtTheEnd) {
  std::ostringstream out;
  Time now{};
  {
    ProgressDisplay display(out, ProgressDisplay::Style::bar, [&] { return now; });
    display.show({.stage = engine::edit::Stage::views, .fraction = 0.5});
    const std::size_t once = out.str().size();
    display.show({.stage = engine::edit::Stage::views, .fraction = 0.51});
    EXPECT_EQ(out.str().size(), once) << "too soon to redraw";
    now += 1s;
    display.show({.stage = engine::edit::Stage::views, .fraction = 0.52});
    EXPECT_GT(out.str().size(), once);
  }
  EXPECT_EQ(out.str().find('\n'), std::string::npos);
  EXPECT_NE(out.str().find("[##############..............] 50 %  views"), std::string::npos) << out.str();
  EXPECT_TRUE(out.str().ends_with("\r\x1b[K"));
}

}  // namespace
}  // namespace server::cli
