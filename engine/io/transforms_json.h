// transforms.json of nerfstudio, instant-ngp and NeRF-synthetic.
// Source: nerfstudio's data conventions (docs.nerf.studio), instant-ngp's data/nerf readme.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/image_file.h"
#include "engine/io/shot.h"

namespace engine::io {

/// Which world the poses are wanted in.
enum class TransformsWorld {
  as_in_file,      ///< That of the poses as written.
  before_applied,  ///< applied_transform and applied_scale, if the file has them, undone: the reconstruction's own.
};

/// The views in file order. A frame's own intrinsics win over those of the whole file.
///   file     name for error addresses: "transforms.json"
///   size_of  size of the photo with this file_path; asked only where the file leaves out w and h
///   errors   corrupt_data, naming the field: "transforms.json:frames[3].transform_matrix[1][2]";
///            unsupported: a camera model other than PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and
///            OPENCV_FISHEYE; whatever size_of answers
[[nodiscard]] Result<std::vector<Shot>> parse_transforms_json(
    std::span<const std::byte> bytes, const std::string& file, TransformsWorld world,
    const std::function<Result<PictureSize>(const std::string& file_path)>& size_of);

}  // namespace engine::io
