// Surfaces by formula: the shapes that made-up scenes consist of.
// World frame of this room: COLMAP's habit, x right, y DOWN, z away from the viewer. "Height" is -y.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/vec.h"

namespace engine::procedural {

/// Where on a patch, and where in its object.
struct SurfacePoint {
  float u = 0, v = 0;  ///< 0 to 1
  Vec3 local{0.0f};    ///< Position in the object's own frame, world units.
};

/// What a surface is made of at a point.
struct Finish {
  Vec3 albedo{0.5f};  ///< Linear, 0 to 1.
  float gloss = 0;    ///< 0 matt, 1 glazed.
};

using Material = std::function<Finish(const SurfacePoint&)>;

/// A parametric piece of surface, in its object's frame. cross(d/du, d/dv) points outwards.
struct Patch {
  std::function<Vec3(float u, float v)> position;
  Material material;
  int cells_u = 1, cells_v = 1;  ///< Quads of the mesh that stands in for it when rays are cast.
  float density = 1;             ///< Gaussians per area, relative to the rest of the scene.
  bool closed_u = false;         ///< u = 0 and u = 1 are the same line.
  bool two_sided = false;        ///< A thin sheet (a leaf): seen, and lit, from both sides.
};

/// Turned about the vertical, then moved.
struct Placement {
  Vec3 position{0.0f};  ///< Of the object's origin, world units.
  float turn_rad = 0;   ///< About the vertical through it; positive from +x towards +z.

  [[nodiscard]] Vec3 world(Vec3 local) const;
};

/// A thing that can be put somewhere.
struct Object {
  std::string name;
  Placement placement;
  std::vector<Patch> patches;
};

// Shapes. Lengths in world units; each returns patches in the object's frame.

/// A corner of a profile.
struct ProfilePoint {
  float radius = 0, height = 0;
};
/// Turns a profile about the vertical axis. It runs up the outside, and over the rim down the inside if it is hollow.
/// Corners of the profile stay sharp. At least two points, not all the same.
[[nodiscard]] Patch lathe(const std::vector<ProfilePoint>& profile, Material material, float density,
                          int segments = 48);

/// corner + u * edge_u + v * edge_v
[[nodiscard]] Patch quad(Vec3 corner, Vec3 edge_u, Vec3 edge_v, Material material, float density);

/// The six faces of an upright box: the middle of its bottom is at `bottom`.
[[nodiscard]] std::vector<Patch> box(Vec3 bottom, Vec3 size_width_height_depth, const Material& material,
                                     float density);

/// A tube around a curve c(v), of radius r(v). The curve may close on itself in `v`; it has no caps.
[[nodiscard]] Patch tube(std::function<Vec3(float)> curve, std::function<float(float)> radius, Material material,
                         float density, int segments = 8, int rings = 24);

/// A leaf blade around a midrib m(v), v from stalk to tip.
struct Blade {
  std::function<Vec3(float)> midrib;
  Vec3 side{1, 0, 0};  ///< Unit; direction of growing u.
  float half_width = 0.1f;
  float cup = 0.3f;      ///< How far the rims rise, in half widths.
  float ripple = 0.05f;  ///< Of the rims, in half widths.
};
/// Half width of a blade at v as a part of its largest: pointed at the tip, rounded at the stalk.
[[nodiscard]] float blade_outline(float v);
[[nodiscard]] Patch leaf(const Blade& blade, Material material, float density);

/// Unit normal by central differences; it points to the side that cross(d/du, d/dv) does.
[[nodiscard]] Vec3 normal_at(const Patch& patch, float u, float v);

}  // namespace engine::procedural
