// Names for results that are kept from one run of a benchmark to the next.
#pragma once

#include <cstdint>
#include <string>

#include "engine/edit/request.h"

namespace engine::evaluate {

/// What a result and its times depend on, beside the request.
struct ResultOf {
  std::string subject;         ///< Name of a case, or "trip".
  std::string corrector;       ///< Name.
  std::string scene, dataset;  ///< Files of a trip.
  int pictures = 0;            ///< Views that are shown beside it.
  int threads = 0;             ///< Threads that it is worked out with.
  std::string simd;            ///< Instruction set.
  std::string lpips;           ///< Identity of the network that judges; empty: none does.
  std::string repainter;       ///< What it knew before it learned (correct::Repainter::state()); empty: there is none.
  std::uint64_t program = 0;   ///< checksum_of_program().
};

/// "slide-scene-" and 16 hexadecimal digits, others where anything that the result depends on is another: the handles,
/// the region, the mode, those parameters that a benchmark varies, or what stands in `of`.
[[nodiscard]] std::string result_key(const ResultOf& of, const edit::Request& request);

/// A checksum of the very program that runs, so that another build works its results out anew. The same number for all
/// where the system does not show a program its own file.
[[nodiscard]] std::uint64_t checksum_of_program();

}  // namespace engine::evaluate
