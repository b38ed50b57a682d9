// What the cameras of a capture have seen of it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// Of more cameras an even choice is taken: they see hardly a point that the others do not, and each keeps a picture.
constexpr std::size_t most_witnesses = 128;
/// Pixels of the longer side of that picture: as fine as what is asked, which is on which side of an outline a point
/// lies.
constexpr int witness_side = 512;

/// Cameras that saw the unedited scene, and how far each of them looked. What is under a thing or within it no camera
/// saw, however well the scene's Gaussians there shine through its blurred rim.
class Witnesses {
 public:
  /// Renders the scene once for each camera, up to most_witnesses.
  Witnesses(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras);

  /// Did cameras see this point, or through it, with nothing in front? Beside the edge of what is in front two of them
  /// are needed: one alone may err there.
  [[nodiscard]] bool saw(DVec3 point) const;

  [[nodiscard]] const std::vector<scene::Camera>& cameras() const { return cameras_; }
  [[nodiscard]] const std::vector<scene::Image>& depth() const { return depth_; }  ///< See below.

 private:
  std::vector<scene::Camera> cameras_;
  std::vector<scene::Image> depth_;  ///< [1] Per camera: median depth, world units; 0: nothing is there.
};

}  // namespace engine::repair
