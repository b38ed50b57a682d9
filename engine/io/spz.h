// .spz files, versions 1 to 4, with extensions. Source: Niantic, "SPZ file format" and "SPZ extensions", 2024-2026.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/quantised.h"
#include "engine/io/read_options.h"
#include "engine/io/scene_origin.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

constexpr double spz_colour_scale = 0.15;  ///< Of this format; wider than sh_c0 to keep colours beyond 0..1.
constexpr double spz_least_log_scale = -10, spz_log_scale_steps = 16;  ///< Steps in one.
constexpr double spz_sh_steps = 128;                                   ///< In one; byte 128 is 0.

constexpr StoredRange spz_f_dc{-0.5 / spz_colour_scale, 0.5 / spz_colour_scale, 1 / (255 * spz_colour_scale)};
constexpr StoredRange spz_log_scales{spz_least_log_scale, spz_least_log_scale + 255 / spz_log_scale_steps,
                                     1 / spz_log_scale_steps};
constexpr StoredRange spz_sh{-128 / spz_sh_steps, 127 / spz_sh_steps, 1 / spz_sh_steps};

/// Do these first bytes of a file say gzip (versions 1 to 3) or "NGSP" (version 4)?
[[nodiscard]] bool looks_like_spz(std::span<const std::byte> bytes);

/// Bytes that the Gaussians of a file take in memory, by its header: at least the file's own size, and that alone where
/// the header says nothing that the file could hold.
///   start  of the file: 4096 bytes are plenty
[[nodiscard]] std::uint64_t expected_spz_bytes(std::span<const std::byte> start, std::uint64_t file_bytes);

/// How many Gaussians a file holds, and their SH degree, by its header: no more than its bytes could unpack to.
struct SpzCount {
  std::uint64_t count = 0;
  int sh_degree = 0;
};
///   errors  those of decode_spz() that a header can cause
[[nodiscard]] Result<SpzCount> read_spz_header(std::span<const std::byte> bytes, const std::string& file);

/// Decodes a whole file into the frame of an INRIA .ply file, right, down, front: from the axes that an extension
/// declares, else from RUB (see SpzFrame). Opacity as logit_of_byte() says. Extensions are kept as they are.
///   errors  corrupt_data: sizes that contradict each other, damaged compression, NaN in version 1
///           unsupported: another version, SH degree 4, axes of an unknown number
///           unprocessable, too_large: asked before anything is unpacked; those of options.memory
[[nodiscard]] Result<DecodedScene> decode_spz(std::span<const std::byte> bytes, const std::string& file,
                                              const ReadOptions& options);

/// What an .spz file holds beside Gaussians.
struct SpzOptions {
  int version = 4;                            ///< 3 or 4.
  std::string axes = "RUB";                   ///< One of the 16 that the format can declare; written down in version 4.
  bool antialiased = false;                   ///< A hint for viewers.
  std::vector<SpzExtension> extensions = {};  ///< Written as they are.
};

/// Rows in their order, rounded to what the format holds: position to 1/4096 (coarser only if a mean lies beyond
/// +-2048), log scale to 1/16 in [-10, 5.9375], SH to 1/128 in [-1, 1].
///   errors  unprocessable: a mean beyond +-8 388 608, the farthest the format reaches; invalid_argument: the axes
[[nodiscard]] Result<std::vector<std::byte>> encode_spz(const scene::GaussianCloud& cloud, const std::string& file,
                                                        const SpzOptions& options = {});

}  // namespace engine::io
