// Edits whose right result is known, of scenes that are trained from photographs.
//
// A made-up scene is photographed before the edit and after it. A case knows both scenes, the cameras, what a person
// would ask for, and what really moves. Light is baked into surroundings and moving things apart, so that no shadow of
// what moves stays behind or is missing; it goes along with things, but gloss stays with the light.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/captures/backdrop.h"
#include "engine/captures/moving_part.h"
#include "engine/captures/photographs.h"
#include "engine/captures/plan.h"
#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/edit/request.h"
#include "engine/fit/photo.h"
#include "engine/fit/start.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// What a person would click at to say what moves: points on visible surfaces, noisy. World units.
struct Clicks {
  std::vector<DVec3> inside, outside;
};

/// What one fit is given.
struct Capture {
  std::vector<fit::Photo> photos;
  std::vector<fit::ColoredPoint> points;
};

/// The take that constants are chosen on.
inline constexpr std::uint32_t first_take = 1;

/// One such edit. Rows are indices.
struct CapturedCase {
  std::string name, what, said;     ///< See Plan.
  std::uint32_t take = first_take;  ///< Takes differ in all that chance decides for people: see make_captured_case().
  /// Its figures are reported and never used to choose a constant: those of the engine are chosen on the others.
  bool is_test = false;
  bool textured = true;

  scene::GaussianCloud before, after;      ///< What is photographed.
  std::vector<std::uint32_t> part_before;  ///< Rows of `before` that move; they are the same rows of `after`.
  std::vector<std::uint32_t> part_after;   ///< Those, and rows of `after` that are new.
  std::vector<std::uint32_t> shown;        ///< Rows of `before` that photos before the edit show; ascending.
  MovingPart moving;                       ///< What part_before is, of positions.

  /// Of a case that is drawn into real photos; else null. Its scene is the first rows of `before` and `after`.
  std::shared_ptr<const Backdrop> backdrop;

  std::vector<scene::Camera> cameras;   ///< Of the photos.
  std::vector<scene::Camera> held_out;  ///< Those that judge: no fit sees what they do.
  std::size_t beyond = 0;               ///< So many of those, the last ones, stand outside the orbit of the photos.
  Sensor sensor;
  PointOptions points;

  edit::Mode mode = edit::Mode::move;
  std::vector<edit::Handle> handles;  ///< As a person would place them: on surfaces, noisy. Radii as one would choose.
  std::optional<edit::Region> region;
  Clicks clicks;
  std::optional<Carelessness> careless;  ///< Whoever says what moves is to say it as badly as this.
};

/// Names of all captured cases, in order.
[[nodiscard]] const std::vector<std::string>& captured_case_names();

/// The cases of these names, in that order; all, if no names are given.
///   errors  not_found: no case of that name; the message lists them
[[nodiscard]] Result<std::vector<std::string>> choose_captured_cases(const std::vector<std::string>& names);

/// Makes the case of that name. The same bytes every time, for any number of threads.
///   take    first_take or more. Another take is the same scene and the same wish, but the photos are taken from other
///           places, with other noise and exposures, and the errors of handles and clicks are others.
///   errors  not_found: no case of that name; the message lists them
[[nodiscard]] Result<CapturedCase> make_captured_case(const std::string& name, std::uint32_t take = first_take);

/// The things of the case of that name, drawn into a backdrop: real photos, of which every eighth is held out to judge.
///   errors  as above; those of stand_in(); unprocessable, `where` is "view": too few photos, none is held out
[[nodiscard]] Result<CapturedCase> make_drawn_case(const std::string& name, std::shared_ptr<const Backdrop> backdrop,
                                                   const Stand& stand);

/// Which of the two scenes is photographed. Noise, exposures and points of one have nothing to do with the other's,
/// but in a drawn case, where both sides are the same photos.
enum class Side { before, after };

/// What the camera should show of a scene of the case, without noise; of a case that is drawn into photos, the noise of
/// the photo apart. [3], 0 to 1.
///   camera  one of the case
[[nodiscard]] scene::Image true_photograph(const CapturedCase& the_case, Side side, const scene::Camera& camera);

/// Photographs a scene of the case.
[[nodiscard]] Capture capture(const CapturedCase& the_case, Side side);

}  // namespace engine::captures
