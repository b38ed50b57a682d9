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
  std::string by;         ///< How: the name of one of known_grasps().
  edit::Request request;  ///< Without parameters: those are a preset's.
  std::vector<std::uint32_t>
      rows;  ///< Of the trained scene: selected ones, or those in balls that have a target. Ascending.
};

/// Says what moves, from the case (its handles, clicks, carelessness; and its truth only where it says so)
/// and the scene trained from its photos.
using GraspBy = std::function<Result<Grasp>(const CapturedCase& the_case, const scene::GaussianCloud& scene)>;

/// By a ball around each handle, and a box where the case has one. Carelessly: balls too large by a quarter
/// and so far off to one side that about half of the thing is missing.
///   errors  those of deform::assign()
[[nodiscard]] Result<Grasp> grasp_by_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By a ball around each handle and nothing else, as the paper has it, and as well as anybody could choose its size:
/// the radii of the case times the factor whose rows match what moves best (F1, the harmonic mean of recall and
/// precision). Carelessly: those balls, placed as above.
///   errors  those of deform::assign(), where no factor gives every handle a row
[[nodiscard]] Result<Grasp> grasp_by_bare_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By the first of the case's clicks alone, which means the whole (select::Grow::whole), and that many borders wider or
/// narrower that a person who looks at the tint would ask for: of at most three more and three less the one whose rows
/// match what moves best (F1). Carelessly: as clicks.
///   errors  those of select::select() and edit::assign(); invalid_argument: the case has no click inside
[[nodiscard]] Result<Grasp> grasp_by_a_click(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By a selection that grows from the clicks of the case; each of its rows goes with the nearest handle. Carelessly:
/// the selection reaches beyond the thing by so many pixels of a photo, and ends at a plane upright to it through the
/// first handle, so that about half of the thing is missing.
///   errors  those of select::select() and edit::assign()
[[nodiscard]] Result<Grasp> grasp_by_clicks(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By the same, from the clicks of a person who looks where it is wrong, and undoes what makes it worse or corrects it
/// by another click: see looking.h.
///   errors  those of clicks_of_a_looking_person(), select::select() and edit::assign()
[[nodiscard]] Result<Grasp> grasp_by_looking(const CapturedCase& the_case, const scene::GaussianCloud& scene);
[[nodiscard]] Result<Grasp> grasp_by_correcting(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// By masks of three photos, those taken farthest to the left, in the middle and farthest to the right: the true
/// outline of what moves; or that and all pixels within 5 of it. Carelessly: as clicks.
///   errors  those of select::select() and edit::assign()
[[nodiscard]] Result<Grasp> grasp_by_masks(const CapturedCase& the_case, const scene::GaussianCloud& scene);
[[nodiscard]] Result<Grasp> grasp_by_wide_masks(const CapturedCase& the_case, const scene::GaussianCloud& scene);

/// A way to say what moves, by its name.
struct NamedGrasp {
  std::string name;
  GraspBy grasp;
};
/// Those above.
[[nodiscard]] const std::vector<NamedGrasp>& known_grasps();

}  // namespace engine::captures
