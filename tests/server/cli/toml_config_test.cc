#include "server/cli/toml_config.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "server/cli/options.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

/// A variable of the environment for the length of a test.
class Variable {
 public:
  Variable(std::string name, const std::string& value) : name_(std::move(name)) {
    setenv(name_.c_str(), value.c_str(), /*overwrite=*/1);
  }
  ~Variable() { unsetenv(name_.c_str()); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  std::string name_;
};

struct Settings {
  int size = 1;
  std::string word = "default";
  bool flag = false;
  double number = 0;
  std::vector<std::string> list;
  std::array<double, 3> triple{};
  int other_size = 1;
};

/// Parses `arguments` with the settings file `toml`.
Settings parse(const std::string& toml, std::vector<std::string> arguments) {
  const support::TempDir folder;
  const auto file = folder.path() / "settings.toml";
  support::write_file(file, toml);
  Settings settings;
  CLI::App program;
  program.set_config("--config", file.string());
  program.config_formatter(std::make_shared<TomlConfig>(program));
  program.allow_config_extras(CLI::config_extras_mode::error);
  CLI::App* const command = program.add_subcommand("make");
  command->add_option("--size", settings.size);
  command->add_option("--long-word", settings.word);
  command->add_flag("--flag", settings.flag);
  command->add_option("--number", settings.number);
  command->add_option("--list", settings.list);
  add_triple(*command, "--triple", settings.triple, "");
  program.add_subcommand("other")->add_option("--size", settings.other_size);
  name_environment(program);
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
  program.parse(std::move(arguments));
  return settings;
}

TEST(TomlConfig, TheCommandLineOutranksTheEnvironmentOutranksTheFileOutranksTheDefault) {
  const std::string file = "[make]\nsize = 2\n";
  EXPECT_EQ(parse("", {"make"}).size, 1);
  EXPECT_EQ(parse(file, {"make"}).size, 2);
  const Variable variable("SPLATDRAG_SIZE", "3");
  EXPECT_EQ(parse("", {"make"}).size, 3);
  EXPECT_EQ(parse(file, {"make"}).size, 3);
  EXPECT_EQ(parse(file, {"make", "--size", "4"}).size, 4);
  EXPECT_EQ(parse("", {"make", "--size", "4"}).size, 4);
}

TEST(TomlConfig, TheSameHoldsForFlagsAndLists) {
  EXPECT_TRUE(parse("[make]\nflag = true\n", {"make"}).flag);
  EXPECT_FALSE(parse("[make]\nflag = false\n", {"make"}).flag);
  EXPECT_EQ(parse("[make]\nlist = ['a', 'b']\n", {"make", "--list", "c"}).list, std::vector<std::string>{"c"});
  const Variable flag("SPLATDRAG_FLAG", "false"), triple("SPLATDRAG_TRIPLE", "1,2,3");
  EXPECT_FALSE(parse("[make]\nflag = true\n", {"make"}).flag);
  EXPECT_TRUE(parse("[make]\nflag = false\n", {"make", "--flag"}).flag);
  EXPECT_EQ(parse("[make]\ntriple = [4, 5, 6]\n", {"make"}).triple, (std::array<double, 3>{1, 2, 3}));
}

TEST(TomlConfig, AnEmptyVariableCountsAsNone) {
  const Variable variable("SPLATDRAG_SIZE", "");
  EXPECT_EQ(parse("[make]\nsize = 2\n", {"make"}).size, 2);
}

TEST(TomlConfig, ReadsEveryKindOfValue) {
  const Settings settings = parse(
      "# mine\n[make]\nsize = 1_000\nlong-word = \"two \\u0041 = words\"\nflag = true\nnumber = 0.1\n"
      "list = [\n  'a, b',\n  'c'\n]\ntriple = [-1, 0.5, 1e-3]\n[other]\nsize = 9\n",
      {"make"});
  EXPECT_EQ(settings.size, 1000);
  EXPECT_EQ(settings.word, "two A = words");
  EXPECT_TRUE(settings.flag);
  EXPECT_EQ(settings.number, 0.1);
  EXPECT_EQ(settings.list, (std::vector<std::string>{"a, b", "c"}));
  EXPECT_EQ(settings.triple, (std::array<double, 3>{-1, 0.5, 1e-3}));
}

TEST(TomlConfig, KeepsTheTablesOfSubcommandsApart) {
  const std::string file = "[make]\nsize = 2\n[other]\nsize = 3\n";
  EXPECT_EQ(parse(file, {"make"}).size, 2);
  EXPECT_EQ(parse(file, {"other"}).other_size, 3);
}

TEST(TomlConfig, NamesWhatItCannotUse) {
  const auto complaint = [](const std::string& toml) -> std::string {
    try {
      parse(toml, {"make"});
      return "none";
    } catch (const CLI::ParseError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(complaint("[make]\nsze = 2\n"), "unknown setting make.sze");
  EXPECT_EQ(complaint("size = 2\n"), "unknown setting size");
  EXPECT_EQ(complaint("[mkae]\nsize = 2\n"), "there is no subcommand for the table [mkae]");
  EXPECT_NE(complaint("[make]\nsize = \n").find("line 2"), std::string::npos);
  EXPECT_NE(complaint("[make]\nsize = 2\nsize = 3\n").find("line 3"), std::string::npos);
  EXPECT_NE(complaint("[make]\nsize = 1979-05-27\n").find("make.size"), std::string::npos);
  EXPECT_NE(complaint("[make]\nlist = [[1]]\n").find("make.list"), std::string::npos);
  EXPECT_NE(complaint("[make]\nsize = 'two'\n").find("size"), std::string::npos);
}

}  // namespace
}  // namespace server::cli
