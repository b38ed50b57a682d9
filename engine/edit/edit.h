// The drag edit, step by step (paper, section 3; here: deformation guidance, masks, views, intervals, relocation).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::edit {

/// What is known about one handle once the edit has looked at the scene.
struct HandleReport {
  std::size_t gaussians = 0;     ///< |P_h^i| at the start.
  std::vector<DVec3> relocated;  ///< Position after each interval, world units. An anchor stays where it is.
};

/// One view the edit looks through.
struct ViewReport {
  std::string name;
  double mask_area = 0;  ///< Union of its 2D masks over all intervals, fraction of the picture, 0..1.
};

/// Wall time of one stage, seconds.
struct StageTime {
  std::string stage;
  double seconds = 0;
};

/// Everything a user may want to know afterwards.
struct Report {
  Params resolved;  ///< With every default filled in (intervals is never 0 here).
  std::vector<HandleReport> handles;
  std::vector<ViewReport> views;
  std::size_t input_gaussians = 0;
  std::size_t output_gaussians = 0;
  std::size_t changeable = 0;  ///< Size of the 3D mask M at the end.
  std::size_t copies = 0;      ///< Deformed copies in the output.
  std::size_t removed = 0;     ///< Input rows that are not in the output.
  std::vector<std::string> warnings;
  std::vector<StageTime> times;
};

/// Where a running edit is.
struct Progress {
  int interval = 0;  ///< 1..intervals; 0 before the first.
  int intervals = 0;
  std::string stage;    ///< "assign", "views", "deform", "mask", "relocate", "finish"
  double fraction = 0;  ///< Of the whole edit, 0..1, never falls.
};

/// One interval is finished.
struct IntervalDone {
  int interval = 0;
  int intervals = 0;
  const scene::GaussianCloud& cloud;  ///< The scene as it would be published if the user stopped here.
};

/// How an edit talks to whoever runs it. All are optional.
struct Observer {
  std::function<void(const Progress&)> progress;
  std::function<void(const IntervalDone&)> interval_done;
  std::stop_token stop;  ///< Asked between stages: the edit then ends with ErrorCode::cancelled.
};

struct Outcome {
  scene::GaussianCloud cloud;         ///< Surviving input rows in input order, then new rows.
  std::vector<std::uint32_t> parent;  ///< [N_out] row of the input each row comes from (itself, if it survived).
  std::size_t survivors = 0;          ///< The first so many rows are input rows, in input order.
  std::vector<scene::Camera> views;   ///< Those chosen, best first, scaled to params.max_image_side.
  std::vector<scene::Mask> masks;     ///< Per chosen view, in its size: union over intervals.
  Report report;
};

/// Runs an edit.
///   scene    not changed
///   cameras  the dataset's; empty: virtual ones are made
///   errors   invalid_argument (validate; a camera: `where` is "cameras[3].fx"), unprocessable (a handle without
///   Gaussians: `where` names it), cancelled
/// A drag that moves nothing gives the scene back, byte for byte.
/// Deterministic: same inputs, same bytes, for any number of threads.
[[nodiscard]] Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                  const Request& request, const Observer& observer = {});

}  // namespace engine::edit
