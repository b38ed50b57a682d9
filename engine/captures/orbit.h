// Where people stand when they photograph a thing: on a part of an orbit around it.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/camera.h"

namespace engine::captures {

/// Lengths in world units, angles in degrees. Azimuth 0 looks along +z, and grows to the right.
struct Orbit {
  DVec3 target{0.0};
  double distance = 3.6;             ///< Of the cameras, give or take a twelfth.
  double azimuth = 0, reach = 38;    ///< Cameras stand up to `reach` to the left and right of `azimuth`.
  double lowest = 12, highest = 36;  ///< Elevations above the horizon.
  double fov_y = 40;                 ///< Vertical field of view.
  int photos = 30;
  int width = 320, height = 240;  ///< Pixels.
};

/// Cameras of the photos: "photo_00" stands about in the middle, all are spread evenly.
[[nodiscard]] std::vector<scene::Camera> photo_cameras(const Orbit& orbit, std::uint64_t seed);

/// Cameras to judge by, none of which took a photo.
struct HeldOut {
  std::vector<scene::Camera> within;  ///< "within_0", ...: between those of the photos.
  std::vector<scene::Camera> beyond;  ///< "beyond_0", ...: farther to the left, to the right, or higher than any photo.
};
[[nodiscard]] HeldOut held_out_cameras(const Orbit& orbit, std::uint64_t seed);

}  // namespace engine::captures
