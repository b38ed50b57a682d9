#include "engine/captures/moving_part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "engine/render/project.h"

namespace engine::captures {

MovingPart::MovingPart(const scene::GaussianCloud& before, std::span<const std::uint32_t> part)
    : surface_(interleaved(before.mean), 3), moves_(before.size(), 0) {
  for (const std::uint32_t row : part) moves_[row] = 1;
}

std::vector<std::uint8_t> MovingPart::holds(const Array3& places) const {
  std::vector<std::uint8_t> out(places.size(), 0);
  if (surface_.size() == 0 || places.size() == 0) return out;
  const auto nearest = surface_.nearest(interleaved(places), 1);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = moves_[nearest[i].index] != 0 && double(nearest[i].squared_distance) <= belongs_within * belongs_within;
  return out;
}

bool MovingPart::holds(DVec3 place) const {
  Array3 one;
  one.resize(1);
  one.set(0, Vec3(place));
  return holds(one)[0] != 0;
}

double opacity_times_area(const scene::GaussianCloud& cloud, std::size_t row) {
  const Vec3 log_scale = cloud.log_scale.get(row);
  std::array<double, 3> extent{std::exp(double(log_scale.x)), std::exp(double(log_scale.y)),
                               std::exp(double(log_scale.z))};
  std::sort(extent.begin(), extent.end(), std::greater<>());
  return render::opacity<double>(cloud.opacity_logit[row]) * std::numbers::pi * extent[0] * extent[1];
}

Match match(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, const MovingPart& part) {
  const std::vector<std::uint8_t> moves = part.holds(cloud.mean);
  double moving = 0, chosen = 0, both = 0;
  auto next = rows.begin();
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const bool is_chosen = next != rows.end() && *next == i;
    if (is_chosen) ++next;
    const double weight = opacity_times_area(cloud, i);
    if (moves[i] != 0) moving += weight;
    if (is_chosen) chosen += weight;
    if (is_chosen && moves[i] != 0) both += weight;
  }
  return {moving > 0 ? both / moving : 1, chosen > 0 ? both / chosen : 1};
}

}  // namespace engine::captures
