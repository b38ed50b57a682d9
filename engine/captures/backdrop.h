// A real place for a captured case: a made-up thing is drawn into all photos of a capture, before the edit and after
// it. Everything but the thing is as people's cameras have seen it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/captures/plan.h"
#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/fit/photo.h"
#include "engine/fit/start.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::captures {

/// Photos of a place, and a scene trained from them, which says where its surfaces are and what stands before what.
struct Backdrop {
  std::string name;                       ///< For people, and for names of cases.
  std::vector<fit::Photo> photos;         ///< One or more; photos[i].camera.name tells them apart.
  std::vector<fit::ColoredPoint> points;  ///< Of the sparse reconstruction.
  scene::GaussianCloud scene;             ///< Of SH degree 3.
};

/// Where somebody stands a thing, by what a photo shows.
struct Stand {
  std::string view;                  ///< Name of the photo.
  DVec2 at{0.5, 0.5}, to{0.5, 0.5};  ///< The thing's foot before and after the edit, in parts of the picture's sides.
  double size = 0.25;                ///< Of the thing's longest side, in parts of the picture's height.
};

/// The photo of that name.
///   errors  not_found, `where` is "view": there is none
[[nodiscard]] Result<const fit::Photo*> photo_named(const Backdrop& backdrop, const std::string& name);

/// A plan's things, grips and clicks in a backdrop. Upright on the surface that the photo shows at `stand.at`, turned
/// to its viewer, and slid to `stand.to` as they are, whatever the plan does with them. Surroundings, region, orbit and
/// carelessness are gone, and gloss, which is of another light.
struct Standing {
  Plan plan;
  double scale = 1;  ///< Of the things, world units of the backdrop per one of the plan.
};
///   errors  those of photo_named(); invalid_argument: numbers that are not finite, or no size ("at", "to", "size");
///           unprocessable: no surface shows at a place ("at", "to"), both are one place ("to"), or the plan draws out
///           or grows what it moves ("case")
[[nodiscard]] Result<Standing> stand_in(Plan plan, const Backdrop& backdrop, const Stand& stand);

/// The photo with rows of a scene drawn into it: their light, over what of the photo they do not cover. Whatever of the
/// scene stands before them covers them. [3], 0 to 1, without noise of its own.
[[nodiscard]] scene::Image drawn_into(const fit::Photo& photo, const scene::GaussianCloud& scene,
                                      std::span<const std::uint32_t> rows);

/// The points of the backdrop that a reconstruction may still find with these rows in the scene: two photos have them
/// in the picture, and not behind these rows.
[[nodiscard]] std::vector<fit::ColoredPoint> points_beside(const Backdrop& backdrop,
                                                           std::span<const scene::Camera> cameras,
                                                           const scene::GaussianCloud& scene,
                                                           std::span<const std::uint32_t> rows);

}  // namespace engine::captures
