// Parts of a picture: what a polygon or a stroke encloses, point by point and pixel by pixel.
#pragma once

#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/image.h"
#include "engine/select/operation.h"

namespace engine::select {

/// Does the polygon hold the point? Even-odd rule; of a point on an edge, one of the two sides holds it.
///   at  pixels (COLMAP convention)
[[nodiscard]] bool holds(const Polygon& polygon, DVec2 at);
/// Is the point within the radius of the line, or at it?
[[nodiscard]] bool holds(const Stroke& stroke, DVec2 at);

/// A picture of one channel and the camera's size: 1 at the pixels whose centre is held, 0 elsewhere.
[[nodiscard]] scene::Image drawn(const Polygon& polygon);
[[nodiscard]] scene::Image drawn(const Stroke& stroke);

}  // namespace engine::select
