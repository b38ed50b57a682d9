// What an edit will cost, before it is done.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/edit/plan.h"
#include "engine/edit/preview.h"
#include "engine/edit/request.h"
#include "engine/io/dataset.h"
#include "engine/scene/camera.h"
#include "engine/scene/overlay.h"
#include "server/edits/speed_log.h"
#include "server/models/models.h"

namespace server::edits {

/// What the cost of an edit as a job depends on.
struct JobWorkload {
  engine::edit::Workload edit = {};
  std::size_t row_bytes = 0;  ///< Of one Gaussian in memory.
  bool layered = false;       ///< The version is an overlay: it is flattened first.
  std::size_t copies = 0;     ///< Deformed copies in the result.
  models::Costs models = {};  ///< Of its networks: their memory; their time is the edit's.
};

/// Those of a dataset, in its order; none without one.
[[nodiscard]] std::vector<engine::scene::Camera> cameras_of(const engine::io::Dataset* dataset);

/// Pixels of a view of pictures with this longer side: of the dataset's cameras, or else of virtual ones.
[[nodiscard]] std::size_t view_pixels_at(int max_image_side, std::span<const engine::scene::Camera> dataset);

/// What estimated_bytes() depends on, and no more: it costs next to nothing, whatever the request asks for.
///   preview, dataset, corrected, pictured  as of workload_of()
[[nodiscard]] JobWorkload memory_workload_of(const engine::scene::LayeredCloud& version,
                                             const engine::edit::Request& request,
                                             const engine::edit::PreviewOutcome& preview,
                                             std::span<const engine::scene::Camera> dataset, bool corrected,
                                             int pictured);

/// Looks at the scene and the machine: renders a few frames, unless the log knows them.
///   request    with the scene's own `up`
///   preview    of that request
///   dataset    its cameras; none: a few of the virtual ones are found, of which the edit will find all
///   corrected  by a corrector
///   pictured   views with intermediate pictures, at most
///   scene      its id: what the log knows its frames by
[[nodiscard]] JobWorkload workload_of(const engine::scene::LayeredCloud& version, const engine::edit::Request& request,
                                      const engine::edit::PreviewOutcome& preview,
                                      std::span<const engine::scene::Camera> dataset, bool corrected, int pictured,
                                      const std::string& scene, SpeedLog& log);

/// Adds what networks take, if there are some.
void add_models(JobWorkload& work, const models::Costs& costs);

/// Bytes that workload_of() takes for a while, about: those of one frame, as of estimated_bytes().
///   work  of this request; memory_workload_of() is enough
[[nodiscard]] std::uint64_t measuring_bytes(const JobWorkload& work);

/// Seconds of what a job does beside the edit: before it, to read the request and put the version together, and after
/// it, until the result is on disk as a version.
///   gaussians  of the version that is edited
[[nodiscard]] double seconds_to_load(std::size_t gaussians, bool layered);
[[nodiscard]] double seconds_to_publish(std::size_t gaussians);

/// Seconds, about, with the machine to itself: the engine's plan, and what the job does before and after it. It says
/// nothing of the time an edit waits for others.
[[nodiscard]] double estimated_seconds(const JobWorkload& work);

/// Bytes beside the scene as the service holds it, all of them given back at the end:
///     row_bytes ([layered] N                    the version as one cloud
///                + N + T copies                 the working scene
///                + N + copies)                  the scene of a picture, as long as it is rendered
///   + 200 N                                     splats of a frame, columns of the working scene
///   + V pixels + 32 pixels                      masks; one frame
///   + V 36 pixels [iterations]                  of each view, while it optimises: three pictures, at most
///   + min(V 24 N, frozen_memory) [iterations]   frozen splats of the views' regions, of 48 bytes, which are half of
///                                               them where the edit is large
///   + V 30 pixels [corrected]                   of each view: the unedited scene and its depth, what was vacated and
///                                               must not be learned from, and what it was corrected to
///   + (row_bytes + 100) N [corrected]           the unedited scene, its trust, and a search tree of it
///   + V (52 + 6 (T + 1)) pixels [repainted]     of each view: what was completed, is painted and was painted; the
///                                               history, once more as it is written down
///   + network bytes                             of the repainter and of the perceptual loss
///   + max(painting, learning, pixels perceptual)  what they compute, of which there is one at a time; `learning` where
///                                               something is learned
[[nodiscard]] std::uint64_t estimated_bytes(const JobWorkload& work);

}  // namespace server::edits
