// Pictures and masks in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace engine::scene {

/// A float picture, planar: all of channel 0, then all of channel 1, ... Rows from top to bottom.
/// Colours are display-referred (as stored in photographs and as 3DGS trains on), 0 to 1, not clamped.
struct Image {
  int width = 0, height = 0, channels = 0;
  std::vector<float> data;  ///< [channels][height][width]

  Image() = default;
  Image(int w, int h, int c, float value = 0.0f)
      : width(w), height(h), channels(c), data(std::size_t(w) * std::size_t(h) * std::size_t(c), value) {}

  [[nodiscard]] std::size_t pixels() const { return std::size_t(width) * std::size_t(height); }
  [[nodiscard]] std::span<float> plane(int c) { return {data.data() + pixels() * std::size_t(c), pixels()}; }
  [[nodiscard]] std::span<const float> plane(int c) const {
    return {data.data() + pixels() * std::size_t(c), pixels()};
  }
  [[nodiscard]] float& at(int x, int y, int c = 0) { return data[index(x, y, c)]; }
  [[nodiscard]] float at(int x, int y, int c = 0) const { return data[index(x, y, c)]; }
  bool operator==(const Image&) const = default;

 private:
  [[nodiscard]] std::size_t index(int x, int y, int c) const {
    return (std::size_t(c) * std::size_t(height) + std::size_t(y)) * std::size_t(width) + std::size_t(x);
  }
};

/// Which pixels: 0 or 1 each, rows from top to bottom.
struct Mask {
  int width = 0, height = 0;
  std::vector<std::uint8_t> data;  ///< [height][width]

  Mask() = default;
  Mask(int w, int h) : width(w), height(h), data(std::size_t(w) * std::size_t(h), 0) {}

  [[nodiscard]] std::uint8_t& at(int x, int y) { return data[std::size_t(y) * std::size_t(width) + std::size_t(x)]; }
  [[nodiscard]] std::uint8_t at(int x, int y) const {
    return data[std::size_t(y) * std::size_t(width) + std::size_t(x)];
  }
  [[nodiscard]] std::size_t area() const;  ///< Pixels that are set.
  bool operator==(const Mask&) const = default;
};

/// A rectangle of pixels: [x0, x1) x [y0, y1).
struct Rect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  [[nodiscard]] int width() const { return x1 - x0; }
  [[nodiscard]] int height() const { return y1 - y0; }
  [[nodiscard]] bool empty() const { return x1 <= x0 || y1 <= y0; }
  bool operator==(const Rect&) const = default;
};

/// The smallest rectangle that holds all set pixels; an empty one (all zero) if there are none.
[[nodiscard]] Rect bounding_box(const Mask& mask);

/// A part of a picture. Precondition: it lies inside.
[[nodiscard]] Image cut_out(const Image& image, Rect part);
[[nodiscard]] Mask cut_out(const Mask& mask, Rect part);
/// Puts a picture of part.width() x part.height() there. Precondition: `part` lies inside `to`; same channels.
void paste(const Image& image, Rect part, Image& to);

/// Peak signal-to-noise ratio in dB for pictures of the same shape with peak 1; infinity if they are equal.
/// Summed in double.
[[nodiscard]] double psnr(const Image& a, const Image& b);

}  // namespace engine::scene
