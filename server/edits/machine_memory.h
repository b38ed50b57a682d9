// How much memory this process may use.
#pragma once

#include <cstdint>
#include <filesystem>

namespace server::edits {

/// The limit that the process was started with (ulimit -v); the largest number where there is none.
[[nodiscard]] std::uint64_t address_space_limit();

/// Bytes: what the machine has, or less where a control group of this process or one above it (version 1 or 2) or
/// `address_space` allows less. 0 where nobody says.
///   root  what /proc and /sys are below
[[nodiscard]] std::uint64_t memory_of_machine(const std::filesystem::path& root = "/",
                                              std::uint64_t address_space = address_space_limit());

/// What an edit may take unless somebody says otherwise: half of it. The other half is for scenes and renders. 0, which
/// limits nothing, where nobody says how much there is.
[[nodiscard]] inline std::uint64_t usual_edit_memory() { return memory_of_machine() / 2; }

/// What renders and the reading of uploads may take together unless somebody says otherwise: half of the other half. 0
/// as above.
[[nodiscard]] inline std::uint64_t usual_work_memory() { return memory_of_machine() / 4; }

}  // namespace server::edits
