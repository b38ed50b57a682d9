// Frames of scene files, and turning a scene from one to the other.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/rotate_sh.h"

namespace engine::io {

/// The matrix that takes a vector in a frame to right, down, front (RDF), the frame of INRIA's files.
///   axes     three of "LRUDFB", one of each pair, for x, y and z: "RUB", "RFU"; asserted
///   returns  orthogonal, of -1, 0 and 1; a mirror where the frame is left-handed
[[nodiscard]] DMat3 rdf_from(std::string_view axes);

/// An orthogonal matrix, and all that applying it to Gaussians takes.
class Turn {
 public:
  explicit Turn(const DMat3& turn);

  /// Turns the mean, the rotation and the SH of one row. Where the matrix only changes signs, nothing is rounded, and
  /// applying it again undoes it.
  void apply(scene::GaussianCloud& cloud, std::size_t row) const;
  [[nodiscard]] bool is_identity() const { return identity_; }

 private:
  DMat3 turn_;
  bool identity_ = false, signs_only_ = false;
  Quat left_;                                     ///< Turns a rotation from the left, after rotation_signs_.
  std::array<float, 3> rotation_signs_{1, 1, 1};  ///< Of x, y and z of a quaternion.
  std::array<float, 16> sh_signs_{};              ///< Where only signs change.
  scene::ShRotation sh_;
};

/// All rows.
void turn(scene::GaussianCloud& cloud, const DMat3& by);

}  // namespace engine::io
