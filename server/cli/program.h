// The program: command line in, exit status out.
#pragma once

#include "server/cli/terminal.h"

namespace server::cli {

/// Runs splatdrag. Options come from the command line, else from SPLATDRAG_... in the environment, else from the
/// settings file, else from their defaults.
///   returns  the exit status, see exit_status.h; what went wrong is one line on terminal.err
[[nodiscard]] int run_program(int argc, const char* const* argv, Terminal& terminal);

}  // namespace server::cli
