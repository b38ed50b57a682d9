// Memory of a process, and measurements that want one to themselves.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace bench {

/// A field of /proc/self/status, MB.
inline double memory_mb(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(field + ":")) return std::stod(line.substr(field.size() + 1)) / 1024;
  throw std::runtime_error("no " + field + " in /proc/self/status");
}

/// Starts the peak (VmHWM) anew.
inline void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

/// What `measure` returns in a child process: peaks do not add up, and nothing is warm. Only for a caller that has not
/// started any thread.
template <class Measured>
Measured in_own_process(const std::function<Measured()>& measure) {
  static_assert(std::is_trivially_copyable_v<Measured> && sizeof(Measured) <= 4096, "it goes through a pipe at once");
  int channel[2];
  if (pipe(channel) != 0) throw std::runtime_error("pipe failed");
  const pid_t child = fork();
  if (child == 0) {
    try {
      const Measured result = measure();
      _exit(write(channel[1], &result, sizeof result) == sizeof result ? 0 : 1);
    } catch (const std::exception& e) {
      std::fprintf(stderr, "%s\n", e.what());
      _exit(1);
    }
  }
  close(channel[1]);
  Measured result{};
  const bool good = child > 0 && read(channel[0], &result, sizeof result) == sizeof result;
  int status = 0;
  waitpid(child, &status, 0);
  close(channel[0]);
  if (!good || status != 0) throw std::runtime_error("a measurement failed");
  return result;
}

}  // namespace bench
