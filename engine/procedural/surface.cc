#include "engine/procedural/surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace engine::procedural {
namespace {

constexpr float two_pi = 2 * std::numbers::pi_v<float>;

/// The same polyline in pieces of nearly equal length, so that its parameter runs nearly evenly while every corner
/// falls between two pieces, where the mesh has a ring.
std::vector<ProfilePoint> in_pieces(const std::vector<ProfilePoint>& profile) {
  auto length = [&](std::size_t i) {
    return std::hypot(profile[i + 1].radius - profile[i].radius, profile[i + 1].height - profile[i].height);
  };
  float whole = 0;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) whole += length(i);
  std::vector<ProfilePoint> pieces{profile.front()};
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    // The 0.01 keeps a profile of 24 equal segments, rounded, as it is.
    const int n = std::max(1, int(std::ceil(24 * length(i) / whole - 0.01f)));
    for (int k = 1; k <= n; ++k) {
      const float t = float(k) / float(n);
      pieces.push_back({profile[i].radius + t * (profile[i + 1].radius - profile[i].radius),
                        profile[i].height + t * (profile[i + 1].height - profile[i].height)});
    }
  }
  return pieces;
}

}  // namespace

Vec3 Placement::world(Vec3 local) const {
  const float c = std::cos(turn_rad), s = std::sin(turn_rad);
  return position + Vec3(c * local.x - s * local.z, local.y, s * local.x + c * local.z);
}

Patch lathe(const std::vector<ProfilePoint>& profile, Material material, float density, int segments) {
  std::vector<ProfilePoint> pieces = in_pieces(profile);
  const int rings = int(pieces.size()) - 1;
  return {.position =
              [pieces = std::move(pieces)](float u, float v) {
                const float at = std::clamp(v, 0.0f, 1.0f) * float(pieces.size() - 1);
                const auto i = std::min(std::size_t(at), pieces.size() - 2);
                const float t = at - float(i);
                const float radius = pieces[i].radius + t * (pieces[i + 1].radius - pieces[i].radius);
                const float height = pieces[i].height + t * (pieces[i + 1].height - pieces[i].height);
                return Vec3(radius * std::cos(two_pi * u), -height, radius * std::sin(two_pi * u));
              },
          .material = std::move(material),
          .cells_u = segments,
          .cells_v = rings,
          .density = density,
          .closed_u = true};
}

Patch quad(Vec3 corner, Vec3 edge_u, Vec3 edge_v, Material material, float density) {
  return {.position = [=](float u, float v) { return corner + u * edge_u + v * edge_v; },
          .material = std::move(material),
          .density = density};
}

std::vector<Patch> box(Vec3 bottom, Vec3 size, const Material& material, float density) {
  const Vec3 x(size.x, 0, 0), up(0, -size.y, 0), z(0, 0, size.z);
  const Vec3 a = bottom - 0.5f * (x + z);         // the corner of least x and z on the ground
  return {quad(a, x, up, material, density),      // towards the viewer, -z
          quad(a + z, up, x, material, density),  // away from the viewer
          quad(a, up, z, material, density),      // left
          quad(a + x, z, up, material, density),  // right
          quad(a + up, x, z, material, density),  // top
          quad(a, z, x, material, density)};      // bottom
}

Patch tube(std::function<Vec3(float)> curve, std::function<float(float)> radius, Material material, float density,
           int segments, int rings) {
  return {.position =
              [curve = std::move(curve), radius = std::move(radius)](float u, float v) {
                constexpr float h = 1e-3f;
                const Vec3 along = glm::normalize(curve(v + h) - curve(v - h));
                const Vec3 reference = std::abs(along.z) < 0.9f ? Vec3(0, 0, 1) : Vec3(1, 0, 0);
                const Vec3 n = glm::normalize(glm::cross(reference, along)), b = glm::cross(along, n);
                return curve(v) + radius(v) * (std::cos(two_pi * u) * n + std::sin(two_pi * u) * b);
              },
          .material = std::move(material),
          .cells_u = segments,
          .cells_v = rings,
          .density = density,
          .closed_u = true};
}

float blade_outline(float v) {
  const float along = std::clamp(v, 0.0f, 1.0f);
  // sin(pi) is a little below zero in float, and a negative number has no 0.75th power.
  return std::pow(std::max(0.0f, std::sin(std::numbers::pi_v<float> * std::pow(along, 0.72f))), 0.75f);
}

Patch leaf(const Blade& blade, Material material, float density) {
  return {.position =
              [blade](float u, float v) {
                constexpr float h = 1e-3f;
                const Vec3 along = glm::normalize(blade.midrib(v + h) - blade.midrib(v - h));
                const Vec3 face = glm::cross(blade.side, along);
                const float across = 2 * u - 1;
                const float half = blade.half_width * blade_outline(v);
                const float rise =
                    blade.cup * across * across + blade.ripple * std::sin(19 * v + 2 * across) * across * across;
                return blade.midrib(v) + half * (across * blade.side + rise * face);
              },
          .material = std::move(material),
          .cells_u = 6,
          .cells_v = 14,
          .density = density,
          .two_sided = true};
}

Vec3 normal_at(const Patch& patch, float u, float v) {
  // Steps of 1e-3 balance the rounding of float positions (1e-7 of a unit) against curvature. The formula is stepped
  // inside its range; at a pole, where one derivative vanishes, the point next to it decides.
  constexpr float h = 1e-3f;
  const float v0 = std::max(v - h, 0.0f), v1 = std::min(v + h, 1.0f);
  Vec3 normal =
      glm::cross(patch.position(u + h, v) - patch.position(u - h, v), patch.position(u, v1) - patch.position(u, v0));
  const float length = glm::length(normal);
  if (length > 1e-12f) return normal / length;
  return v < 0.5f ? normal_at(patch, u, 2 * h) : normal_at(patch, u, 1 - 2 * h);
}

}  // namespace engine::procedural
