// Pictures of raw bytes as WebP without loss: what SOG keeps its numbers in. By libwebp itself: OpenImageIO multiplies
// alpha into the other channels, and its writer lets the encoder change what lies under an alpha of zero.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/memory_budget.h"
#include "engine/core/result.h"

namespace engine::io {

/// Pixels of four bytes, rows from the top.
struct BytePicture {
  std::size_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;  ///< [height][width][4]; alpha is a number like the others.
  bool exact = true;               ///< False: the file was compressed with loss, so the numbers are not those put in.
  MemoryBudget::Share memory = {};

  [[nodiscard]] std::size_t pixels() const { return width * height; }
  [[nodiscard]] const std::uint8_t* pixel(std::size_t i) const { return rgba.data() + 4 * i; }
  [[nodiscard]] std::uint8_t* pixel(std::size_t i) { return rgba.data() + 4 * i; }
};

/// Decodes a WebP file.
///   max_pixels  asked of the header, before memory is allocated
///   errors      unsupported: no WebP, or an animation
///               corrupt_data: damaged, or more than max_pixels; those of `budget`
[[nodiscard]] Result<BytePicture> decode_webp(std::span<const std::byte> bytes, std::uint64_t max_pixels,
                                              MemoryBudget* budget, const std::string& where);

/// Lossless, every byte as it is, also where alpha is 0; the same bytes every time.
///   errors  too_large: a side beyond 16383
[[nodiscard]] Result<std::vector<std::byte>> encode_webp(const BytePicture& picture, const std::string& where);

}  // namespace engine::io
