// Picture files of a rendering: its colours, its depth, its alpha or a mask.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/image_file.h"
#include "engine/render/forward.h"

namespace server::pictures {

/// Which quantity of a rendering a picture shows.
enum class PictureContent {
  color,
  depth,  ///< Mean depth of what is seen; as shades (near is white) where the format holds no floats.
  alpha,
  mask  ///< White where what was given a weight of 1 has at least half of the pixel.
};

/// Whether a picture needs Rendering::color, Rendering::depth.
[[nodiscard]] bool needs_color(PictureContent content);
[[nodiscard]] bool needs_depth(PictureContent content, engine::io::ImageFormat format);

/// EXR: colour with alpha and depth (Z); depth alone; alpha alone; the mask as 0 and 1. PNG and JPEG: 8 bits.
///   rendering  holds what the picture needs; for a mask, `weight`
///   errors     those of io::encode_image()
[[nodiscard]] engine::Result<std::vector<std::byte>> encode_content(const engine::render::Rendering& rendering,
                                                                    PictureContent content,
                                                                    engine::io::ImageFormat format,
                                                                    const engine::io::EncodeOptions& options = {});

}  // namespace server::pictures
