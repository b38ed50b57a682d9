#include "engine/captures/orbit.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "engine/core/rng.h"

namespace engine::captures {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double distance_spread = 1.0 / 12;         // nobody keeps their distance exactly; a choice
constexpr int within_count = 6;                      // held-out cameras; choices, like the next two
constexpr double beyond_side = 12, beyond_top = 10;  // degrees beyond the photos' own
constexpr std::uint32_t for_distance = 11;           // purpose of derived_seed()

/// A camera of the orbit.
///   nearness  factor of the distance
scene::Camera camera_at(const Orbit& orbit, double azimuth, double elevation, double nearness, std::string name) {
  const double a = azimuth * degree, e = elevation * degree;
  const DVec3 direction(std::sin(a) * std::cos(e), -std::sin(e), -std::cos(a) * std::cos(e));
  scene::Camera camera = scene::look_at(orbit.target + nearness * orbit.distance * direction, orbit.target, {0, -1, 0},
                                        orbit.fov_y * degree, orbit.width, orbit.height);
  camera.name = std::move(name);
  return camera;
}

/// Cameras spread by Roberts' additive sequence for two dimensions: 1 / p and 1 / p^2 with p^3 = p + 1.
///   first  number in the sequence of the first; 0 stands in the middle
std::vector<scene::Camera> spread(const Orbit& orbit, int first, int count, const std::string& prefix,
                                  std::uint64_t seed) {
  std::vector<scene::Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double across = std::fmod(0.5 + 0.7548776662466927 * (first + i), 1.0);
    const double up = std::fmod(0.5 + 0.5698402909980532 * (first + i), 1.0);
    Rng rng(derived_seed(seed, {for_distance, 0, 0, 0}), std::uint64_t(first + i));
    std::array<char, 16> number{};
    std::snprintf(number.data(), number.size(), count > 10 ? "%02d" : "%d", i);
    cameras.push_back(camera_at(orbit, orbit.azimuth + (2 * across - 1) * orbit.reach,
                                std::lerp(orbit.lowest, orbit.highest, up),
                                1 + distance_spread * double(rng.uniform(-1, 1)), prefix + number.data()));
  }
  return cameras;
}

}  // namespace

std::vector<scene::Camera> photo_cameras(const Orbit& orbit, std::uint64_t seed) {
  return spread(orbit, 0, orbit.photos, "photo_", seed);
}

HeldOut held_out_cameras(const Orbit& orbit, std::uint64_t seed) {
  HeldOut out;
  out.within = spread(orbit, orbit.photos, within_count, "within_", seed);
  const double middle = 0.5 * (orbit.lowest + orbit.highest), side = orbit.reach + beyond_side;
  out.beyond = {camera_at(orbit, orbit.azimuth - side, middle, 1, "beyond_0"),
                camera_at(orbit, orbit.azimuth + side, middle, 1, "beyond_1"),
                camera_at(orbit, orbit.azimuth - 0.4 * orbit.reach, orbit.highest + beyond_top, 1, "beyond_2"),
                camera_at(orbit, orbit.azimuth + 0.4 * orbit.reach, orbit.highest + beyond_top, 1, "beyond_3")};
  return out;
}

}  // namespace engine::captures
