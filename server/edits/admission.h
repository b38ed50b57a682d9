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
///   errors   too_large: the message says how far to lower which parameter, or which networks to do without, and
///            `where` is the first: "params.views", "params.max_image_side", "params.perceptual", "params.tuning_steps"
///            or "params.corrector"; "scene" where nothing would do
[[nodiscard]] engine::Result<void> admit(const JobWorkload& work, const engine::params::Params& params,
                                         std::span<const engine::scene::Camera> dataset, std::uint64_t limit);

/// Holds the estimate of an edit's time against what one may take: others wait for it.
///   work     of these parameters, from workload_of()
///   limit    seconds; 0: none
///   errors   too_large: as above, of "params.iterations", "params.annealing_steps", "params.intervals", too, and where
///            a diffusion model works of "params.tuning_steps_later" and "params.sampling_steps"
[[nodiscard]] engine::Result<void> admit_time(const JobWorkload& work, const engine::params::Params& params,
                                              std::span<const engine::scene::Camera> dataset, double limit);

/// So long networks may work for an edit that does not say it may take longer. Seconds; a choice: who has no
/// GPU does not expect more than an hour, and others wait for it.
constexpr double slow_seconds = 3600;

/// Holds the estimated time of an edit with networks, a diffusion model or LPIPS, against that.
///   work     from workload_of() and add_models()
///   allowed  it may take longer
///   errors   unprocessable: it would take longer; the message says how long, and `where` is "allow_slow"
[[nodiscard]] engine::Result<void> admit_slow(const JobWorkload& work, bool allowed);

}  // namespace server::edits
