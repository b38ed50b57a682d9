// A cloud as bytes, as it is in memory: for checkpoints and versions, which only this program reads.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::scene {

/// Number of rows, sh_degree and extra_stride, then every array.
void write_cloud(ByteWriter& out, const GaussianCloud& cloud);

/// What write_cloud() wrote. Allocates nothing before the bytes are known to be there. Bytes that are not a cloud leave
/// `in` failed and give an empty one; values are not looked at.
[[nodiscard]] GaussianCloud read_cloud(ByteReader& in);

}  // namespace engine::scene
