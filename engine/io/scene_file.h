// Scene files of every format we know.
#pragma once

#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/ply_layout.h"
#include "engine/io/read_options.h"

namespace engine::io {

/// Formats a scene can be written in.
enum class SceneFormat {
  ply,    ///< INRIA: everything, and the only one that gives rows back byte for byte.
  splat,  ///< 32 bytes per Gaussian; no SH beyond DC.
  spz     ///< Version 3; about a tenth of the size, rounded.
};

/// Reads an INRIA .ply, a compressed .ply (PlayCanvas, SuperSplat), a .splat or an .spz file; which one, its content
/// says and not its name. The layout of any but the first is inria_layout() of the scene's SH degree.
///   errors  unsupported: none of these; else those of the format (ply.h, compressed_ply.h, splat.h, spz.h).
///           `where` begins with the file's base name.
[[nodiscard]] Result<SceneFile> read_scene(const std::filesystem::path& path, const ReadOptions& options = {});

/// Writes atomically. A .splat or .spz keeps neither unknown properties nor full precision.
///   errors  those of write_ply(), encode_spz() and AtomicFile
[[nodiscard]] Result<void> write_scene(const std::filesystem::path& path, const SceneFile& scene, SceneFormat format);

/// The format that a file's extension names, in either case: .ply, .splat, .spz.
///   errors  unsupported: another extension
[[nodiscard]] Result<SceneFormat> format_for(const std::filesystem::path& path);

}  // namespace engine::io
