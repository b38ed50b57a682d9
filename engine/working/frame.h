// The frame an edit works in: the world's own, or one around the handles where the world's floats are too coarse.
#pragma once

#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::working {

/// A shift: x_in_world = x_in_edit + origin. The functions name what they make and what they make it from.
class Frame {
 public:
  Frame() = default;  ///< The world's own.
  /// World units. What is not zero should have float coordinates, so that means near it carry over exactly.
  explicit Frame(DVec3 origin) : origin_(origin) {}

  [[nodiscard]] DVec3 origin() const { return origin_; }
  [[nodiscard]] bool is_world() const { return origin_ == DVec3(0.0); }

  [[nodiscard]] DVec3 edit_from_world(DVec3 point) const { return point - origin_; }
  [[nodiscard]] DVec3 world_from_edit(DVec3 point) const { return point + origin_; }
  /// The same camera, to render a cloud of the edit.
  [[nodiscard]] scene::Camera edit_from_world(scene::Camera camera) const;
  /// The same Gaussians: only means change, rounded to float. In the world's own frame not a bit does.
  [[nodiscard]] scene::GaussianCloud edit_from_world(scene::GaussianCloud cloud) const;
  [[nodiscard]] scene::GaussianCloud world_from_edit(scene::GaussianCloud cloud) const;

  bool operator==(const Frame&) const = default;

 private:
  DVec3 origin_{0.0};
};

}  // namespace engine::working
