// Point clouds in .ply files: points3D.ply and input.ply, which 3DGS trainers write beside their cameras.
#pragma once

#include <filesystem>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/shot.h"

namespace engine::io {

/// Element `vertex` of a binary little-endian .ply file: x, y, z of type float or double, and red, green, blue of type
/// uchar, which may be absent (black). Other properties are skipped.
///   errors  those of InputFile, read_ply_header() and element_offsets();
///           unsupported: no such properties; corrupt_data: NaN or infinity, "points3D.ply:vertex[7].x"
[[nodiscard]] Result<std::vector<Point>> read_ply_points(const std::filesystem::path& path);

}  // namespace engine::io
