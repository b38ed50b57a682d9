// COLMAP sparse models, binary and text.
// Source: the file layouts documented by COLMAP (github.com/colmap/colmap, "Output Format").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/shot.h"

namespace engine::io {

/// Lenses by camera_id.
using ColmapCameras = std::unordered_map<std::uint32_t, Lens>;

/// The two encodings of a COLMAP model.
enum class ColmapEncoding { binary, text };

/// cameras.bin or cameras.txt. Known models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE,
/// SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE. The numbers in a lens are finite; whether they make a camera is for
/// undistorted_camera() to say.
///   file    name for error addresses: "cameras.bin"
///   errors  corrupt_data: the file contradicts itself or ends early; unsupported: another camera model
[[nodiscard]] Result<ColmapCameras> parse_colmap_cameras(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                                         const std::string& file);

/// images.bin or images.txt, in file order. 2D points are skipped.
///   errors  corrupt_data, naming the field: "images.bin:image[17].camera_id", "images.txt:line[8].qw"
[[nodiscard]] Result<std::vector<Shot>> parse_colmap_images(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                                            const std::string& file, const ColmapCameras& cameras);

/// points3D.bin or points3D.txt, in file order. Tracks are skipped.
///   errors  corrupt_data: "points3D.bin:point[3].x"
[[nodiscard]] Result<std::vector<Point>> parse_colmap_points(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                                             const std::string& file);

}  // namespace engine::io
