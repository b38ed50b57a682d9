// Compressed .ply files of PlayCanvas and SuperSplat: 16 bytes per Gaussian, in chunks of 256 with a range each.
// Source: PlayCanvas, "Compressed PLY format", 2023-2024.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/input_file.h"
#include "engine/io/ply_header.h"
#include "engine/io/quantised.h"
#include "engine/io/read_options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// SH beyond DC: 256 bins from -4 to 4. What is read is a bin's middle, of the first and the last the ends.
constexpr double compressed_ply_most_sh = 4, compressed_ply_sh_bins = 256;
constexpr StoredRange compressed_ply_sh{-compressed_ply_most_sh, compressed_ply_most_sh,
                                        2 * compressed_ply_most_sh / compressed_ply_sh_bins};

/// Is this the header of a compressed file?
[[nodiscard]] bool is_compressed_ply(const PlyHeader& header);

/// Decodes the file; colour ranges per chunk and the `sh` element are optional. Opacity as logit_of_byte() says.
///   errors  corrupt_data: a property missing or of another type, a number of chunks or SH rows that does not fit the
///           vertices, a file shorter or longer than its header says, a range that is not finite
///           unsupported: ASCII, big-endian; unprocessable; too_large
[[nodiscard]] Result<scene::GaussianCloud> read_compressed_ply(const InputFile& file, const PlyHeader& header,
                                                               const ReadOptions& options);

/// 16 bytes per Gaussian and one for each SH coefficient beyond DC, in chunks of 256. Rounded to 11, 10 and 11 bits of
/// a chunk's range for position and log scale (within +-20), 10 bits for rotations, 8 for colours (of the chunk's
/// range), opacity and SH (within +-4). A cloud that was read gives the same bytes again, if its order is kept.
///   order  of the rows, all of them
[[nodiscard]] std::vector<std::byte> encode_compressed_ply(const scene::GaussianCloud& cloud,
                                                           std::span<const std::uint32_t> order);

}  // namespace engine::io
