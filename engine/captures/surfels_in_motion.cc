#include "engine/captures/surfels_in_motion.h"

#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include "engine/core/half_axes.h"
#include "engine/scene/sh.h"

namespace engine::captures {
namespace {

/// How much each of bands 1 to 3 has of a highlight. A choice: as narrow as three bands allow without rings around it
/// that one would see.
constexpr std::array<double, 3> band_share{0.30, 0.39, 0.31};

}  // namespace

void carry_along(const Motion& motion, std::size_t i, scene::GaussianCloud& cloud) {
  constexpr double h = 1e-4;  // world units: far below a Gaussian's size, far above the rounding of double
  const DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(i))));
  const DVec3 extent = glm::exp(DVec3(cloud.log_scale.get(i)));
  const DVec3 middle(cloud.mean.get(i)), moved = motion(middle);
  const auto drawn = [&](int axis) {
    return extent[axis] / (2 * h) * (motion(middle + h * axes[axis]) - motion(middle - h * axes[axis]));
  };
  const auto [longer, shorter] = half_axes(drawn(0), drawn(1));
  const DVec3 u = glm::normalize(longer), v = glm::normalize(shorter);
  cloud.mean.set(i, Vec3(moved));
  cloud.rotation.set(i, Quat(glm::quat_cast(DMat3(u, v, glm::cross(u, v)))));
  cloud.log_scale.set(i, Vec3(glm::log(DVec3(glm::length(longer), glm::length(shorter), extent.z))));
}

void add_gloss(Vec3 to_light, float strength, std::size_t i, scene::GaussianCloud& cloud) {
  assert(cloud.sh_degree == 3);
  const DVec3 normal = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(i))))[2];
  const double facing = glm::dot(normal, DVec3(to_light));
  if (facing <= 0) return;
  // SH are of the direction in which one looks, which is opposite to where the light goes.
  const DVec3 gleam = DVec3(to_light) - 2 * facing * normal;
  std::array<double, 16> basis{};
  scene::sh_basis(3, gleam.x, gleam.y, gleam.z, basis.data());
  for (std::size_t band = 1; band <= 3; ++band) {
    // The addition theorem: sum_m Y_m(gleam) Y_m(d) = (2 l + 1) / (4 pi) P_l(gleam d), and P_l(1) = 1.
    const double factor = double(strength) * band_share[band - 1] * 4 * std::numbers::pi / double(2 * band + 1);
    for (std::size_t k = band * band; k < (band + 1) * (band + 1); ++k)
      for (std::size_t c = 0; c < 3; ++c) cloud.sh_row(i)[16 * c + k] += float(factor * basis[k]);
  }
}

}  // namespace engine::captures
