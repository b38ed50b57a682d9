#include <unistd.h>

#include <iostream>

#include "server/cli/program.h"

int main(int argc, char** argv) {
  server::cli::Terminal terminal{std::cout, std::cerr, isatty(STDERR_FILENO) != 0};
  return server::cli::run_program(argc, argv, terminal);
}
