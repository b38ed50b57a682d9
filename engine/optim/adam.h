// Adam over groups of parameters.
// Source: Kingma and Ba 2015, "Adam: a method for stochastic optimization", algorithm 1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/result.h"

namespace engine::optim {

/// Constants of Adam, by the names of the paper.
struct AdamOptions {
  double beta1 = 0.9;    ///< Decay of the mean of gradients, 0 to below 1.
  double beta2 = 0.999;  ///< Decay of the mean of their squares, 0 to below 1.
  /// Added to the root of the mean square; above 0. What a gradient counts as "none": one much smaller than this moves
  /// its parameter by less than the rate. INRIA's 1e-15 lets everything count, rounding noise included; gradients of
  /// a mean over a picture are of the order 1e-7 to 1e-3.
  double epsilon = 1e-15;
};
[[nodiscard]] Result<void> validate(const AdamOptions& options);

/// What an Adam has to know of a group from the beginning: an array with `columns` values for each of `rows` rows.
struct AdamLayout {
  std::string name;         ///< For messages: "mean.x", "sh".
  std::size_t columns = 1;  ///< Values per row.
};

/// A group at one step.
struct AdamGroup {
  std::span<float> value;                ///< [rows][columns], updated in place.
  std::span<const float> gradient;       ///< [rows][columns]
  std::span<const double> rate;          ///< [1] or [columns]: learning rate of all, or of each column; 0 or more.
  std::span<const float> mobility = {};  ///< [rows] What each row's rates are multiplied by, 0 or more; empty: 1.
};

/// Holds the moments of all groups, which all have the same rows (Gaussians of the 3D mask). Each step
///   m = beta1 m + (1 - beta1) g,  v = beta2 v + (1 - beta2) g^2,
///   value -= rate * (m / (1 - beta1^t)) / (sqrt(v / (1 - beta2^t)) + epsilon),  t = 1, 2, ...
/// in float, the corrections in double. The same bits for any number of threads and any instruction set.
class Adam {
 public:
  /// Moments 0, t = 0. Precondition: validate(options).
  Adam(std::vector<AdamLayout> layout, std::size_t rows, const AdamOptions& options = {});

  /// One step over all groups, in the order of the layout (sizes asserted).
  ///   errors  internal: a gradient, a value or a moment is not finite. `where` names the first by group, then row
  ///           ("[1204].mean.x", "[3].sh[17]"); groups up to it have been stepped: parameters and moments are spoilt
  /// Allocates nothing. Costs a pass over four arrays: bound by memory from some ten thousand rows on.
  [[nodiscard]] Result<void> step(std::span<const AdamGroup> groups);

  /// Rows with keep[i] != 0 stay, in order. keep: [rows()].
  void keep_rows(std::span<const std::uint8_t> keep);
  /// Adds `count` rows with moments 0. The number of steps stays that of the whole, as usual in the field: the first
  /// steps of a row that joins late are up to (1 - beta1) / sqrt(1 - beta2) = 3.2 times the rate.
  void append_rows(std::size_t count);

  /// Writes moments and number of steps, for a checkpoint.
  void write(ByteWriter& out) const;
  /// Reads what write() of an Adam with this layout and rows wrote; other bytes leave `in` failed, the moments
  /// anything.
  void read(ByteReader& in);

  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  struct Moments {
    AdamLayout layout;
    std::vector<float> first, second;  ///< [rows][columns]
  };
  void fit_buffers();
  [[nodiscard]] tl::unexpected<Error> poisoned(const AdamLayout& layout, std::size_t index, bool by_gradient) const;

  AdamOptions options_;
  std::size_t rows_;
  std::uint64_t steps_ = 0;
  std::vector<Moments> groups_;
  std::vector<float> rate_;       ///< Rate of each column of the group at hand, bias correction included.
  std::vector<std::size_t> bad_;  ///< [chunk] First value of the chunk, in the group at hand, that is not finite.
};

}  // namespace engine::optim
