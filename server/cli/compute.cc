#include "server/cli/compute.h"

#include "engine/core/parallel.h"
#include "engine/render/forward.h"

namespace server::cli {

void add_compute_options(CLI::App& command, ComputeOptions& options) {
  command.add_option("--threads", options.threads, "Threads to compute with; 0: one per core")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  std::string targets;
  for (const std::string& target : engine::render::simd_targets()) targets += (targets.empty() ? "" : ", ") + target;
  command
      .add_option(
          "--simd", options.simd,
          "Instruction set; results are the same bytes for the same one. Here: " + targets + " (default: the first)")
      ->type_name("NAME");
}

Result<void> compute(const ComputeOptions& options, const std::function<Result<void>(const Machine&)>& work) {
  if (!options.simd.empty())
    if (auto pinned = engine::render::pin_simd_target(options.simd); !pinned) {
      pinned.error().where = "--simd";
      return pinned;
    }
  engine::WorkArena arena(options.threads);
  const Machine machine{arena.threads(), engine::render::simd_target()};
  Result<void> done;
  arena.run([&] { done = work(machine); });
  return done;
}

}  // namespace server::cli
