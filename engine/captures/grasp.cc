#include "engine/captures/grasp.h"

#include <optional>

#include "engine/deform/assign.h"

namespace engine::captures {
namespace {

// How a careless person places balls, as a share of the radius that one would choose; choices, and part of the
// definition of the cases. The ball's rim runs through about the middle of the thing: half of it is left out, and
// beyond its outline the ball takes in what it should not.
constexpr double too_large = 1.25, off_centre = 1.2;

void place_carelessly(const CapturedCase& the_case, edit::Handle& handle) {
  // Off to the right in the first photo.
  const DVec3 right = glm::transpose(the_case.cameras.front().rotation)[0];
  const DVec3 off = off_centre * handle.radius * right;
  handle.source += off;
  if (handle.target) *handle.target += off;
  handle.radius *= too_large;
}

}  // namespace

Result<Grasp> grasp_by_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  Grasp out;
  out.request.mode = the_case.mode;
  out.request.handles = the_case.handles;
  out.request.region = the_case.region;
  std::vector<deform::Sphere> spheres;
  for (edit::Handle& handle : out.request.handles) {
    if (the_case.careless) place_carelessly(the_case, handle);
    spheres.push_back({handle.source, handle.radius});
  }
  std::optional<deform::Box> box;
  if (the_case.region) box = deform::Box{the_case.region->center, the_case.region->size};
  const auto assigned = deform::assign(scene.mean, spheres, box);
  if (!assigned) return propagate(assigned);
  for (std::uint32_t row = 0; row < assigned->handle.size(); ++row)
    if (const auto handle = assigned->handle[row]; handle > 0 && out.request.handles[handle - 1].target)
      out.rows.push_back(row);
  return out;
}

}  // namespace engine::captures
