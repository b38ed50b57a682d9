#include "server/pictures/picture_content.h"

#include "server/pictures/pictures.h"

namespace server::pictures {

namespace io = engine::io;
using engine::scene::Image;

namespace {

Image at_least_half(const Image& weight) {
  Image mask = weight;
  for (float& value : mask.data) value = value >= 0.5f ? 1.0f : 0.0f;
  return mask;
}

}  // namespace

bool needs_color(PictureContent content) { return content == PictureContent::color; }

bool needs_depth(PictureContent content, io::ImageFormat format) {
  return content == PictureContent::depth || (content == PictureContent::color && format == io::ImageFormat::exr);
}

engine::Result<std::vector<std::byte>> encode_content(const engine::render::Rendering& rendering,
                                                      PictureContent content, io::ImageFormat format,
                                                      const io::EncodeOptions& options) {
  if (content == PictureContent::mask) return io::encode_image(at_least_half(rendering.weight), format, options);
  const Image depth = needs_depth(content, format) ? mean_depth(rendering.depth, rendering.alpha) : Image{};
  if (format == io::ImageFormat::exr) {
    io::RenderLayers layers;
    if (content == PictureContent::color) layers.color = &rendering.color;
    if (content != PictureContent::depth) layers.alpha = &rendering.alpha;
    if (content != PictureContent::alpha) layers.depth = &depth;
    return io::encode_exr(layers);
  }
  if (content == PictureContent::depth) return io::encode_image(shaded_depth(depth), format, options);
  return io::encode_image(content == PictureContent::alpha ? rendering.alpha : rendering.color, format, options);
}

}  // namespace server::pictures
