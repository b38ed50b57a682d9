// The parameters as text for a terminal.
#pragma once

#include <string>

namespace engine::params {

/// What a request can set, two or three lines each: name, values and unit; the sentence; defaults by preset. Ends
/// without a line break.
[[nodiscard]] std::string listing();

}  // namespace engine::params
