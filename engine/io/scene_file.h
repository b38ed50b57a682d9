// Scene files of every format we know.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/ply_layout.h"
#include "engine/io/read_options.h"

namespace engine::io {

/// Reads an INRIA .ply, a compressed .ply (PlayCanvas, SuperSplat), a .splat, an .spz, a .sog or a .glb file; which
/// one, its content says and not its name. Of SOG also a folder, and the meta.json or lod-meta.json in it. All are
/// turned to right, down, front, the frame of the first. The layout of any but the first is inria_layout() of the
/// scene's SH degree.
///   errors  unsupported: none of these; else those of the format (ply.h, compressed_ply.h, splat.h, spz.h, sog.h,
///   glb.h).
///           `where` begins with the file's base name.
[[nodiscard]] Result<SceneFile> read_scene(const std::filesystem::path& path, const ReadOptions& options = {});

/// The format of a file, by its content; one that read_scene() refuses may be taken for any.
///   errors  those of InputFile
[[nodiscard]] Result<SceneFormat> detect_format(const std::filesystem::path& path);

/// Writes atomically. Only a .ply keeps unknown properties; only a .ply and a .glb keep full precision. An .spz file
/// keeps what the .spz file that the scene came from said beside its Gaussians.
///   errors  those of write_ply(), encode_compressed_ply(), encode_spz(), encode_sog(), encode_glb() and AtomicFile
[[nodiscard]] Result<void> write_scene(const std::filesystem::path& path, const SceneFile& scene, SceneFormat format);

/// The rows of a scene in the order in which write_scene() writes them: their own, but in a .sog file, and in a
/// compressed .ply file where the scene comes from another format.
[[nodiscard]] std::vector<std::uint32_t> written_order(const SceneFile& scene, SceneFormat format);

/// The format that a file's extension names, in either case: .ply, .compressed.ply, .splat, .spz, .sog, .glb.
///   errors  unsupported: another extension
[[nodiscard]] Result<SceneFormat> format_for(const std::filesystem::path& path);

}  // namespace engine::io
