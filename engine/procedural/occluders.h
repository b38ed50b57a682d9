// What stands in the way of a ray: the meshes of all patches of a scene.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/procedural/surface.h"

namespace engine::procedural {

/// Where a ray meets a surface.
struct Hit {
  float distance = 0;       ///< Along the ray, in lengths of its direction.
  std::uint32_t patch = 0;  ///< Number of the patch, counted over all objects in order.
};

/// Triangles in a tree of boxes. Immutable; rays may be cast from many threads.
/// Source: Möller and Trumbore 1997 for a triangle; Kay and Kajiya 1986 for the slabs of a box.
class Occluders {
 public:
  explicit Occluders(std::span<const Object> objects);

  /// Is any triangle hit at a distance in (0, limit)? Triangles have no inside: both their sides count.
  [[nodiscard]] bool any(Vec3 origin, Vec3 direction, float limit) const;
  /// The nearest hit in (0, limit).
  [[nodiscard]] std::optional<Hit> nearest(Vec3 origin, Vec3 direction, float limit) const;

 private:
  struct Triangle {
    Vec3 corner, edge1, edge2;
    std::uint32_t patch;
  };
  struct Node {
    Vec3 low, high;
    std::uint32_t first = 0;  ///< Of its triangles; in an inner node, of its two children.
    std::uint32_t count = 0;  ///< 0 for an inner node.
  };
  struct Cut;
  /// The cut with the least expected work.
  ///   low, high  box of the triangles' middles
  ///   unsplit    the work without a cut: which is kept where none is better
  [[nodiscard]] static Cut best_cut(std::span<const Triangle> triangles, Vec3 low, Vec3 high, float unsplit);
  void split(std::uint32_t node, std::uint32_t begin, std::uint32_t end);
  template <bool any_hit>
  [[nodiscard]] std::optional<Hit> cast(Vec3 origin, Vec3 direction, float limit) const;

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace engine::procedural
