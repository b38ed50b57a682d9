// Adam over the parameters of a cloud of Gaussians.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/result.h"
#include "engine/optim/adam.h"
#include "engine/render/backward.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::train {

/// Learning rates of one iteration, per parameter in its stored form. 0: the parameter stays as it is.
struct IterationRates {
  double position = 0;       ///< World units.
  double sh_dc = 0;          ///< SH coefficient 0.
  double sh_rest = 0;        ///< The other SH coefficients.
  double opacity_logit = 0;  ///< Logits.
  double log_scale = 0;      ///< Natural logarithm of world units.
  double rotation = 0;       ///< Quaternion components.
};

/// What each row's rates are multiplied by, 0 or more; empty: 1.
struct Mobility {
  std::span<const float> position = {};  ///< [rows]
  std::span<const float> others = {};    ///< [rows] Of all other parameters.
};

/// optim::Adam with a group for each array of a cloud.
class CloudAdam {
 public:
  /// For clouds of this many rows and this degree. Precondition: validate(options).
  CloudAdam(std::size_t rows, int sh_degree, const optim::AdamOptions& options);

  /// One step of all rows.
  ///   cloud, gradients  of rows() rows and the degree
  ///   errors  internal: a gradient, parameter or moment is not finite; `where` is the first, with the property names
  ///           of a .ply file where it has one: "[12].opacity", "[3].sh[17]". Parameters are spoilt then.
  [[nodiscard]] Result<void> step(scene::GaussianCloud& cloud, const render::Gradients& gradients,
                                  const IterationRates& rates, const Mobility& mobility = {});

  /// Rows with keep[i] != 0 stay, in order. keep: [rows()].
  void keep_rows(std::span<const std::uint8_t> keep) { adam_.keep_rows(keep); }
  /// See optim::Adam::append_rows().
  void append_rows(std::size_t count) { adam_.append_rows(count); }
  [[nodiscard]] std::size_t rows() const { return adam_.rows(); }

  /// Writes the moments and counts, for a checkpoint.
  void write(ByteWriter& out) const { adam_.write(out); }
  /// Reads what write() of an object with the same rows and degree wrote. Other bytes leave `in` failed, and this
  /// object must not be used any more.
  void read(ByteReader& in) { adam_.read(in); }

 private:
  optim::Adam adam_;
};

}  // namespace engine::train
