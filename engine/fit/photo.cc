#include "engine/fit/photo.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "engine/core/parallel.h"

namespace engine::fit {
namespace {

constexpr std::size_t values_per_chunk = 65536;  // of a parallel task: a choice

/// [b] b / 255
const std::array<float, 256>& levels() {
  static const auto table = [] {
    std::array<float, 256> values{};
    for (std::size_t b = 0; b < values.size(); ++b) values[b] = float(b) / 255.0f;
    return values;
  }();
  return table;
}

}  // namespace

Photo to_photo(const scene::Camera& camera, const scene::Image& picture) {
  assert(picture.width == camera.width && picture.height == camera.height && picture.channels == 3);
  Photo photo{camera, std::vector<std::uint8_t>(picture.data.size())};
  std::transform(picture.data.begin(), picture.data.end(), photo.rgb.begin(),
                 [](float value) { return std::uint8_t(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f)); });
  return photo;
}

void to_image(const Photo& photo, scene::Image& picture) {
  picture.width = photo.camera.width, picture.height = photo.camera.height, picture.channels = 3;
  picture.data.resize(photo.rgb.size());
  const auto& level = levels();
  parallel_for(photo.rgb.size(), values_per_chunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) picture.data[i] = level[photo.rgb[i]];
  });
}

Photo half_size(const Photo& photo) {
  const scene::Camera& fine = photo.camera;
  assert(fine.width >= 2 && fine.height >= 2);
  Photo half{fine, {}};
  scene::Camera& camera = half.camera;
  camera.width /= 2, camera.height /= 2;
  camera.fx /= 2, camera.fy /= 2, camera.cx /= 2, camera.cy /= 2;
  half.rgb.reserve(std::size_t(3) * std::size_t(camera.width) * std::size_t(camera.height));
  const auto stride = std::size_t(fine.width);
  for (std::size_t c = 0; c < 3; ++c)
    for (int y = 0; y < camera.height; ++y) {
      const std::uint8_t* const row = photo.rgb.data() + (c * std::size_t(fine.height) + std::size_t(2 * y)) * stride;
      for (std::size_t x = 0; x < 2 * std::size_t(camera.width); x += 2)
        half.rgb.push_back(std::uint8_t((row[x] + row[x + 1] + row[stride + x] + row[stride + x + 1] + 2) / 4));
    }
  return half;
}

}  // namespace engine::fit
