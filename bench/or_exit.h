// How a benchmark ends where something fails: with the error, for whoever started it.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "engine/core/result.h"

namespace bench {

[[noreturn]] inline void exit_with(const engine::Error& error) {
  std::fprintf(stderr, "error: %s (%s)\n", error.message.c_str(), error.where.c_str());
  std::exit(1);
}

template <class T>
T or_exit(engine::Result<T> result) {
  if (!result) exit_with(result.error());
  return std::move(*result);
}
inline void or_exit(const engine::Result<void>& result) {
  if (!result) exit_with(result.error());
}

}  // namespace bench
