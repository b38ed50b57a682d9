// How a request says what moves: the one place where a captured case meets a way to select.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// What is asked for, and what that takes along.
struct Grasp {
  std::string by;                   ///< How: "balls", "clicks", "looking".
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

/// By a selection that grows from the clicks of the case; each of its rows goes with the nearest handle. Carelessly:
/// the selection reaches beyond the thing by so many pixels of a photo, and ends at a plane upright to it through the
/// first handle, so that about half of the thing is missing.
///   errors  those of select::select() and edit::assign()
[[nodiscard]] Result<Grasp> grasp_by_clicks(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By the same, from the clicks of a person who looks where it is wrong: see looking.h.
///   errors  those of clicks_of_a_looking_person(), select::select() and edit::assign()
[[nodiscard]] Result<Grasp> grasp_by_looking(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// A way to say what moves, by its name.
struct NamedGrasp {
  std::string name;
  GraspBy grasp;
};
/// Those above.
[[nodiscard]] const std::vector<NamedGrasp>& known_grasps();

}  // namespace engine::captures
