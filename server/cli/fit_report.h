// report.json: what a fit did, for programs; `splatdrag fit` writes it beside the scene.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "engine/fit/checkpoint.h"
#include "engine/fit/fitter.h"
#include "engine/fit/options.h"
#include "server/cli/compute.h"

namespace server::cli {

/// What the report says.
struct FitReport {
  Machine machine;
  engine::fit::FitOptions options;
  int max_side = 0;       ///< Longer side of the photos, pixels.
  int hold_out = 0;       ///< One view in so many is held out; 0: none.
  std::size_t views = 0;  ///< Views that were trained on.
  std::size_t start_gaussians = 0, gaussians = 0;
  engine::fit::History history;
  engine::fit::FitQuality training;
  std::optional<engine::fit::FitQuality> held_out;
};

/// The file report.json.
[[nodiscard]] std::string to_json(const FitReport& report);

}  // namespace server::cli
