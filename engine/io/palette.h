// Few values in the place of many: codebooks of numbers, palettes of vectors. For formats that hold indices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace engine::io {

constexpr std::size_t codebook_entries = 256;

/// Up to 256 numbers, ascending; what is left of the 256 repeats the last.
struct Codebook {
  std::array<float, codebook_entries> values{};
  std::size_t used = 1;

  /// Index of the nearest number, the lower one of two as near.
  [[nodiscard]] std::uint8_t nearest(float value) const;
};

/// The numbers that stand for `values` with the least mean square error that Lloyd's iteration finds, starting from
/// quantiles and equal steps; exact where there are no more than 256 different ones. The same for any thread count. No
/// values: one entry of 0.
/// Source: Lloyd 1957 (1982), "Least squares quantization in PCM".
[[nodiscard]] Codebook codebook_of(std::span<const float> values);

/// Vectors that stand for others.
struct Palette {
  std::vector<float> entries;         ///< [count][dimensions]
  std::vector<std::uint32_t> labels;  ///< [N]: the entry that stands for each vector.
};

/// At most `max_entries` (at least 1) that stand for the rows; exact where there are no more than `exact_entries`
/// different ones. Found by splitting the rows in two again and again, first where the error is largest, each time by
/// 2-means from both sides along the direction in which they spread most. The same for any thread count.
///   rows  [N][dimensions], N below 2^32
[[nodiscard]] Palette palette_of(std::span<const float> rows, std::size_t dimensions, std::size_t max_entries,
                                 std::size_t exact_entries);

}  // namespace engine::io
