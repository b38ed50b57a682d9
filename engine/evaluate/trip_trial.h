// A drag of a capture there and back, carried out by a corrector and judged, as a benchmark does it.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/evaluate/measure.h"
#include "engine/evaluate/round_trip.h"
#include "engine/evaluate/trial.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::evaluate {

/// What there_and_back() and zero_drag() came to.
struct TripTrial {
  std::string request;    ///< Name, where its file holds several.
  std::string corrector;  ///< Name.
  double arrived = 0;     ///< See RoundTrip, here and below.
  RegionQuality inside, outside;
  RegionQuality zero_drag;
  std::size_t cameras = 0;  ///< Cameras at which it was judged.
  double seconds = 0;       ///< Time of the way there.
};

/// Carries both out. Shows the input, half-way, and what came back side by side, as "trip_scene_0".
///   cameras  of the capture, at least two
///   count    cameras to show, fewer where fewer are judged at
///   errors   those of edit::run() and of `show`
[[nodiscard]] Result<TripTrial> carry_out_trip(const scene::GaussianCloud& input,
                                               std::span<const scene::Camera> cameras, const edit::Request& request,
                                               const std::string& corrector, std::size_t count, const Show& show);

/// Input, half-way, and what came back, at one camera.
[[nodiscard]] scene::Image trip_picture(const scene::GaussianCloud& input, const RoundTrip& trip,
                                        const scene::Camera& camera);

/// One line for people, with its end.
[[nodiscard]] std::string summary(const TripTrial& trial);

}  // namespace engine::evaluate
