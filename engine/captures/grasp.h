// How a request says what moves. The one place where a captured case meets a way to select: today balls around
// handles; whoever selects otherwise gives another function.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// What is asked for, and what that takes along.
struct Grasp {
  edit::Request request;            ///< Without parameters: those are a preset's.
  std::vector<std::uint32_t> rows;  ///< Rows of the trained scene that follow a handle with a target; ascending.
};

/// Says what moves, from the case (its handles, clicks, carelessness; never its truth) and the scene trained from its
/// photos.
using GraspBy = std::function<Result<Grasp>(const CapturedCase& the_case, const scene::GaussianCloud& scene)>;

/// By a ball around each handle, and a box where the case has one. Carelessly: balls too large by a quarter
/// and so far off to one side that about half of the thing is missing.
///   errors  those of deform::assign()
[[nodiscard]] Result<Grasp> grasp_by_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene);

}  // namespace engine::captures
