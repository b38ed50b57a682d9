#include "engine/correct/repainter.h"

#include <algorithm>
#include <cmath>

namespace engine::correct {

BytePicture as_bytes(const scene::Image& picture) {
  BytePicture out{picture.width, picture.height, std::vector<std::uint8_t>(picture.data.size())};
  std::ranges::transform(picture.data, out.data.begin(), [](float value) {
    // Asked this way round so that what is not a number is 0.
    return value > 0 ? std::uint8_t(std::lround(std::min(value, 1.0f) * 255)) : std::uint8_t{0};
  });
  return out;
}

scene::Image as_image(const BytePicture& picture) {
  scene::Image out(picture.width, picture.height, 3);
  std::ranges::transform(picture.data, out.data.begin(), [](std::uint8_t value) { return float(value) / 255; });
  return out;
}

}  // namespace engine::correct
