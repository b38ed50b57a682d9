// What a format has rounded of a scene, in numbers.
#pragma once

#include <string>
#include <vector>

#include "engine/io/scene_file.h"

namespace engine::io {

/// How far one attribute came from what it was, over all Gaussians.
struct AttributeLoss {
  std::string attribute;         ///< "positions", "log scales", "rotations", "opacities", "colours", "SH"
  std::string unit;              ///< "world units", "degrees", ...
  double largest = 0, mean = 0;  ///< Of values that the format has room for: they are rounded.
  double clipped_part = 0;  ///< Of the values, 0 to 1, that lie beyond what it has room for: colours, log scales, SH.
  double most_clipped = 0;  ///< How far the farthest of them came.
};

/// Compares a scene with what read_scene() finds in the file that write_scene() has made of it.
///   before   the scene, its SH as far as `after` has it
///   after    of as many Gaussians (asserted), in the order that written_order() says
///   returns  in the order above; rotations as the least angle over half turns about a Gaussian's own axes, which
///            change nothing; opacities and colours from 0 to 1, as displayed; SH beyond DC, as stored
[[nodiscard]] std::vector<AttributeLoss> scene_loss(const SceneFile& before, const SceneFile& after,
                                                    SceneFormat format);

}  // namespace engine::io
