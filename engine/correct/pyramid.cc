#include "engine/correct/pyramid.h"

#include <algorithm>

namespace engine::correct {

MaskedPicture half_size(const MaskedPicture& fine) {
  const int width = (fine.picture.width + 1) / 2, height = (fine.picture.height + 1) / 2;
  const int channels = fine.picture.channels;
  MaskedPicture coarse{scene::Image(width, height, channels), scene::Image(width, height, 1)};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int x1 = std::min(2 * x + 2, fine.picture.width), y1 = std::min(2 * y + 2, fine.picture.height);
      float confidence = 0, pixels = 0;
      for (int v = 2 * y; v < y1; ++v)
        for (int u = 2 * x; u < x1; ++u) confidence += fine.confidence.at(u, v), pixels += 1;
      coarse.confidence.at(x, y) = confidence / pixels;
      for (int c = 0; c < channels; ++c) {
        float sum = 0;
        for (int v = 2 * y; v < y1; ++v)
          for (int u = 2 * x; u < x1; ++u)
            sum += (confidence > 0 ? fine.confidence.at(u, v) : 1.0f) * fine.picture.at(u, v, c);
        coarse.picture.at(x, y, c) = sum / (confidence > 0 ? confidence : pixels);
      }
    }
  return coarse;
}

scene::Mask half_size_mask(const scene::Mask& fine) {
  scene::Mask coarse((fine.width + 1) / 2, (fine.height + 1) / 2);
  for (int y = 0; y < coarse.height; ++y)
    for (int x = 0; x < coarse.width; ++x) {
      std::uint8_t all = 1;
      for (int v = 2 * y; v < std::min(2 * y + 2, fine.height); ++v)
        for (int u = 2 * x; u < std::min(2 * x + 2, fine.width); ++u) all = std::uint8_t(all & (fine.at(u, v) != 0));
      coarse.at(x, y) = all;
    }
  return coarse;
}

scene::Image double_size(const scene::Image& coarse, int width, int height) {
  scene::Image fine(width, height, coarse.channels);
  // Pixel u of the fine picture has its middle at u / 2 - 1 / 4 of the coarse one.
  for (int y = 0; y < height; ++y) {
    const int y0 = std::max((y - 1) / 2, 0), y1 = std::min((y + 1) / 2, coarse.height - 1);
    const float fy = y % 2 != 0 ? 0.25f : 0.75f;
    for (int x = 0; x < width; ++x) {
      const int x0 = std::max((x - 1) / 2, 0), x1 = std::min((x + 1) / 2, coarse.width - 1);
      const float fx = x % 2 != 0 ? 0.25f : 0.75f;
      for (int c = 0; c < coarse.channels; ++c)
        fine.at(x, y, c) = (1 - fy) * ((1 - fx) * coarse.at(x0, y0, c) + fx * coarse.at(x1, y0, c)) +
                           fy * ((1 - fx) * coarse.at(x0, y1, c) + fx * coarse.at(x1, y1, c));
    }
  }
  return fine;
}

std::vector<int> depth_within(const scene::Mask& mask) {
  const int width = mask.width, height = mask.height, far = std::max(width, height);
  std::vector<int> depth(mask.data.size());
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = mask.data[i] != 0 ? far : 0;
  const auto at = [&](int x, int y) -> int& { return depth[std::size_t(y) * std::size_t(width) + std::size_t(x)]; };
  const auto lower = [&](int x, int y, int dx, int dy) {
    const int u = x + dx, v = y + dy;
    if (u >= 0 && v >= 0 && u < width && v < height) at(x, y) = std::min(at(x, y), at(u, v) + 1);
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) lower(x, y, -1, 0), lower(x, y, -1, -1), lower(x, y, 0, -1), lower(x, y, 1, -1);
  for (int y = height; y-- > 0;)
    for (int x = width; x-- > 0;) lower(x, y, 1, 0), lower(x, y, 1, 1), lower(x, y, 0, 1), lower(x, y, -1, 1);
  return depth;
}

}  // namespace engine::correct
