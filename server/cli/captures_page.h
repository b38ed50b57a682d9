// docs/captures.md: what `splatdrag bench-edit --captures` has found, for people.
#pragma once

#include <span>
#include <string>

#include "engine/captures/capture_trial.h"
#include "server/cli/compute.h"

namespace server::cli {

struct BenchOptions;

/// The page, in Markdown: how the figures come about, the table, means of the two sets, the cases. It names the command
/// that writes it, and the cases that are missing.
[[nodiscard]] std::string captures_page(std::span<const engine::captures::CaptureTrial> trials,
                                        const BenchOptions& options, const Machine& machine);

}  // namespace server::cli
