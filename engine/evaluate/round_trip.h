// What can be said of an edit of a real capture, where nobody knows what the edited scene should look like.
// There and back: a drag and the drag that undoes it. What comes back should be what was there.
// Zero drag: handles that stay where they are. What was there should stay, also if it is optimised all the same.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/edit/request.h"
#include "engine/evaluate/measure.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::evaluate {

/// What there_and_back() finds.
struct RoundTrip {
  double arrived = 0;  ///< Fraction of the drag that the half-way scene shows near a handle: the least of all handles.
  RegionQuality inside;   ///< The scene that came back against the input, where the part is or was half-way.
  RegionQuality outside;  ///< The same in all other pixels.
  double seconds = 0;     ///< Time of the way there.
  scene::GaussianCloud halfway, back;
  std::vector<scene::Camera> cameras;  ///< Cameras between those of the edit, at which it is judged.
};

/// Carries the request out, and then the one from where its handles have come to back to where they were.
///   cameras    of the capture, at least two
///   corrector  null: none
///   errors     those of edit::run()
[[nodiscard]] Result<RoundTrip> there_and_back(const scene::GaussianCloud& scene,
                                               std::span<const scene::Camera> cameras, const edit::Request& request,
                                               correct::Corrector* corrector);

/// The request with all targets at their sources, corrected and optimised although nothing moves: how near it stays to
/// the input, in the edit's views within its masks.
///   corrector  null: none
///   errors     those of edit::run()
[[nodiscard]] Result<RegionQuality> zero_drag(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                              const edit::Request& request, correct::Corrector* corrector);

/// A camera half-way between two: position, direction, lens. Name of the first with "+" and that of the second.
[[nodiscard]] scene::Camera between(const scene::Camera& a, const scene::Camera& b);

}  // namespace engine::evaluate
