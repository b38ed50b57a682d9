// Scenes trained from photographs, as `splatdrag fit` trains them, and a folder in which they are kept: a fit takes
// half a minute, and most runs of a benchmark need the same ones again.
#pragma once

#include <cstdint>
#include <filesystem>

#include "engine/captures/captured_case.h"
#include "engine/core/result.h"
#include "engine/fit/options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// The fits of captured cases. 1,500 iterations of 30 photos at 320x240 take about 20 s of processor time.
/// A third of that costs the ceiling 5 dB of the edited region (cases mug and clutter), twice as many add 0.3 dB (mug).
[[nodiscard]] fit::FitOptions training_options(int iterations = 1500);

/// A trained scene.
struct Trained {
  scene::GaussianCloud cloud;  ///< Of SH degree 3.
  std::uint64_t key = 0;       ///< key_of() of what it was trained from.
  double seconds = 0;          ///< That the fit took, on the machine that did it.
  bool was_kept = false;       ///< It was in the folder.
};

/// A number that another fit hardly has: one of other photos or points, with other options, another instruction set, or
/// a program that fits otherwise. The last is found out by a fit of a few iterations.
///   errors  those of a fit
[[nodiscard]] Result<std::uint64_t> key_of(const Capture& capture, const fit::FitOptions& options);

/// Trains a scene, or reads it from the folder where an earlier call has left it; a file there that is damaged or of
/// another fit is replaced. The same bytes for any number of threads.
///   folder  exists
///   errors  invalid_argument: options; unprocessable: there are no photos or no points; internal: see
///           fit::Fitter::step(); those of engine::write_file()
[[nodiscard]] Result<Trained> trained(const Capture& capture, const fit::FitOptions& options,
                                      const std::filesystem::path& folder);

}  // namespace engine::captures
