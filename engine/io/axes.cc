#include "engine/io/axes.h"

#include <cassert>
#include <cmath>
#include <span>

#include "engine/core/parallel.h"

namespace engine::io {
namespace {

constexpr std::size_t rows_per_task = 4096;  // of a parallel task: a choice

DVec3 direction(char axis) {
  switch (axis) {
    case 'L':
      return {-1, 0, 0};
    case 'U':
      return {0, -1, 0};
    case 'D':
      return {0, 1, 0};
    case 'F':
      return {0, 0, 1};
    case 'B':
      return {0, 0, -1};
    default:
      return {1, 0, 0};
  }
}

/// Entries that are 0, 1 or -1 but for rounding become that: a quarter turn shall not leave 1e-17 where 0 was.
template <std::size_t n>
void snap(std::array<double, n>& matrix) {
  for (double& value : matrix)
    if (std::abs(value - std::round(value)) < 1e-12) value = std::round(value);
}

template <std::size_t n>
void take_diagonal(const std::array<double, n * n>& matrix, std::size_t first, std::array<float, 16>& signs) {
  for (std::size_t k = 0; k < n; ++k) signs[first + k] = float(matrix[k * n + k]);
}

}  // namespace

DMat3 rdf_from(std::string_view axes) {
  assert(axes.size() == 3);
  return {direction(axes[0]), direction(axes[1]), direction(axes[2])};
}

Turn::Turn(const DMat3& turn) : turn_(turn), sh_(scene::sh_rotation(turn)) {
  snap(sh_.band1), snap(sh_.band2), snap(sh_.band3);
  identity_ = turn == DMat3(1.0);
  signs_only_ = true;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) signs_only_ = signs_only_ && (c == r ? std::abs(turn[c][r]) == 1 : turn[c][r] == 0);
  // Sign changes D act on a rotation R as D R D, which is a rotation also where D mirrors, and the same Gaussian as D
  // R: its extent along a local axis knows no sign. Any other mirror is a rotation after a sign change.
  const bool mirrors = glm::determinant(turn) < 0;
  DVec3 signs(1.0);
  if (signs_only_)
    signs = {turn[0][0], turn[1][1], turn[2][2]};
  else if (mirrors)
    signs = {1, 1, -1};
  const double all = signs.x * signs.y * signs.z;
  for (int c = 0; c < 3; ++c) rotation_signs_[std::size_t(c)] = float(all * signs[c]);
  DMat3 rest = turn;
  for (int c = 0; c < 3; ++c) rest[c] *= signs[c];
  left_ = Quat(glm::normalize(glm::quat_cast(rest)));
  sh_signs_[0] = 1;
  take_diagonal<3>(sh_.band1, 1, sh_signs_);
  take_diagonal<5>(sh_.band2, 4, sh_signs_);
  take_diagonal<7>(sh_.band3, 9, sh_signs_);
}

void Turn::apply(scene::GaussianCloud& cloud, std::size_t row) const {
  if (identity_) return;
  const Vec3 mean = cloud.mean.get(row);
  Quat q = cloud.rotation.get(row);
  q.x *= rotation_signs_[0], q.y *= rotation_signs_[1], q.z *= rotation_signs_[2];
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  const auto sh = cloud.sh_row(row);
  if (signs_only_) {
    cloud.mean.set(row, {float(turn_[0][0]) * mean.x, float(turn_[1][1]) * mean.y, float(turn_[2][2]) * mean.z});
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 1; k < coefficients; ++k) sh[c * coefficients + k] *= sh_signs_[k];
  } else {
    cloud.mean.set(row, Vec3(turn_ * DVec3(mean)));
    q = left_ * q;
    for (std::size_t c = 0; c < 3; ++c) scene::rotate_sh(sh_, sh.subspan(c * coefficients, coefficients));
  }
  cloud.rotation.set(row, q);
}

void turn(scene::GaussianCloud& cloud, const DMat3& by) {
  const Turn turn(by);
  if (turn.is_identity()) return;
  parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) turn.apply(cloud, i);
  });
}

}  // namespace engine::io
