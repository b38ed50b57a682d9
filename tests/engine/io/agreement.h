// How far two scenes are apart, attribute by attribute.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/sh.h"
#include "tests/engine/io/samples.h"

namespace engine::io {

inline double opacity_of(float logit) { return 1.0 / (1.0 + std::exp(-double(logit))); }

/// Largest differences over all rows.
struct Differences {
  std::array<double, 3> mean{};  ///< World units, per axis.
  double log_scale = 0;
  double rotation_rad = 0;  ///< The least over half turns about local axes, which change no Gaussian.
  double opacity = 0;       ///< 0 to 1.
  double f_dc = 0;
  double sh = 0;  ///< Beyond DC.
};

/// The angle between two Gaussians' axes.
inline double axes_angle(Quat a, Quat b) {
  const DQuat p = glm::normalize(DQuat(a)), q = glm::normalize(DQuat(b));
  double cosine = 0;
  for (const DQuat& half : {DQuat(1, 0, 0, 0), DQuat(0, 1, 0, 0), DQuat(0, 0, 1, 0), DQuat(0, 0, 0, 1)})
    cosine = std::max(cosine, std::abs(glm::dot(p * half, q)));
  return 2 * std::acos(std::min(1.0, cosine));
}

/// Row i of `a` against row order[i] of `b`.
inline Differences differences(const scene::GaussianCloud& a, const scene::GaussianCloud& b,
                               const std::vector<std::uint32_t>& order) {
  Differences most;
  const std::size_t coefficients = scene::sh_coefficients(a.sh_degree);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::size_t j = order[i];
    for (int c = 0; c < 3; ++c) {
      most.mean[std::size_t(c)] =
          std::max(most.mean[std::size_t(c)], std::abs(double(a.mean.get(i)[c]) - double(b.mean.get(j)[c])));
      most.log_scale =
          std::max(most.log_scale, std::abs(double(a.log_scale.get(i)[c]) - double(b.log_scale.get(j)[c])));
    }
    most.rotation_rad = std::max(most.rotation_rad, axes_angle(a.rotation.get(i), b.rotation.get(j)));
    most.opacity = std::max(most.opacity, std::abs(opacity_of(a.opacity_logit[i]) - opacity_of(b.opacity_logit[j])));
    for (std::size_t k = 0; k < a.sh_stride(); ++k) {
      double& value = k % coefficients == 0 ? most.f_dc : most.sh;
      value = std::max(value, std::abs(double(a.sh_row(i)[k]) - double(b.sh_row(j)[k])));
    }
  }
  return most;
}

inline std::vector<std::uint32_t> in_order(std::size_t n) {
  std::vector<std::uint32_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = std::uint32_t(i);
  return order;
}

}  // namespace engine::io
