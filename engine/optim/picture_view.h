// Rectangles of pictures and masks that live elsewhere; nothing is copied.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>

#include "engine/scene/image.h"

namespace engine::optim {

/// A rectangle of a planar picture. Like a span: cheap to copy, valid as long as the picture is.
struct PictureView {
  const float* data = nullptr;  ///< Channel 0, first row, first column of the rectangle.
  int width = 0, height = 0, channels = 0;
  std::size_t row_stride = 0, plane_stride = 0;  ///< Floats from one row, and from one channel, to the next.

  [[nodiscard]] const float* row(int c, int y) const {
    return data + std::size_t(c) * plane_stride + std::size_t(y) * row_stride;
  }
  [[nodiscard]] std::size_t pixels() const { return std::size_t(width) * std::size_t(height); }
};

/// A rectangle of a planar picture to write to; it converts to a PictureView.
struct MutablePictureView {
  float* data = nullptr;
  int width = 0, height = 0, channels = 0;
  std::size_t row_stride = 0, plane_stride = 0;

  [[nodiscard]] float* row(int c, int y) const {
    return data + std::size_t(c) * plane_stride + std::size_t(y) * row_stride;
  }
  operator PictureView() const { return {data, width, height, channels, row_stride, plane_stride}; }
};

/// A rectangle of a mask; without data, a mask in which no pixel is set.
struct MaskView {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0;
  std::size_t row_stride = 0;

  [[nodiscard]] const std::uint8_t* row(int y) const { return data + std::size_t(y) * row_stride; }
};

[[nodiscard]] inline scene::Rect whole(int width, int height) { return {0, 0, width, height}; }

/// The pixels of `rect`, which lies inside the picture (asserted).
[[nodiscard]] inline PictureView crop(const scene::Image& image, scene::Rect rect) {
  assert(rect.x0 >= 0 && rect.y0 >= 0 && rect.x1 <= image.width && rect.y1 <= image.height);
  const std::size_t first = std::size_t(rect.y0) * std::size_t(image.width) + std::size_t(rect.x0);
  return {image.data.data() + first, rect.width(),  rect.height(), image.channels,
          std::size_t(image.width),  image.pixels()};
}
[[nodiscard]] inline MutablePictureView crop(scene::Image& image, scene::Rect rect) {
  const PictureView view = crop(static_cast<const scene::Image&>(image), rect);
  return {image.data.data() + (view.data - image.data.data()),
          view.width,
          view.height,
          view.channels,
          view.row_stride,
          view.plane_stride};
}
[[nodiscard]] inline MaskView crop(const scene::Mask& mask, scene::Rect rect) {
  assert(rect.x0 >= 0 && rect.y0 >= 0 && rect.x1 <= mask.width && rect.y1 <= mask.height);
  const std::size_t first = std::size_t(rect.y0) * std::size_t(mask.width) + std::size_t(rect.x0);
  return {mask.data.data() + first, rect.width(), rect.height(), std::size_t(mask.width)};
}

/// A view of all pixels.
[[nodiscard]] inline PictureView view(const scene::Image& image) {
  return crop(image, whole(image.width, image.height));
}
[[nodiscard]] inline MutablePictureView view(scene::Image& image) {
  return crop(image, whole(image.width, image.height));
}
[[nodiscard]] inline MaskView view(const scene::Mask& mask) { return crop(mask, whole(mask.width, mask.height)); }

}  // namespace engine::optim
