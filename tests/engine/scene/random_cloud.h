// A cloud of random values, for tests that do not render.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/core/rng.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::scene {

inline GaussianCloud random_cloud(std::size_t n, int degree, std::uint64_t seed, std::size_t extra_stride = 0) {
  GaussianCloud cloud;
  cloud.sh_degree = degree;
  cloud.extra_stride = extra_stride;
  cloud.resize(n);
  Rng rng(seed);
  for (std::size_t i = 0; i < n; ++i) {
    cloud.mean.set(i, {rng.normal(), rng.normal(), rng.normal()});
    cloud.log_scale.set(i, {rng.normal(), rng.normal(), rng.normal()});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.normal();
  }
  for (float& value : cloud.sh) value = rng.normal();
  for (std::byte& value : cloud.extra) value = std::byte(rng.next());
  return cloud;
}

}  // namespace engine::scene
