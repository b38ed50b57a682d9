#include "server/cli/options.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <vector>

namespace server::cli {

Result<PictureSize> parse_size(const std::string& text) {
  PictureSize size;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec == std::errc{} && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, size.height);
    const auto fits = [](int side) { return side >= 1 && side <= 16384; };
    if (height.ec == std::errc{} && height.ptr == end && fits(size.width) && fits(size.height)) return size;
  }
  return engine::fail(engine::ErrorCode::invalid_argument,
                      "a picture size is WIDTHxHEIGHT in pixels, each from 1 to 16384, not \"" + text + "\"");
}

CLI::Option* add_triple(CLI::App& command, const std::string& name, std::array<double, 3>& value,
                        const std::string& description) {
  CLI::Option* const option = command.add_option_function<std::vector<double>>(
      name, [&value](const std::vector<double>& given) { std::copy_n(given.begin(), 3, value.begin()); }, description);
  return option->expected(3)->delimiter(',')->type_name("X,Y,Z");
}

std::string environment_name(const std::string& option) {
  std::string name = "SPLATDRAG_";
  for (const char c : option) name += c == '-' ? '_' : char(std::toupper(static_cast<unsigned char>(c)));
  return name;
}

void name_environment(CLI::App& program) {
  for (CLI::Option* option : program.get_options()) {
    const auto& names = option->get_lnames();
    if (!names.empty() && names.front() != "help" && names.front() != "version")
      option->envname(environment_name(names.front()));
  }
  for (CLI::App* command : program.get_subcommands({})) name_environment(*command);
}

}  // namespace server::cli
