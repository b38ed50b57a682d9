// A trained 3D Gaussian scene as plain arrays, in stored (pre-activation) form.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/soa.h"

namespace engine::scene {

constexpr int max_sh_degree = 3;

/// Coefficients per colour channel of spherical harmonics up to `degree`: 1, 4, 9, 16.
constexpr std::size_t sh_coefficients(int degree) { return std::size_t(degree + 1) * std::size_t(degree + 1); }

/// N Gaussians, structure of arrays. Values are as the file stores them; what rendering uses is in brackets.
/// Invariant: every array has the length that size() and sh_degree say.
///
/// `extra` holds what the rows of the input file contain beside the Gaussian itself, as opaque bytes of fixed length
/// per row. They travel with the row, a copy inherits them, and the writer puts them back where they were.
struct GaussianCloud {
  int sh_degree = 0;                 ///< 0..3: the degree that `sh` holds.
  Array3 mean;                       ///< World units.
  Array3 log_scale;                  ///< [sigma = exp(log_scale), world units, along the local axes]
  Array4 rotation;                   ///< Quaternion w, x, y, z, any length but zero. [normalised; world_from_local]
  std::vector<float> opacity_logit;  ///< [opacity = 1 / (1 + exp(-logit))]
  std::vector<float> sh;             ///< [N][3][sh_coefficients(sh_degree)]: red, green, blue; coefficient 0 is DC.
  std::size_t extra_stride = 0;      ///< Bytes of `extra` per row.
  std::vector<std::byte> extra;      ///< [N][extra_stride]

  [[nodiscard]] std::size_t size() const { return opacity_logit.size(); }
  [[nodiscard]] std::size_t sh_stride() const { return 3 * sh_coefficients(sh_degree); }
  [[nodiscard]] std::span<const float> sh_row(std::size_t i) const {
    return {sh.data() + i * sh_stride(), sh_stride()};
  }
  [[nodiscard]] std::span<float> sh_row(std::size_t i) { return {sh.data() + i * sh_stride(), sh_stride()}; }
  [[nodiscard]] std::span<const std::byte> extra_row(std::size_t i) const {
    return {extra.data() + i * extra_stride, extra_stride};
  }

  /// Makes room for n rows; new ones are zero.
  void resize(std::size_t n);
  bool operator==(const GaussianCloud&) const = default;
};

/// Appends copies of the given rows of `from` (which may be `to` itself) to `to`, everything included.
/// Both clouds have the same sh_degree and extra_stride (asserted).
void append_rows(GaussianCloud& to, const GaussianCloud& from, std::span<const std::uint32_t> rows);

/// A cloud of copies of these rows, in the order given, everything included.
[[nodiscard]] GaussianCloud gather(const GaussianCloud& cloud, std::span<const std::uint32_t> rows);

/// The rows with keep[i] != 0, in order. keep: [N].
[[nodiscard]] GaussianCloud select(const GaussianCloud& cloud, std::span<const std::uint8_t> keep);

/// Drops trailing SH bands in which every byte is zero, which is lossless. (-0.0 is not all zero bytes.)
void drop_empty_sh_bands(GaussianCloud& cloud);

/// The first value that is NaN or infinite, as "[row].property" with the usual property names of a .ply file
/// ("[1204].opacity", "[3].f_rest_17"); nothing if all is well.
[[nodiscard]] std::optional<std::string> first_not_finite(const GaussianCloud& cloud);

/// Axis-aligned box of the means, ignoring nothing. {0,0,0} twice for an empty cloud.
struct Bounds {
  Vec3 low{0}, high{0};
};
[[nodiscard]] Bounds bounds(const GaussianCloud& cloud);

}  // namespace engine::scene
