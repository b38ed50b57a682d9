// SOG, "spatially ordered Gaussians": numbers as pictures with palettes. Bundled (a zip file), as a folder, and
// streamed (levels of detail, each a folder). Source: PlayCanvas, "The SOG Format", versions 1 and 2, 2025-2026.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/read_options.h"
#include "engine/io/scene_origin.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Is this the text of SOG's meta.json, or of a streamed one's lod-meta.json?
[[nodiscard]] bool looks_like_sog_meta(std::span<const std::byte> start);

/// Bytes that the Gaussians of a bundled file take in memory, by its meta.json: at least the file's own size, and that
/// alone where it cannot be read, or takes more than options.memory lends.
[[nodiscard]] std::uint64_t expected_sog_bytes(std::span<const std::byte> zip, const ReadOptions& options = {});

/// Decodes a bundled file: meta.json or lod-meta.json and pictures, at the root of a zip file or in one folder of it.
/// The numbers are in right, down, front, as the .ply they were made of: what PlayCanvas' tools write, though the
/// format's text says up. Of a streamed scene, level options.level; a branch without it gives its nearest finer one.
///   errors  unsupported: a zip file that holds no scene, another version, lossless pictures of another kind than WebP
///           corrupt_data: pictures or numbers that contradict each other; a picture that is missing or outside of the
///           folder; damage
///           invalid_argument: no such level; unprocessable; too_large; those of options.memory
///   `where` is "<file>:meta.json.means.files[0]" or "<file>:means_l.webp"
[[nodiscard]] Result<DecodedScene> decode_sog(std::span<const std::byte> zip, const std::string& file,
                                              const ReadOptions& options);

/// The same from a folder.
///   folder  that holds lod-meta.json or meta.json
///   errors  besides: those of InputFile; invalid_argument: neither file is there
[[nodiscard]] Result<DecodedScene> read_sog_folder(const std::filesystem::path& folder, const ReadOptions& options);

/// Bundled, version 2. Rows come in an order of place. Rounded to what the format holds: the logarithm of a position to
/// 1/65535 of its range, rotation components to 1/180, opacity to 1/255, log scales and colours to the nearest of 256,
/// SH to the nearest of a palette of up to 65,536 (exact where no more differ), its numbers to the nearest of 256. A
/// cloud that was read gives the same bytes again.
///   errors  too_large: more Gaussians than pictures have room for
[[nodiscard]] Result<std::vector<std::byte>> encode_sog(const scene::GaussianCloud& cloud, bool antialiased,
                                                        const std::string& file);

/// The order in which encode_sog() writes the rows.
[[nodiscard]] std::vector<std::uint32_t> sog_order(const scene::GaussianCloud& cloud);

}  // namespace engine::io
