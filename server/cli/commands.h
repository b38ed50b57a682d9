// The subcommands. Each function adds one to the program; when it is chosen on the command line, `action` is set.
#pragma once

#include "server/cli/options.h"

namespace server::cli {

void add_serve_command(CLI::App& program, Action& action);
void add_edit_command(CLI::App& program, Action& action);
void add_select_command(CLI::App& program, Action& action);
void add_fit_command(CLI::App& program, Action& action);
void add_render_command(CLI::App& program, Action& action);
void add_info_command(CLI::App& program, Action& action);
void add_models_command(CLI::App& program, Action& action);
void add_convert_command(CLI::App& program, Action& action);
void add_admin_command(CLI::App& program, Action& action);
void add_bench_edit_command(CLI::App& program, Action& action);
void add_demo_scene_command(CLI::App& program, Action& action);

}  // namespace server::cli
