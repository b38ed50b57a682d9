// The settings file: TOML, a table per subcommand.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace server::cli {

/// Reads settings for `program`: `threads = 2` in a table [edit] is --threads of the subcommand edit. A key is an
/// option's long name. A setting whose environment variable is set is left out, because the environment outranks the
/// file (CLI11 by itself has it the other way round).
///   errors  CLI::ConfigError: no TOML (with line and column), a key that names no option, a value that no option takes
class TomlConfig final : public CLI::Config {
 public:
  explicit TomlConfig(const CLI::App& program) : program_(program) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;
  /// The settings in use are not written anywhere.
  std::string to_config(const CLI::App*, bool, bool, std::string) const override { return {}; }

 private:
  const CLI::App& program_;
};

}  // namespace server::cli
