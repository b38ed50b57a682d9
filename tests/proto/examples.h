// The example payloads of proto/, which are also the tests' fixtures.
#pragma once

#include <string>

#include "tests/support/data.h"

namespace proto {

inline std::string example(const std::string& name) {
  return support::read_file(support::source_dir() / "proto/examples" / name);
}

}  // namespace proto
