#include "engine/captures/plan_parts.h"

#include <cmath>

#include "engine/procedural/materials.h"

namespace engine::captures {

procedural::Material checks(Vec3 one, Vec3 other, float side) {
  return [=](const procedural::SurfacePoint& p) {
    const auto cell = [&](float x) { return int(std::floor(x / side)); };
    const bool even = (cell(p.local.x + 0.37f * side) + cell(p.local.y) + cell(p.local.z + 0.21f * side)) % 2 == 0;
    return procedural::Finish{(even ? one : other) * (1 + 0.1f * procedural::fractal_noise(9.0f * p.local, 2)), 0};
  };
}

}  // namespace engine::captures
