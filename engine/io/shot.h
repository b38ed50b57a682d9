// What a dataset's file says about its photographs, before anybody has looked for them.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "engine/core/vec.h"
#include "engine/io/undistort.h"

namespace engine::io {

/// A posed photograph. Axes as in scene::Camera: x right, y down, z forward.
struct Shot {
  std::string name;        ///< The photo's file name, as the dataset's file has it.
  DMat3 rotation{1.0};     ///< x_in_cam = rotation * x_in_world + translation
  DVec3 translation{0.0};  ///< World units.
  Lens lens;
  std::string where;  ///< Address of this entry, for error messages: "images.bin:image[17]".
};

/// A point of the sparse reconstruction.
struct Point {
  DVec3 position{0.0};                ///< World units.
  std::array<std::uint8_t, 3> rgb{};  ///< Display-referred.
  bool operator==(const Point&) const = default;
};

/// A photo of this size may belong to a lens calibrated for another one if it was only scaled, each side rounded to
/// whole pixels.
[[nodiscard]] inline bool same_shape(const Lens& lens, int width, int height) {
  const auto difference = double(width) * lens.height - double(height) * lens.width;
  return difference <= lens.width + lens.height && -difference <= lens.width + lens.height;
}

}  // namespace engine::io
