// Trained Gaussian scenes as INRIA .ply files. Rows are sacred: what is not edited is given back byte for byte.
#pragma once

#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/input_file.h"
#include "engine/io/ply_layout.h"
#include "engine/io/read_options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Reads a binary little-endian .ply file: Gaussian properties in any order and of any scalar type, SH degree 0 to 3,
/// unknown properties, further elements of fixed row length, comments, LF or CRLF. A quaternion may have any length,
/// zero included. Memory: the cloud and one block of rows.
///   errors  not_found, invalid_argument, unavailable: the file cannot be read
///           unsupported: ASCII, big-endian, lists, point clouds and meshes, more than SH degree 3
///           corrupt_data: a header that contradicts itself or the file's length; NaN or infinity
///           unprocessable: no vertices;  too_large: a limit of `options`, or a header of more than 1 MiB
///   `where` is "chair.ply:header" or "chair.ply:vertex[1204].opacity"
[[nodiscard]] Result<SceneFile> read_ply(const std::filesystem::path& path, const ReadOptions& options = {});
/// The same for a file whose header has been read.
[[nodiscard]] Result<SceneFile> read_ply(const InputFile& file, PlyHeader header, const ReadOptions& options);

/// Writes `cloud` in the given layout, atomically (see AtomicFile). A cloud as read gives back the file it came from,
/// byte for byte; with rows removed or appended only the vertex count in the header differs. SH bands that the layout
/// has and the cloud has not are written as zeros. A Gaussian property stored in another type than float32 keeps its
/// bytes if they still mean the cloud's value, and is otherwise rounded to that type, saturating.
///   errors  those of AtomicFile; unprocessable: no Gaussians; internal: the cloud does not fit the layout (SH degree
///           above it, another extra_stride), arrays of different lengths, NaN or infinity
[[nodiscard]] Result<void> write_ply(const std::filesystem::path& path, const scene::GaussianCloud& cloud,
                                     const PlyLayout& layout);

}  // namespace engine::io
