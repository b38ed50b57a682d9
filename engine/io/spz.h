// .spz files, versions 1 to 4. Source: Niantic, "SPZ file format", 2024-2025.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/read_options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Do these first bytes of a file say gzip (versions 1 to 3) or "NGSP" (version 4)?
[[nodiscard]] bool looks_like_spz(std::span<const std::byte> bytes);

/// Bytes that the Gaussians of a file take in memory, by its header: at least the file's own size, and that alone where
/// the header says nothing that the file could hold.
///   start  of the file: 4096 bytes are plenty
[[nodiscard]] std::uint64_t expected_spz_bytes(std::span<const std::byte> start, std::uint64_t file_bytes);

/// Decodes a whole file into the frame of an INRIA .ply file (see SpzFrame). Opacity as logit_of_byte() says; the
/// extensions that version 4 can hold (hints for viewers) are skipped.
///   errors  corrupt_data: sizes that contradict each other, damaged compression, NaN in version 1
///           unsupported: another version, SH degree 4, extensions in versions 1 to 3 (they have no fixed place there)
///           unprocessable, too_large: asked before anything is unpacked; those of options.memory
[[nodiscard]] Result<scene::GaussianCloud> decode_spz(std::span<const std::byte> bytes, const std::string& file,
                                                      const ReadOptions& options);

/// Version 3 (gzip) in frame RUB, rows in their order, rounded to what the format holds: position to 1/4096 (coarser
/// only if a mean lies beyond +-2048), log scale to 1/16 in [-10, 5.9375], SH to 1/128 in [-1, 1].
///   errors  unprocessable: a mean beyond +-8 388 607, the farthest the format reaches
[[nodiscard]] Result<std::vector<std::byte>> encode_spz(const scene::GaussianCloud& cloud, const std::string& file);

}  // namespace engine::io
