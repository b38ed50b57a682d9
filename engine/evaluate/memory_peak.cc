#include "engine/evaluate/memory_peak.h"

#include <algorithm>
#include <fstream>
#include <string>

#include "engine/core/numbers.h"

namespace engine::evaluate {
namespace {

/// A field of /proc/self/status in bytes, 0 where there is no such file: "VmHWM:	   12345 kB".
std::uint64_t status_bytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (!line.starts_with(field + ":")) continue;
    const std::size_t first = line.find_first_of("0123456789");
    if (first == std::string::npos) return 0;
    const std::size_t last = line.find_first_not_of("0123456789", first);
    return 1024 * number_in<std::uint64_t>(line.substr(first, last - first)).value_or(0);
  }
  return 0;
}

}  // namespace

MemoryPeak::MemoryPeak() {
  forget();
  start_ = status_bytes("VmRSS");
}

void MemoryPeak::note() { highest_ = std::max(highest_, status_bytes("VmHWM")); }

void MemoryPeak::forget() { std::ofstream("/proc/self/clear_refs") << "5"; }

}  // namespace engine::evaluate
