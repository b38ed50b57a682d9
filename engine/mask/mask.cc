#include "engine/mask/mask.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/parallel.h"

namespace engine::mask {
namespace {

constexpr int far_away = 1 << 20;  // more than any distance inside a picture (16384 px a side); its square fits 64 bits

/// Vertical distance from each pixel of the columns [first, end) to the nearest set pixel of its column; far_away if
/// there is none. Row by row, as pictures lie in memory: down a column each step would wait for another cache line.
void column_distances(const scene::Mask& mask, std::size_t first, std::size_t end, std::vector<int>& distance) {
  const auto width = std::size_t(mask.width), height = std::size_t(mask.height);
  std::vector<int> since(end - first, far_away);
  for (std::size_t y = 0; y < height; ++y)
    for (std::size_t x = first; x < end; ++x) {
      int& so_far = since[x - first];
      so_far = mask.data[y * width + x] != 0 ? 0 : std::min(so_far + 1, far_away);
      distance[y * width + x] = so_far;
    }
  std::fill(since.begin(), since.end(), far_away);
  for (std::size_t y = height; y-- > 0;)
    for (std::size_t x = first; x < end; ++x) {
      int &so_far = since[x - first], &here = distance[y * width + x];
      so_far = mask.data[y * width + x] != 0 ? 0 : std::min(so_far + 1, far_away);
      here = std::min(here, so_far);
    }
}

/// One row of the dilation. A pixel with a set one at vertical distance g <= r lights the row within
/// sqrt(r^2 - g^2) of itself: an interval, so the row is the union of intervals, counted with +1 and -1 at their ends.
void dilate_row(const int* distance, const std::vector<int>& reach, int radius_px, std::vector<int>& steps,
                std::uint8_t* out) {
  const int width = int(steps.size()) - 1;
  std::fill(steps.begin(), steps.end(), 0);
  for (int x = 0; x < width; ++x) {
    if (distance[x] > radius_px) continue;
    const int half = reach[std::size_t(distance[x])];
    ++steps[std::size_t(std::max(0, x - half))];
    --steps[std::size_t(std::min(width, x + half + 1))];
  }
  int covered = 0;
  for (int x = 0; x < width; ++x) {
    covered += steps[std::size_t(x)];
    out[x] = covered > 0;
  }
}

}  // namespace

scene::Mask mask2d(const scene::Image& weight, float threshold) {
  assert(weight.channels == 1);
  scene::Mask mask(weight.width, weight.height);
  std::transform(weight.data.begin(), weight.data.end(), mask.data.begin(),
                 [&](float w) { return std::uint8_t(w >= threshold); });
  return mask;
}

int dilation_radius(int picture_height) { return std::max(1, int(std::lround(picture_height * 10.0 / 512.0))); }

scene::Mask dilate(const scene::Mask& mask, int radius_px) {
  if (radius_px <= 0 || mask.data.empty()) return mask;
  radius_px = std::min(radius_px, mask.width + mask.height);  // beyond the picture's diagonal nothing changes
  // reach[g]: the largest whole h with h^2 + g^2 <= r^2.
  std::vector<int> reach(std::size_t(radius_px) + 1);
  for (int g = 0, h = radius_px; g <= radius_px; ++g) {
    while (std::int64_t(h) * h + std::int64_t(g) * g > std::int64_t(radius_px) * radius_px) --h;
    reach[std::size_t(g)] = h;
  }
  constexpr std::size_t grain = 64;  // rows or columns: enough work for a thread, enough chunks for many
  std::vector<int> distance(mask.data.size());
  parallel_for(std::size_t(mask.width), grain,
               [&](std::size_t begin, std::size_t end) { column_distances(mask, begin, end, distance); });
  scene::Mask wide(mask.width, mask.height);
  parallel_for(std::size_t(mask.height), grain, [&](std::size_t begin, std::size_t end) {
    std::vector<int> steps(std::size_t(mask.width) + 1);
    for (std::size_t y = begin; y < end; ++y) {
      const std::size_t row = y * std::size_t(mask.width);
      dilate_row(distance.data() + row, reach, radius_px, steps, wide.data.data() + row);
    }
  });
  return wide;
}

int blur_radius(int picture_height) { return std::max(1, picture_height / 192); }

scene::Mask eroded(const scene::Mask& mask, int radius_px) {
  const auto complement = [](scene::Mask of) {
    for (std::uint8_t& flag : of.data) flag = flag == 0;
    return of;
  };
  return complement(dilate(complement(mask), radius_px));
}

scene::Mask opened(const scene::Mask& mask, int radius_px) { return dilate(eroded(mask, radius_px), radius_px); }

void unite(scene::Mask& into, const scene::Mask& other) {
  assert(into.width == other.width && into.height == other.height);
  for (std::size_t i = 0; i < into.data.size(); ++i) into.data[i] |= other.data[i];
}

}  // namespace engine::mask
