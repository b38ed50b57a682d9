// What closes the space that a part has left, where nobody has seen what is behind it.
//
// Cameras have looked through some of the space around the part, and have seen surfaces beside it. What lay in its
// shadow for all of them is unknown. There the distance to the surfaces goes on with least bending (thin_plate.h),
// above 0 where cameras have looked through, and where it is zero the closure lies: one for all views. A floor that a
// thing stood on goes on as a floor, and meets the wall behind. Source: Curless and Levoy 1996, "A volumetric method
// for building complex models from range images", for the distance where surfaces were seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/repair/thin_plate.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// What one camera tells about the space. All in its size; depths in world units along its axis.
struct SpaceView {
  scene::Camera camera;
  scene::Image before;  ///< [1] Depth of the scene with the part; 0: nothing was there.
  scene::Image known;   ///< [1] Depth of what is known to be there without it; 0: it is not known.
  scene::Image color;   ///< [3] What shows there without it.
  scene::Mask left;     ///< Pixels where the part was, whose colour may be that of what nobody has seen.
};

struct Bounds {
  DVec3 low{0.0}, high{0.0};
};

class Closure {
 public:
  /// One to two seconds of computing for 48 views, and 80 MB.
  ///   space  what has left, world units. Where it has no extent there is no closure
  Closure(const Bounds& space, std::span<const SpaceView> views);

  /// Inverse depth of the closure at a pixel position of a camera; 0: there is none.
  ///   from  depth from which it is looked for
  [[nodiscard]] double inverse_depth_at(const scene::Camera& camera, DVec2 pixel, double from) const;
  /// The longest edge of what has left; 0: there is no closure.
  [[nodiscard]] double extent() const { return extent_; }
  /// The colour that surfaces around a point have, those nearby most.
  [[nodiscard]] Vec3 color_at(DVec3 point) const;

 private:
  /// Where a point is: the first node of its cell, and how far into it.
  struct Cell {
    GridSize node{};
    DVec3 part{0.0};
  };
  struct Level;

  [[nodiscard]] std::size_t index(const GridSize& node) const;
  [[nodiscard]] Cell cell_of(DVec3 point) const;
  /// The mean of the values at the corners of the cell that a point is in.
  template <class Value>
  [[nodiscard]] Value interpolated(const std::vector<Value>& values, DVec3 point) const;
  /// Values and colours of nodes that some view knows of, and what it knows.
  [[nodiscard]] std::vector<Knowledge> note(std::span<const SpaceView> views);
  void measure_across(std::span<const Knowledge> known);
  void spread_colors();

  double extent_ = 0;
  DVec3 low_{0.0};
  double step_ = 0;                    ///< Between neighbouring nodes of the grid, world units.
  GridSize size_{};                    ///< Nodes along each axis.
  std::vector<float> value_;           ///< [nodes]
  std::vector<Vec3> color_;            ///< [nodes]
  std::vector<std::uint8_t> colored_;  ///< [nodes] A view shows a surface here.
};

}  // namespace engine::repair
