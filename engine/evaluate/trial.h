// A case carried out by a corrector and judged, as a benchmark does it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/correct/repainter.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"
#include "engine/evaluate/cases.h"
#include "engine/evaluate/measure.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::evaluate {

/// The corrector of that name: "scene", or "harmonic", the baseline. Null for any other: none.
[[nodiscard]] std::unique_ptr<correct::Corrector> corrector_named(const std::string& name);

/// What an edit of a case came to, and what it took.
struct Trial {
  std::string name;  ///< Case::name and, below, Case::what.
  std::string what;
  std::string corrector;                ///< Name.
  bool textured = true;                 ///< See Case.
  std::size_t gaussians = 0, part = 0;  ///< Of the scene; of the part that moves.
  std::size_t seeds = 0;                ///< Seeds that the repair has placed.
  double uncovered = 0, open = 0;       ///< Of the edit's views in sum, fractions of a picture. See edit::Uncovered.
  int intervals = 0;                    ///< T of the edit.
  Quality untouched;                    ///< Quality of the scene before the edit: what doing nothing would come to.
  Quality result;                       ///< Quality of the edited scene.
  std::optional<double> untouched_lpips, lpips;  ///< perceptual_distance() of both, if there was a network for it.
  Agreement corrected_views;                     ///< Agreement of the views of the last correction.
  double seconds = 0;                            ///< Time of all stages.
  std::vector<edit::StageTime> stages;           ///< Without pictures that only the judge asked for.
  std::uint64_t peak_memory_bytes = 0;           ///< Above what the process held before; without what the judge took.
  std::vector<std::string> warnings;
};

/// A trial and the scene that it led to.
struct CarriedOut {
  Trial trial;
  scene::GaussianCloud edited;
};

/// Edits the case and judges what comes of it.
///   request    that of the case, with the parameters to try
///   corrector  by its name; of a repainter, which comes after `scene`, that of the repainter
///   lpips      judges, too, and is the edit's loss if that is what its parameters say; null: neither
///   repainter  one that has learned nothing yet; null: there is none
///   errors     those of edit::run(), of `lpips` and of `repainter`
[[nodiscard]] Result<CarriedOut> carry_out(const Case& the_case, const edit::Request& request,
                                           const std::string& corrector, optim::PerceptualLoss* lpips = nullptr,
                                           correct::Repainter* repainter = nullptr);

/// Takes in a picture to look at, under the name of its file without an extension.
using Show = std::function<Result<void>(const std::string& name, const scene::Image& picture)>;

/// Shows what an edit of a case came to, at its first held-out views: see comparison().
///   count   views to show, fewer where the case has fewer
///   errors  those of edit::run() and of `show`
[[nodiscard]] Result<void> show_pictures(const Case& the_case, const edit::Request& request,
                                         const std::string& corrector, const scene::GaussianCloud& edited,
                                         std::size_t count, const Show& show);

/// The head of a table of trials in Markdown, and a trial's row of it, each with its line's end.
[[nodiscard]] std::string trial_table_head();
[[nodiscard]] std::string trial_table_row(const Trial& trial);

}  // namespace engine::evaluate
