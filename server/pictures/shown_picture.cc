#include "server/pictures/shown_picture.h"

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

bool needs_color(Shown shown) { return shown == Shown::color; }

bool needs_depth(Shown shown, io::ImageFormat format) {
  return shown == Shown::depth || (shown == Shown::color && format == io::ImageFormat::exr);
}

engine::Result<std::vector<std::byte>> encode_shown(const engine::render::Rendering& rendering, Shown shown,
                                                    io::ImageFormat format, const io::EncodeOptions& options) {
  if (shown == Shown::mask) return io::encode_image(at_least_half(rendering.weight), format, options);
  const Image depth = needs_depth(shown, format) ? mean_depth(rendering.depth, rendering.alpha) : Image{};
  if (format == io::ImageFormat::exr) {
    io::RenderLayers layers;
    if (shown == Shown::color) layers.color = &rendering.color;
    if (shown != Shown::depth) layers.alpha = &rendering.alpha;
    if (shown != Shown::alpha) layers.depth = &depth;
    return io::encode_exr(layers);
  }
  if (shown == Shown::depth) return io::encode_image(shaded_depth(depth), format, options);
  return io::encode_image(shown == Shown::alpha ? rendering.alpha : rendering.color, format, options);
}

}  // namespace server::pictures
