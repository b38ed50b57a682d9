#include "engine/scene/rotate_sh.h"

#include <cmath>
#include <cstddef>
#include <numbers>

#include "engine/scene/sh.h"

namespace engine::scene {
namespace {

constexpr int degree = 3;
constexpr std::size_t coefficients_of_degree = 16;

/// A point of Lebedev's rule and the basis there, already multiplied by the weight.
struct Node {
  DVec3 direction;
  std::array<double, coefficients_of_degree> weighted_basis;
};

// One of each antipodal pair of the 26 points: 3 of 6 axes, 6 of 12 edge midpoints, 4 of 8 corners. Y_m Y_n of one band
// is even, so the other half would add the same again.
constexpr std::size_t nodes = 13;

std::array<Node, nodes> lebedev_nodes() {
  const double e = std::sqrt(0.5), c = std::sqrt(1.0 / 3.0);
  const std::array<DVec3, nodes> directions{DVec3{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {e, e, 0},  {e, -e, 0},
                                            {e, 0, e},      {e, 0, -e}, {0, e, e}, {0, e, -e}, {c, c, c},
                                            {c, c, -c},     {c, -c, c}, {-c, c, c}};
  std::array<Node, nodes> rule{};
  for (std::size_t j = 0; j < nodes; ++j) {
    const double share = j < 3 ? 1.0 / 21 : j < 9 ? 4.0 / 105 : 9.0 / 280;  // of the sphere, per point of the 26
    rule[j].direction = directions[j];
    sh_basis(degree, directions[j].x, directions[j].y, directions[j].z, rule[j].weighted_basis.data());
    for (double& value : rule[j].weighted_basis) value *= 2 * 4 * std::numbers::pi * share;
  }
  return rule;
}

template <std::size_t n>
void rotate_band(const std::array<double, n * n>& matrix, float* band) {
  std::array<double, n> before;
  for (std::size_t k = 0; k < n; ++k) before[k] = band[k];
  for (std::size_t m = 0; m < n; ++m) {
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) sum += matrix[m * n + k] * before[k];
    band[m] = float(sum);
  }
}

/// Adds the term of one node to a band's matrix; `first` is the band's first coefficient.
template <std::size_t n>
void accumulate(std::array<double, n * n>& matrix, std::size_t first, const Node& node, const double* basis_before) {
  for (std::size_t m = 0; m < n; ++m)
    for (std::size_t k = 0; k < n; ++k) matrix[m * n + k] += node.weighted_basis[first + m] * basis_before[first + k];
}

/// before(d) is where what is seen along d was seen along before the turn.
template <class Before>
ShRotation matrices(Before&& before) {
  static const std::array<Node, nodes> rule = lebedev_nodes();
  ShRotation result{};
  for (const Node& node : rule) {
    const DVec3 d = before(node.direction);
    std::array<double, coefficients_of_degree> basis;
    sh_basis(degree, d.x, d.y, d.z, basis.data());
    accumulate<3>(result.band1, 1, node, basis.data());
    accumulate<5>(result.band2, 4, node, basis.data());
    accumulate<7>(result.band3, 9, node, basis.data());
  }
  return result;
}

}  // namespace

ShRotation sh_rotation(const DQuat& rotation) {
  const DQuat inverse = glm::conjugate(rotation);
  return matrices([&](DVec3 d) { return inverse * d; });
}

ShRotation sh_rotation(const DMat3& turn) {
  const DMat3 inverse = glm::transpose(turn);
  return matrices([&](DVec3 d) { return inverse * d; });
}

void rotate_sh(const ShRotation& rotation, std::span<float> coefficients) {
  if (coefficients.size() >= 4) rotate_band<3>(rotation.band1, coefficients.data() + 1);
  if (coefficients.size() >= 9) rotate_band<5>(rotation.band2, coefficients.data() + 4);
  if (coefficients.size() >= 16) rotate_band<7>(rotation.band3, coefficients.data() + 9);
}

}  // namespace engine::scene
