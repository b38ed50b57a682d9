#include "server/cli/program.h"

#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <string>

#include "server/cli/commands.h"
#include "server/cli/exit_status.h"
#include "server/cli/toml_config.h"

namespace server::cli {
namespace {

using engine::Error;
using engine::ErrorCode;

int report(const Error& error, Terminal& terminal) {
  terminal.err << error_line(error) << '\n';
  return exit_status(error.code);
}

/// The settings file is read before CLI11 looks at the environment, so its own variable is asked for here.
std::string settings_file_in_environment() {
  const char* const value = std::getenv(environment_name("config").c_str());
  return value == nullptr ? "" : value;
}

void describe(CLI::App& program, Action& action) {
  program.name("splatdrag");
  program.option_defaults()->always_capture_default();
  program.set_version_flag("--version", SPLATDRAG_VERSION);
  program.set_help_flag("-h,--help", "Print this help");
  program.require_subcommand(1);
  program.fallthrough();  // --config may stand after the subcommand, too
  program.set_config("--config", settings_file_in_environment(), "Settings file (TOML, a table per subcommand)")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  program.config_formatter(std::make_shared<TomlConfig>(program));
  program.allow_config_extras(CLI::config_extras_mode::error);
  const std::string sources =
      "Each option can also be given as an environment variable (--max-side: SPLATDRAG_MAX_SIDE) or in the settings\n"
      "file that --config names (max-side = 512 below [render]). The command line comes first, then the environment,\n"
      "then the file.\n";
  program.footer(sources + "See splatdrag --help for the exit status.");  // of the subcommands, which inherit it
  add_serve_command(program, action);
  add_edit_command(program, action);
  add_select_command(program, action);
  add_fit_command(program, action);
  add_render_command(program, action);
  add_info_command(program, action);
  add_models_command(program, action);
  add_convert_command(program, action);
  add_demo_scene_command(program, action);
  add_admin_command(program, action);
  add_bench_edit_command(program, action);
  program.footer(sources + exit_status_help());
  name_environment(program);
}

/// What is wrong with the command line, as an error of ours.
Error usage_error(const CLI::App& program, const CLI::ParseError& error) {
  std::string message = error.what();
  if (program.get_subcommands().empty() && !dynamic_cast<const CLI::ConfigError*>(&error)) {
    const auto words = program.remaining();
    message = words.empty() ? "a subcommand is required:" : "\"" + words.front() + "\" is no subcommand; there are";
    for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
      message += " " + command->get_name();
  }
  return {ErrorCode::invalid_argument, message + "; see splatdrag --help", ""};
}

int run_unguarded(int argc, const char* const* argv, Terminal& terminal) {
  Action action;
  CLI::App program("Edits trained 3D Gaussian Splatting scenes by dragging points.");
  describe(program, action);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error, terminal.out, terminal.err);  // --help, --version
    return report(usage_error(program, error), terminal);
  }
  const Result<void> done = action(terminal);
  return done ? 0 : report(done.error(), terminal);
}

}  // namespace

int run_program(int argc, const char* const* argv, Terminal& terminal) {
  try {
    return run_unguarded(argc, argv, terminal);
  } catch (const std::bad_alloc&) {
    return report({ErrorCode::too_large, "this machine has not enough memory for that", ""}, terminal);
  } catch (const std::exception& bug) {
    return report({ErrorCode::internal, std::string("unexpected: ") + bug.what() + "; please report this", ""},
                  terminal);
  }
}

}  // namespace server::cli
