#include "engine/captures/moving_part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "engine/render/project.h"
#include "engine/render/weight_sums.h"
#include "engine/scene/image.h"

namespace engine::captures {

MovingPart::MovingPart(const scene::GaussianCloud& before, std::span<const std::uint32_t> part, double within)
    : surface_(interleaved(before.mean), 3), moves_(before.size(), 0), within_(within) {
  for (const std::uint32_t row : part) moves_[row] = 1;
}

std::vector<std::uint8_t> MovingPart::holds(const Array3& places) const {
  std::vector<std::uint8_t> out(places.size(), 0);
  if (surface_.size() == 0 || places.size() == 0) return out;
  const auto nearest = surface_.nearest(interleaved(places), 1);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = moves_[nearest[i].index] != 0 && double(nearest[i].squared_distance) <= within_ * within_;
  return out;
}

bool MovingPart::holds(DVec3 place) const {
  Array3 one;
  one.resize(1);
  one.set(0, Vec3(place));
  return holds(one)[0] != 0;
}

std::vector<double> opacities_times_area(const scene::GaussianCloud& cloud) {
  std::vector<double> out(cloud.size());
  for (std::size_t row = 0; row < out.size(); ++row) {
    const DVec3 log_scale(cloud.log_scale.get(row));
    std::array<double, 3> extent{std::exp(log_scale.x), std::exp(log_scale.y), std::exp(log_scale.z)};
    std::sort(extent.begin(), extent.end(), std::greater<>());
    out[row] = render::opacity<double>(cloud.opacity_logit[row]) * std::numbers::pi * extent[0] * extent[1];
  }
  return out;
}

std::vector<double> shown_areas(const scene::GaussianCloud& cloud, std::span<const scene::Camera> cameras) {
  std::vector<double> all(cloud.size(), 0.0), valued(cloud.size(), 0.0);
  render::Workspace workspace;
  for (const scene::Camera& camera : cameras)
    render::add_weight_sums(cloud, camera, scene::Image(camera.width, camera.height, 1), workspace, all, valued);
  return all;
}

Match match(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, const MovingPart& part,
            std::span<const double> counts) {
  const std::vector<std::uint8_t> moves = part.holds(cloud.mean);
  double moving = 0, chosen = 0, both = 0;
  for (std::size_t row = 0; row < moves.size(); ++row)
    if (moves[row] != 0) moving += counts[row];
  for (const std::uint32_t row : rows) {
    chosen += counts[row];
    if (moves[row] != 0) both += counts[row];
  }
  return {moving > 0 ? both / moving : 1, chosen > 0 ? both / chosen : 1};
}

}  // namespace engine::captures
