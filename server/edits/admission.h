// Whether an edit may have the memory and the time that it will need.
#pragma once

#include <cstdint>
#include <span>

#include "engine/core/result.h"
#include "engine/params/params.h"
#include "engine/scene/camera.h"
#include "server/edits/estimate.h"

namespace server::edits {

/// Holds the estimate of an edit's memory against what one may take: an edit that ends the process would be resumed by
/// the next one, and end that.
///   work     of these parameters; memory_workload_of() is enough
///   dataset  its cameras; none: virtual ones
///   limit    bytes; 0: none
///   errors   too_large: the message says how far to lower which parameter, and `where` is it, "params.views" or
///            "params.max_image_side"; "scene" where no value of the two would do
[[nodiscard]] engine::Result<void> admit(const JobWorkload& work, const engine::params::Params& params,
                                         std::span<const engine::scene::Camera> dataset, std::uint64_t limit);

/// Holds the estimate of an edit's time against what one may take: others wait for it.
///   work     of these parameters, from workload_of()
///   limit    seconds; 0: none
///   errors   too_large: as above, of "params.iterations", "params.annealing_steps", "params.intervals", "params.views"
///            and "params.max_image_side"
[[nodiscard]] engine::Result<void> admit_time(const JobWorkload& work, const engine::params::Params& params,
                                              std::span<const engine::scene::Camera> dataset, double limit);

}  // namespace server::edits
