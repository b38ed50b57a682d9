// What a fuzz target is: something that is done with bytes from a stranger, and where to begin.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/memory_budget.h"
#include "engine/io/read_options.h"

namespace fuzz {

/// Each target defines these two. A crash, a sanitizer's report, an uncaught exception and demand() are findings; so is
/// whatever takes longer, or more memory, than the limits of tests/fuzz.sh.
void run(std::span<const std::byte> bytes);
/// Small inputs that are whole, from the project's own writers: what mutations begin with.
std::vector<std::string> seeds();

/// What must hold of whatever a reader accepts.
inline void demand(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "demanded: %s\n", what);
  std::abort();
}

inline std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
inline std::string text_of(const std::vector<std::byte>& bytes) { return std::string(text_of(std::span(bytes))); }

/// Limits that keep an input's run short, with a budget that is counted.
inline engine::io::ReadOptions small_limits() {
  static engine::MemoryBudget budget(std::uint64_t{256} << 20);
  engine::io::ReadOptions options;
  options.max_gaussians = 1 << 15;
  options.max_memory_bytes = std::uint64_t{64} << 20;
  options.memory = &budget;
  return options;
}

}  // namespace fuzz
