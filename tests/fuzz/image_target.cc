#include "engine/io/image_file.h"
#include "engine/io/webp.h"
#include "tests/fuzz/fuzz.h"

void fuzz::run(std::span<const std::byte> bytes) {
  engine::io::ImageOptions options;
  options.max_side = 512;
  options.max_pixels = 1 << 16;
  options.max_file_bytes = 1 << 20;
  const auto image = engine::io::decode_image(bytes, "a.png", options);
  if (image) demand(image->width > 0 && image->height > 0, "a picture that is accepted has pixels");
  (void)engine::io::decode_webp(bytes, 1 << 16, small_limits().memory, "a.webp");
}

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  engine::scene::Image picture(3, 2, 3);
  using engine::io::ImageFormat;
  for (const ImageFormat format : {ImageFormat::png, ImageFormat::jpeg, ImageFormat::exr})
    all.push_back(text_of(*engine::io::encode_image(picture, format)));
  engine::io::BytePicture bytes;
  bytes.width = 3, bytes.height = 2;
  bytes.rgba.assign(24, 7);
  all.push_back(text_of(*engine::io::encode_webp(bytes, "")));
  return all;
}
