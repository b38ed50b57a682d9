// What an edit has before it: what its request says of the work, and measurements made before it begins: a few frames,
// and a look at where its part is.
#pragma once

#include <cstdint>
#include <span>

#include "engine/edit/plan.h"
#include "engine/edit/request.h"
#include "engine/edit/state.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::edit {

/// Renders a few frames through the camera in the middle. Takes about ten of the smallest ones.
///   cameras         of which views are chosen; none: nothing is measured
///   max_image_side  of the pictures the edit works on, pixels
[[nodiscard]] FrameTime measured_frames(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                        int max_image_side);

/// How many times longer this machine, as it is now, takes than the one where a plan's figures were measured: by a
/// little scene that is the same everywhere. Takes some milliseconds.
[[nodiscard]] double measured_slowness();

/// The part of a picture, 0 to 1, that the box around these rows takes: mean over some of the cameras, found from some
/// of the rows. Takes less than a frame.
[[nodiscard]] double covered_part(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows,
                                  std::span<const scene::Camera> cameras);

/// Pixels of one view as the edit works on it: mean over the cameras.
[[nodiscard]] std::size_t view_pixels(std::span<const scene::Camera> cameras, int max_image_side);

/// What a request says of the work, before anything is looked at.
///   gaussians  of the scene
///   corrected  by a corrector
[[nodiscard]] Workload workload_of(std::size_t gaussians, const Request& request, bool corrected);

/// The same once the dragged part is found, and cameras that may look at it: measured.
///   candidates  of which views are chosen, or were
[[nodiscard]] Workload measured(Workload work, const State& state, const scene::GaussianCloud& input,
                                std::span<const scene::Camera> candidates, const Params& params);

/// Memory of what the repair keeps of what cameras saw of the unedited scene, at most. Bytes.
[[nodiscard]] std::uint64_t witness_bytes(const Workload& work);

}  // namespace engine::edit
