// Hand-made compressed .ply files.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "tests/engine/io/samples.h"

namespace engine::io {

struct CompressedSample {
  std::vector<std::array<float, 18>> ranges;       ///< Minima and maxima of position, scale, colour per chunk.
  std::vector<std::array<std::uint32_t, 4>> rows;  ///< Position, rotation, scale, colour.
  std::vector<std::vector<std::uint8_t>> sh;       ///< f_rest bytes per row; none at all: no element.
  bool colour_ranges = true;

  static CompressedSample random(std::size_t count, int degree) {
    CompressedSample sample;
    Rng rng(count, std::uint64_t(degree));
    for (std::size_t i = 0; i < (count + 255) / 256; ++i) {
      auto& range = sample.ranges.emplace_back();
      for (std::size_t k = 0; k < 18; ++k) range[k] = rng.uniform(-1, 0) + (k / 3 % 2 ? 1.5f : 0.0f);
    }
    const std::size_t sh_bytes = 3 * (scene::sh_coefficients(degree) - 1);
    for (std::size_t i = 0; i < count; ++i) {
      sample.rows.push_back({rng.next(), rng.next(), rng.next(), rng.next()});
      if (degree == 0) continue;
      auto& row = sample.sh.emplace_back();
      for (std::size_t j = 0; j < sh_bytes; ++j) row.push_back(std::uint8_t(rng.next()));
    }
    return sample;
  }

  [[nodiscard]] std::string bytes() const {
    std::string out = "ply\nformat binary_little_endian 1.0\ncomment packed\nelement chunk ";
    out += std::to_string(ranges.size()) + "\n";
    const std::size_t range_count = colour_ranges ? 18 : 12;
    for (std::size_t k = 0; k < range_count; ++k) {
      const std::string range = k / 3 % 2 ? "max_" : "min_";
      const std::string of = k >= 6 && k < 12 ? "scale_" : "";
      const std::string_view axes = k < 12 ? "xyz" : "rgb";
      out += "property float " + range + of + axes[k % 3] + "\n";
    }
    out += "element vertex " + std::to_string(rows.size()) + "\n";
    for (const char* name : {"position", "rotation", "scale", "color"})
      out += "property uint packed_" + std::string(name) + "\n";
    if (!sh.empty()) {
      out += "element sh " + std::to_string(sh.size()) + "\n";
      for (std::size_t j = 0; j < sh[0].size(); ++j) out += "property uchar f_rest_" + std::to_string(j) + "\n";
    }
    out += "end_header\n";
    for (const auto& range : ranges)
      for (std::size_t k = 0; k < range_count; ++k) append(out, range[k]);
    for (const auto& row : rows)
      for (const std::uint32_t word : row) append(out, word);
    for (const auto& row : sh)
      for (const std::uint8_t byte : row) append(out, byte);
    return out;
  }
};

}  // namespace engine::io
