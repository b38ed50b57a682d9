// cameras.json of an INRIA model directory.
// Source: Kerbl 2023, the reference implementation's output.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/shot.h"

namespace engine::io {

/// The views in file order; the world is that of the model's point cloud. Names are img_name, which most versions of
/// the trainer write without extension. The principal point, which the file does not hold, is the picture's middle.
///   file    name for error addresses: "cameras.json"
///   errors  corrupt_data, naming the field: "cameras.json:[4].position[1]"
[[nodiscard]] Result<std::vector<Shot>> parse_cameras_json(std::span<const std::byte> bytes, const std::string& file);

}  // namespace engine::io
