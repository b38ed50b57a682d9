#include "engine/select/exposed.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/parallel.h"
#include "engine/render/largest_weight.h"
#include "engine/render/project.h"
#include "engine/scene/camera.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 16'384;  // rows of a parallel task: a choice

constexpr int directions = 24;  // two of them are 25 degrees apart or less: what shows at all shows in one
constexpr int picture_side = 256;
constexpr double field_of_view = 0.7, distance = 3.2;  // radians, radii: a ball of one radius fills nine tenths of it
// Of its opacity, what gets through to a row that shows, as to one that is clicked on (shown.h). With a quarter, half
// of what people see of a doll's fluff is gone.
constexpr float gets_through = 0.1f;

/// The rows in the ball of radius 1 around the origin: no size of a scene, nor place in it, is too large for floats.
scene::GaussianCloud in_unit_ball(const scene::GaussianCloud& cloud, DVec3 middle, double radius) {
  scene::GaussianCloud out = cloud;
  parallel_for(out.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      out.mean.set(row, Vec3((DVec3(cloud.mean.get(row)) - middle) / radius));
      out.log_scale.set(row, cloud.log_scale.get(row) - float(std::log(radius)));
    }
  });
  return out;
}

/// Evenly spread over the sphere: a spiral that turns by the golden angle from one to the next.
DVec3 direction(int number) {
  const double height = 1 - (2 * number + 1) / double(directions), across = std::sqrt(1 - height * height);
  const double turn = number * std::numbers::pi * (3 - std::sqrt(5.0));
  return {across * std::cos(turn), across * std::sin(turn), height};
}

}  // namespace

std::vector<std::uint8_t> exposed_rows(const scene::GaussianCloud& cloud) {
  std::vector<std::uint8_t> out(cloud.size(), 1);
  if (cloud.size() == 0) return out;
  DVec3 low(cloud.mean.get(0)), high(low);
  for (std::size_t row = 0; row < cloud.size(); ++row)
    low = glm::min(low, DVec3(cloud.mean.get(row))), high = glm::max(high, DVec3(cloud.mean.get(row)));
  const double radius = 0.5 * glm::length(high - low);
  if (!(radius > 0)) return out;
  const scene::GaussianCloud unit = in_unit_ball(cloud, 0.5 * (low + high), radius);
  std::vector<scene::Camera> cameras;
  for (int i = 0; i < directions; ++i) {
    const DVec3 from = direction(i);
    const DVec3 up = std::abs(from.z) < 0.9 ? DVec3(0, 0, 1) : DVec3(1, 0, 0);
    cameras.push_back(scene::look_at(distance * from, DVec3(0.0), up, field_of_view, picture_side, picture_side));
  }
  const std::vector<float> weight = render::largest_weights(unit, cameras);
  for (std::size_t row = 0; row < cloud.size(); ++row)
    out[row] = weight[row] >= gets_through * render::opacity<float>(cloud.opacity_logit[row]) && weight[row] > 0;
  return out;
}

}  // namespace engine::select
