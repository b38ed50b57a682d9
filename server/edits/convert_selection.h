// Conversion between a selection on the wire and the one that the engine carries out: for the program and the service
// alike.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/select.h"
#include "proto/selection.h"

namespace server::edits {

/// What the views and the cameras of a selection refer to.
struct Viewpoints {
  std::span<const engine::scene::Camera> views;  ///< Of the scene's dataset; none without one.
  engine::DVec3 up{0.0, -1.0, 0.0};              ///< For cameras that say nothing of it.
};

/// The same selection with a pinhole camera in place of each view and camera: it says all there is to say.
///   errors  not_found: no such view, or no dataset to have views; invalid_argument: a camera without direction.
///           `where` is such as "selection[2].polygon.view"
[[nodiscard]] engine::Result<proto::Selection> with_cameras(proto::Selection selection, const Viewpoints& viewpoints);

/// The engine's selection, its masks decoded.
///   selection  as with_cameras() gives it
///   errors     invalid_argument: a mask of another size than its camera's; too_large: more pixels of masks than are
///              held at a time; those of io::decode_image(). `where` is such as "selection[2].masks[0].image"
[[nodiscard]] engine::Result<engine::select::Selection> to_engine(const proto::Selection& selection);

/// What it selects of a scene.
///   selection  as with_cameras() gives it
///   errors     those of to_engine() and of select::select()
[[nodiscard]] engine::Result<engine::select::Selected> carry_out(const engine::scene::GaussianCloud& cloud,
                                                                 const proto::Selection& selection);

/// Pixels of all masks of a selection together: 128 MB. A choice.
constexpr std::size_t max_mask_pixels = std::size_t{1} << 27;

/// Its warnings, one sentence each: "selection[2]: the sphere names no Gaussian".
[[nodiscard]] std::vector<std::string> warnings_of(const engine::select::Selected& selected);

/// Its cameras: the views that whoever made it looked through.
///   selection  as with_cameras() gives it
[[nodiscard]] std::vector<engine::scene::Camera> cameras_in(const proto::Selection& selection);

/// select::shown_shares() of what is selected.
using ShownShares = std::function<std::vector<double>(const std::vector<engine::scene::Camera>& views)>;

/// Says in a request what moves: the rows, and how far handles grip that say nothing of it (see
/// edit::give_radii()).
///   cameras  from which it may be looked at
///   returns  warnings, one sentence each: those of the selection; and that it takes more than most_of_a_view of what
///            is seen where a handle is
[[nodiscard]] std::vector<std::string> hand_over(const engine::select::Selected& selected,
                                                 std::span<const engine::scene::Camera> cameras,
                                                 const ShownShares& shown_shares, engine::edit::Request& request);
constexpr double most_of_a_view = 0.9;

/// An error or a warning of the selection that is to be healed, which has an address of its own: "heal[2].sphere".
[[nodiscard]] engine::Error about_healing(engine::Error error);

/// Says in a request what is made anew.
///   returns  warnings, one sentence each
///   errors   unprocessable: there is none of it; `where` is "heal"
[[nodiscard]] engine::Result<std::vector<std::string>> hand_over_healed(const engine::select::Selected& selected,
                                                                        engine::edit::Request& request);

/// with_cameras(), to_engine() and hand_over_healed(), one after the other, on a scene.
[[nodiscard]] engine::Result<std::vector<std::string>> heal_rows(const engine::scene::GaussianCloud& cloud,
                                                                 const proto::Selection& selection,
                                                                 const Viewpoints& viewpoints,
                                                                 engine::edit::Request& request);

/// with_cameras(), to_engine() and hand_over(), one after the other, on a scene.
///   errors  those of with_cameras(), to_engine() and select::select()
[[nodiscard]] engine::Result<std::vector<std::string>> select_rows(const engine::scene::GaussianCloud& cloud,
                                                                   const proto::Selection& selection,
                                                                   const Viewpoints& viewpoints,
                                                                   engine::edit::Request& request);

}  // namespace server::edits
