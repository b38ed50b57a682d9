#include "engine/io/scene_loss.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include "engine/io/quantised.h"

namespace engine::io {
namespace {

/// Largest and mean of values that come one by one.
struct Tally {
  double largest = 0, sum = 0;
  std::size_t count = 0;

  void add(double value) {
    largest = std::max(largest, value);
    sum += value;
    ++count;
  }
  [[nodiscard]] AttributeLoss as(const char* attribute, const char* unit) const {
    return {attribute, unit, largest, count == 0 ? 0 : sum / double(count)};
  }
};

double opacity(float logit) { return 1.0 / (1.0 + std::exp(-double(logit))); }

/// Degrees between two rotations, up to half turns about local axes. By the sine of half of it: acos() of what is
/// nearly 1 knows no small angles.
double degrees_between(Quat a, Quat b) {
  const auto unit = [](Quat q) {
    const DQuat d(q);
    const double length = glm::length(d);
    return length > 0 ? d / length : DQuat(1, 0, 0, 0);
  };
  const DQuat turn = glm::conjugate(unit(a)) * unit(b);
  const std::array<double, 4> parts{turn.w, turn.x, turn.y, turn.z};
  double square = 0;
  for (const double part : parts) square += part * part;
  double largest = 0;
  for (const double part : parts) largest = std::max(largest, part * part);
  return 2 * std::asin(std::min(1.0, std::sqrt(std::max(0.0, square - largest)))) * 180 / std::numbers::pi;
}

}  // namespace

std::vector<AttributeLoss> scene_loss(const SceneFile& before, const SceneFile& after, SceneFormat format) {
  const scene::GaussianCloud &a = before.cloud, &b = after.cloud;
  assert(a.size() == b.size());
  const auto order = written_order(before, format);
  const std::size_t in = scene::sh_coefficients(a.sh_degree), out = scene::sh_coefficients(b.sh_degree);
  Tally mean, scale, rotation, alpha, colour, sh;
  for (std::size_t j = 0; j < order.size(); ++j) {
    const std::size_t i = order[j];
    mean.add(glm::length(DVec3(a.mean.get(i)) - DVec3(b.mean.get(j))));
    for (int c = 0; c < 3; ++c) scale.add(std::abs(double(a.log_scale.get(i)[c]) - double(b.log_scale.get(j)[c])));
    rotation.add(degrees_between(a.rotation.get(i), b.rotation.get(j)));
    alpha.add(std::abs(opacity(a.opacity_logit[i]) - opacity(b.opacity_logit[j])));
    for (std::size_t c = 0; c < 3; ++c) {
      colour.add(sh_c0 * std::abs(double(a.sh_row(i)[c * in]) - double(b.sh_row(j)[c * out])));
      for (std::size_t k = 1; k < std::min(in, out); ++k)
        sh.add(std::abs(double(a.sh_row(i)[c * in + k]) - double(b.sh_row(j)[c * out + k])));
    }
  }
  return {mean.as("positions", "world units"), scale.as("log scales", "natural logarithm"),
          rotation.as("rotations", "degrees"), alpha.as("opacities", "of 1"),
          colour.as("colours", "of 1"),        sh.as("SH", "as stored")};
}

}  // namespace engine::io
