// Surfaces that go on behind what left: where a part stood on something, nobody has seen what is under it.
//
// A surface near the place is a plane in a picture of inverse depth (a plane in space is affine there), or curved, as a
// polynomial of second degree, where that explains clearly more. It goes on at a pixel of the vacated place if the
// pixel lies amid pixels that show it, if nothing in front of it is seen there, and if no view has looked through the
// point where it would be.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// What one view shows around the vacated place.
struct SurfaceView {
  scene::Image inverse_depth;  ///< [1] 1 / (world units along the axis); 0 where nothing is.
  scene::Mask shows_surface;   ///< Pixels that may be relied upon: trusted, opaque, not the part itself.
  scene::Mask vacated;         ///< Pixels that the part has left.
  scene::Mask doubtful;        ///< Pixels whose content is not trusted.
  scene::Mask
      within;  ///< Pixels whose content nobody saw, within what has left: it hides nothing. They are doubtful, too.
};

/// Is the point (pixel position, inverse depth) in space that some view has looked through?
using IsFree = std::function<bool(DVec2 pixel, double inverse_depth)>;

/// The surfaces that go on in one view.
struct ContinuedSurfaces {
  scene::Image inverse_depth;  ///< [1] Of the surface that goes on at each vacated pixel; 0 where none does.
  /// Inverse depth of the one that goes on at most pixels, at any pixel position. None: nothing goes on.
  std::function<double(DVec2 pixel)> main;
  scene::Rect known;  ///< Pixels around the place from which surfaces are known; farther out they are guesses.
};

///   seed  of the random choices
[[nodiscard]] ContinuedSurfaces continued_surfaces(const SurfaceView& view, const IsFree& is_free, std::uint64_t seed);

}  // namespace engine::repair
