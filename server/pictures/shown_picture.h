// What is shown of a rendering, as a picture file.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/image_file.h"
#include "engine/render/forward.h"

namespace server::pictures {

enum class Shown {
  color,
  depth,  ///< Mean depth of what is seen; as shades (near is white) where the format holds no floats.
  alpha,
  mask  ///< White where what was given a weight of 1 has at least half of the pixel.
};

/// Whether a picture needs Rendering::color, Rendering::depth.
[[nodiscard]] bool needs_color(Shown shown);
[[nodiscard]] bool needs_depth(Shown shown, engine::io::ImageFormat format);

/// EXR: colour with alpha and depth (Z); depth alone; alpha alone; the mask as 0 and 1. PNG and JPEG: 8 bits.
///   rendering  holds what the picture needs; for a mask, `weight`
///   errors     those of io::encode_image()
[[nodiscard]] engine::Result<std::vector<std::byte>> encode_shown(const engine::render::Rendering& rendering,
                                                                  Shown shown, engine::io::ImageFormat format,
                                                                  const engine::io::EncodeOptions& options = {});

}  // namespace server::pictures
