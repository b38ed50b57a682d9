// Edits whose right result is known: made-up scenes in which a part can be put elsewhere.
//
// A case consists of surroundings and a part, both covered with Gaussians all over, also where nobody looks. The truth
// is both with the part moved. What is edited is both with the part at its first place, without the Gaussians that no
// camera of the capture shows: under an object there is no floor, as in a scene that was trained on photos. Light is
// baked into each of the two alone, so that no shadow of the part stays behind or is missing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/evaluate/judged_view.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::evaluate {

/// One such edit. Rows are indices.
struct Case {
  std::string name;      ///< "slide"
  std::string what;      ///< One sentence for people.
  bool textured = true;  ///< The part uncovers something, and with a pattern: a smooth filling is wrong.

  scene::GaussianCloud before;             ///< What is edited.
  scene::GaussianCloud truth;              ///< What it should become.
  std::vector<std::uint32_t> part;         ///< Rows of `truth` that the edit is about: those moved, those it grew.
  std::vector<std::uint32_t> part_before;  ///< Rows of `before` that should move.
  std::vector<std::uint32_t> part_after;   ///< For each of those, the row of `truth` that it should become.
  std::vector<scene::Camera> cameras;      ///< Cameras of the capture.
  std::vector<scene::Camera> held_out;     ///< Cameras between those; the edit never sees their pictures.
  /// What held-out cameras should show, one for each, where that is known better than by rendering `truth`.
  std::vector<JudgedView> judged;
  edit::Request request;  ///< Handles and mode; parameters are those of a preset or a sweep.
};

/// Names of all cases, in order.
[[nodiscard]] const std::vector<std::string>& case_names();

/// Is the case quick enough for sweeps and for every change of the code? False if there is none of that name.
[[nodiscard]] bool is_small(const std::string& name);

/// The cases of these names, in that order; all cases, if no names are given.
///   small_only  leaves out those that are not small
///   errors      not_found: as make_case(); invalid_argument: nothing is left
[[nodiscard]] Result<std::vector<std::string>> choose_cases(const std::vector<std::string>& names, bool small_only);

/// Makes the case of that name. The same bytes every time, for any number of threads.
///   errors  not_found: no case of that name; the message lists them
[[nodiscard]] Result<Case> make_case(const std::string& name);

}  // namespace engine::evaluate
