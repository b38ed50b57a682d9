#include "engine/deform/assign.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

#include "engine/core/parallel.h"

namespace engine::deform {
namespace {

constexpr std::size_t grain = 16384;  // rows per task: some 50 us of work for a handful of handles
constexpr double infinity = std::numeric_limits<double>::infinity();

/// What one chunk of rows saw of one sphere. Distances are squared.
struct Sighting {
  std::size_t owned = 0;      ///< Gaussians that belong to the handle.
  std::size_t inside = 0;     ///< In the sphere and the region, whoever owns them.
  std::size_t excluded = 0;   ///< In the sphere, outside the region.
  double nearest = infinity;  ///< Of all Gaussians inside the region.
};

/// Chunks are merged by sums and minima of exact numbers, so their order does not matter.
void merge(Sighting& into, const Sighting& from) {
  into.owned += from.owned;
  into.inside += from.inside;
  into.excluded += from.excluded;
  into.nearest = std::min(into.nearest, from.nearest);
}

/// Four significant digits, as a person would write them.
std::string text(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 4).ptr;
  return {buffer, end};
}

std::string gaussians(std::size_t n) { return std::to_string(n) + (n == 1 ? " Gaussian" : " Gaussians"); }

std::string why_empty(std::size_t handle, const Sphere& sphere, const Sighting& seen) {
  const std::string within = " within " + text(sphere.radius) + " of handle " + std::to_string(handle + 1);
  if (seen.inside > 0)
    return gaussians(seen.inside) + within + ", but each is nearer to another handle: move this handle or leave it out";
  if (seen.excluded > 0)
    return gaussians(seen.excluded) + within + ", but all outside the region: enlarge the region or leave it out";
  if (seen.nearest == infinity) return "0 Gaussians" + within + ": the region holds none; move or enlarge it";
  return "0 Gaussians" + within + "; the nearest is " + text(std::sqrt(seen.nearest)) +
         " away: move the handle's source there, or raise the radius";
}

}  // namespace

bool inside(const Box& box, DVec3 point) {
  const DVec3 from_center = glm::abs(point - box.center);
  return from_center.x <= box.size.x / 2 && from_center.y <= box.size.y / 2 && from_center.z <= box.size.z / 2;
}

Result<Assignment> assign(const Array3& mean, std::span<const Sphere> spheres, const std::optional<Box>& region) {
  assert(spheres.size() < std::numeric_limits<std::uint16_t>::max());
  const std::size_t handles = spheres.size();
  Assignment result{HandleColumn(mean.size(), 0), std::vector<std::size_t>(handles, 0)};
  std::vector<Sighting> sightings(chunk_count(mean.size(), grain) * handles);

  parallel_for(mean.size(), grain, [&](std::size_t begin, std::size_t end) {
    const std::span<Sighting> seen = std::span(sightings).subspan(begin / grain * handles, handles);
    for (std::size_t i = begin; i < end; ++i) {
      const DVec3 point(mean.get(i));
      const bool allowed = !region || inside(*region, point);
      double best = infinity;
      std::size_t owner = handles;
      for (std::size_t h = 0; h < handles; ++h) {
        const DVec3 offset = point - spheres[h].center;
        const double squared = glm::dot(offset, offset);
        if (allowed) seen[h].nearest = std::min(seen[h].nearest, squared);
        if (!(squared < spheres[h].radius * spheres[h].radius)) continue;
        if (!allowed) {
          ++seen[h].excluded;
          continue;
        }
        ++seen[h].inside;
        if (squared < best) best = squared, owner = h;
      }
      if (owner == handles) continue;
      result.handle[i] = std::uint16_t(owner + 1);
      ++seen[owner].owned;
    }
  });

  for (std::size_t h = 0; h < handles; ++h) {
    Sighting seen;
    for (std::size_t chunk = h; chunk < sightings.size(); chunk += handles) merge(seen, sightings[chunk]);
    if (seen.owned == 0)
      return fail(ErrorCode::unprocessable, why_empty(h, spheres[h], seen),
                  "handles[" + std::to_string(h) + "].radius");
    result.count[h] = seen.owned;
  }
  return result;
}

Result<Assignment> assign_selected(const Array3& mean, std::span<const std::uint32_t> rows,
                                   std::span<const DVec3> centers, const std::optional<Box>& region) {
  assert(centers.size() < std::numeric_limits<std::uint16_t>::max());
  assert(rows.empty() || rows.back() < mean.size());
  Assignment result{HandleColumn(mean.size(), 0), std::vector<std::size_t>(centers.size(), 0)};
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const DVec3 point(mean.get(rows[k]));
      if (region && !inside(*region, point)) continue;
      double best = infinity;
      for (std::size_t h = 0; h < centers.size(); ++h) {
        const DVec3 offset = point - centers[h];
        const double squared = glm::dot(offset, offset);
        if (squared < best) best = squared, result.handle[rows[k]] = std::uint16_t(h + 1);
      }
    }
  });
  for (const std::uint32_t row : rows)
    if (result.handle[row] != 0) ++result.count[result.handle[row] - 1u];
  if (std::ranges::all_of(result.count, [](std::size_t count) { return count == 0; }))
    return fail(ErrorCode::unprocessable,
                gaussians(rows.size()) + " selected, but all outside the region: enlarge the region or leave it out",
                "selection");
  return result;
}

}  // namespace engine::deform
