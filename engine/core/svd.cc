#include "engine/core/svd.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace engine {
namespace {

using Row = Matrix4::value_type;

/// The largest root of x^4 + c2 x^2 + c1 x + c0, whose roots are all real, from above: each of Newton's steps stays
/// there.
double largest_root(double c2, double c1, double c0, double above) {
  double x = above;
  constexpr int most_steps = 60;  // a triple root halves its distance in each step; a single one takes six
  for (int step = 0; step < most_steps; ++step) {
    const double value = ((x * x + c2) * x + c1) * x + c0, slope = (4 * x * x + 2 * c2) * x + c1;
    if (!(slope > 0)) break;
    const double next = x - value / slope;
    if (!(std::abs(next - x) > 1e-15 * above)) break;
    x = next;
  }
  return x;
}

/// Signed minor of a 4 x 4 matrix.
double cofactor(const Matrix4& n, std::size_t row, std::size_t column) {
  std::array<std::size_t, 3> r{}, c{};
  for (std::size_t k = 0; k < 3; ++k) r[k] = k < row ? k : k + 1, c[k] = k < column ? k : k + 1;
  const auto at = [&](std::size_t a, std::size_t b) { return n[r[a]][c[b]]; };
  const double minor = at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
                       at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
                       at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  return (row + column) % 2 == 0 ? minor : -minor;
}

}  // namespace

Matrix4 horn_matrix(const DMat3& m) {
  // In his letters S_ab = sum from_a to_b, which is m[a][b]: GLM's columns come first.
  Matrix4 n{Row{m[0][0] + m[1][1] + m[2][2], m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]},
            Row{0, m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[2][0] + m[0][2]},
            Row{0, 0, m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1]}, Row{0, 0, 0, m[2][2] - m[0][0] - m[1][1]}};
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = 0; b < a; ++b) n[a][b] = n[b][a];
  return n;
}

Svd decompose(DMat3 m) {
  DMat3 v(1.0);
  constexpr int enough = 6;  // sweeps: 3 x 3 settles within as many
  for (int sweep = 0; sweep < enough; ++sweep)
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      const double angle = 0.5 * std::atan2(2 * glm::dot(m[p], m[q]), glm::dot(m[p], m[p]) - glm::dot(m[q], m[q]));
      const double c = std::cos(angle), s = std::sin(angle);
      for (DMat3* matrix : {&m, &v}) {  // the longer column comes first: the angle is in [-pi/2, pi/2]
        const DVec3 first = c * (*matrix)[p] + s * (*matrix)[q];
        (*matrix)[q] = c * (*matrix)[q] - s * (*matrix)[p];
        (*matrix)[p] = first;
      }
    }
  const auto unit = [](DVec3 a, DVec3 otherwise) {
    const double length = glm::length(a);
    return length > 0 ? a / length : otherwise;
  };
  const DVec3 x = unit(m[0], {1, 0, 0});
  const DVec3 across = std::abs(x.x) < 0.9 ? DVec3(1, 0, 0) : DVec3(0, 1, 0);
  const DVec3 y = unit(m[1] - glm::dot(m[1], x) * x, glm::normalize(across - glm::dot(across, x) * x));
  const DMat3 u(x, y, glm::cross(x, y));
  return {u, v, DVec3(glm::dot(m[0], u[0]), glm::dot(m[1], u[1]), glm::dot(m[2], u[2]))};
}

DQuat nearest_rotation(const DMat3& m) {
  double largest = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(m[column][row]));
  if (!(largest > 0)) return {1, 0, 0, 0};
  const DMat3 s = m / largest;  // its fourth powers neither over- nor underflow
  double squared = 0, fourth = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const double product = glm::dot(s[a], s[b]);
      fourth += product * product;
      if (a == b) squared += product;
    }
  const double value =
      largest_root(-2 * squared, -8 * glm::determinant(s), 2 * fourth - squared * squared, std::sqrt(3 * squared));
  Matrix4 n = horn_matrix(s);
  for (std::size_t k = 0; k < 4; ++k) n[k][k] -= value;
  // Each column of the adjugate is the eigenvector, times one of its components: the longest is the most exact.
  Row best{};
  double longest = 0;
  for (std::size_t column = 0; column < 4; ++column) {
    Row vector{};
    double length = 0;
    for (std::size_t row = 0; row < 4; ++row)
      vector[row] = cofactor(n, row, column), length += vector[row] * vector[row];
    if (length > longest) longest = length, best = vector;
  }
  // Two eigenvalues that differ by less than the root of rounding have no eigenvectors of their own left in this:
  // the singular vectors decide.
  constexpr double degenerate = 1e-14;  // squared length; entries of the matrix are of order 1
  if (!(longest > degenerate)) {
    const Svd parts = decompose(s);
    return glm::normalize(glm::quat_cast(parts.u * glm::transpose(parts.v)));
  }
  const double scale = (best[0] < 0 ? -1 : 1) / std::sqrt(longest);
  return {best[0] * scale, best[1] * scale, best[2] * scale, best[3] * scale};
}

}  // namespace engine
