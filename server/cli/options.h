// Command-line options that several subcommands share, and how options get their environment variables.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <functional>
#include <optional>
#include <string>

#include "engine/core/result.h"
#include "server/cli/terminal.h"

namespace server::cli {

using engine::Result;

/// What a subcommand does once the command line is read. It prints what it has to say; errors it hands back.
using Action = std::function<Result<void>(Terminal&)>;

/// A picture size on the command line: "640x480".
struct PictureSize {
  int width = 0, height = 0;
  bool operator==(const PictureSize&) const = default;
};
/// Reads a picture size.
///   errors  invalid_argument: not WIDTHxHEIGHT, or a side outside 1 to 16384
[[nodiscard]] Result<PictureSize> parse_size(const std::string& text);

/// An option that takes three numbers, "0.5,0,-1".
CLI::Option* add_triple(CLI::App& command, const std::string& name, std::array<double, 3>& value,
                        const std::string& description);

/// The environment variable of an option: "--max-side" is SPLATDRAG_MAX_SIDE, in every subcommand.
[[nodiscard]] std::string environment_name(const std::string& option);

/// Gives every long option of the program and of its subcommands its environment variable (not --help, --version).
void name_environment(CLI::App& program);

}  // namespace server::cli
