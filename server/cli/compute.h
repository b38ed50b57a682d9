// Threads and instruction set that a command computes with.
#pragma once

#include <functional>
#include <string>

#include "server/cli/options.h"

namespace server::cli {

/// What the user chose.
struct ComputeOptions {
  int threads = 0;   ///< 0: as many as the machine has cores.
  std::string simd;  ///< Instruction set; empty: the best this processor has.
};

/// Adds --threads and --simd.
void add_compute_options(CLI::App& command, ComputeOptions& options);

/// What a computation ran on.
struct Machine {
  int threads = 0;
  std::string simd;  ///< Name of the instruction set: "AVX2".
};

/// Calls `work` so that all it does in parallel stays on the threads asked for.
///   errors  invalid_argument: an instruction set this machine has not; those of `work`
[[nodiscard]] Result<void> compute(const ComputeOptions& options,
                                   const std::function<Result<void>(const Machine&)>& work);

}  // namespace server::cli
