#include "server/cli/options.h"

#include <gtest/gtest.h>

namespace server::cli {
namespace {

TEST(Options, ReadAPictureSize) {
  EXPECT_EQ(parse_size("640x480").value(), (PictureSize{640, 480}));
  EXPECT_EQ(parse_size("1x16384").value(), (PictureSize{1, 16384}));
  for (const char* text : {"", "640", "640x", "x480", "640x480x3", "640 x 480", "0x480", "640x-1", "16385x1",
                           "99999999999x1", "640X480", "640x480 "})
    EXPECT_FALSE(parse_size(text)) << text;
}

TEST(Options, AreNamedAlikeInTheEnvironment) {
  EXPECT_EQ(environment_name("max-side"), "SPLATDRAG_MAX_SIDE");
  CLI::App program;
  CLI::App* const command = program.add_subcommand("render");
  int side = 0;
  const CLI::Option* const option = command->add_option("--max-side", side);
  name_environment(program);
  EXPECT_EQ(option->get_envname(), "SPLATDRAG_MAX_SIDE");
  EXPECT_TRUE(command->get_help_ptr()->get_envname().empty());
}

TEST(Options, ReadThreeNumbersTogetherOrApart) {
  for (auto words : std::vector<std::vector<std::string>>{
           {"-1,-2.5,-3", "--up"}, {"-3", "-2.5", "-1", "--up"}, {"--up=-1,-2.5,-3"}}) {
    CLI::App program;
    std::array<double, 3> up{};
    add_triple(program, "--up", up, "");
    program.parse(words);
    EXPECT_EQ(up, (std::array<double, 3>{-1, -2.5, -3}));
  }
  for (auto words : std::vector<std::vector<std::string>>{{"1,2", "--up"}, {"1,2,3,4", "--up"}, {"1,b,3", "--up"}}) {
    CLI::App program;
    std::array<double, 3> up{};
    add_triple(program, "--up", up, "");
    EXPECT_THROW(program.parse(words), CLI::ParseError);
  }
}

}  // namespace
}  // namespace server::cli
