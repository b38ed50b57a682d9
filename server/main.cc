#include <unistd.h>

#include <iostream>

#include "server/program.h"

int main(int argc, char** argv) {
  server::Terminal terminal{std::cout, std::cerr, isatty(STDERR_FILENO) != 0};
  return server::run_program(argc, argv, terminal);
}
