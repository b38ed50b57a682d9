#include "engine/select/shapes.h"

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 16'384;  // rows of a parallel task: a choice

/// The rows whose mean passes.
template <class Passes>
RowSet rows_where(const Array3& mean, Passes&& passes) {
  RowSet out(mean.size(), 0);
  parallel_for(mean.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) out[row] = passes(DVec3(mean.get(row)));
  });
  return out;
}

double largest_of(DVec3 v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

DMat3 rotation_of(DQuat q) {
  const double largest = std::max({std::abs(q.w), std::abs(q.x), std::abs(q.y), std::abs(q.z)});
  if (!(largest > 0)) return DMat3(1.0);
  return glm::mat3_cast(glm::normalize(q / largest));  // first near 1, so that no square overflows or vanishes
}

RowSet rows_in(const Array3& mean, const Sphere& sphere) {
  // Numbers up to 1e38: their squares fit a double.
  return rows_where(mean, [&](DVec3 point) {
    const DVec3 offset = point - sphere.center;
    return glm::dot(offset, offset) < sphere.radius * sphere.radius;
  });
}

RowSet rows_in(const Array3& mean, const Box& box) {
  const DMat3 box_from_world = glm::transpose(rotation_of(box.rotation));
  return rows_where(mean, [&, half = 0.5 * box.size](DVec3 point) {
    const DVec3 offset = box_from_world * (point - box.center);
    return std::abs(offset.x) <= half.x && std::abs(offset.y) <= half.y && std::abs(offset.z) <= half.z;
  });
}

RowSet rows_in(const Array3& mean, const Plane& plane) {
  return rows_where(mean, [&, normal = plane.normal / largest_of(plane.normal)](DVec3 point) {
    return glm::dot(point - plane.point, normal) >= 0;
  });
}

RowSet rows_in(const Array3& mean, const Rows& rows) {
  RowSet out(mean.size(), 0);
  for (const auto [from, to] : rows.ranges)
    std::fill(out.begin() + std::ptrdiff_t(from), out.begin() + std::ptrdiff_t(to), std::uint8_t{1});
  return out;
}

}  // namespace engine::select
