// VGG16 with weights made by formula: what the reference of LPIPS was computed with, since nobody may ship the real
// ones.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "engine/weights/safetensors.h"

namespace engine::diffusion {

/// 0 to 1, exclusive, of the place j in the tensor number L: a hash of both.
inline double hashed(std::uint32_t j, std::uint32_t L) {
  std::uint32_t h = 2654435761u * j + 2246822519u * L + 374761393u;
  h ^= h >> 16, h *= 0x85ebca6bu;
  h ^= h >> 13, h *= 0xc2b2ae35u;
  h ^= h >> 16;
  return double(h >> 8) / double(1 << 24);
}

struct VggConvolution {
  int place, in, out;
};
constexpr std::array<VggConvolution, 13> vgg_convolutions = {{{0, 3, 64},
                                                              {2, 64, 64},
                                                              {5, 64, 128},
                                                              {7, 128, 128},
                                                              {10, 128, 256},
                                                              {12, 256, 256},
                                                              {14, 256, 256},
                                                              {17, 256, 512},
                                                              {19, 512, 512},
                                                              {21, 512, 512},
                                                              {24, 512, 512},
                                                              {26, 512, 512},
                                                              {28, 512, 512}}};

/// `fill(values, L, scale)` fills each tensor: L is the number of its convolution, its numbers are up to `scale`.
template <class Fill>
std::map<std::string, weights::FloatTensor> vgg16(Fill&& fill) {
  std::map<std::string, weights::FloatTensor> tensors;
  for (std::uint32_t L = 0; L < vgg_convolutions.size(); ++L) {
    const auto [place, in, out] = vgg_convolutions[L];
    weights::FloatTensor weight{{out, in, 3, 3}, std::vector<float>(std::size_t(out) * std::size_t(in) * 9)};
    fill(std::span(weight.values), L, std::sqrt(6.0 / (9.0 * in)));
    weights::FloatTensor bias{{out}, std::vector<float>(std::size_t(out))};
    fill(std::span(bias.values), L + 100, 0.05);
    tensors.emplace("features." + std::to_string(place) + ".weight", std::move(weight));
    tensors.emplace("features." + std::to_string(place) + ".bias", std::move(bias));
  }
  return tensors;
}

inline std::map<std::string, weights::FloatTensor> hashed_vgg16() {
  return vgg16([](std::span<float> values, std::uint32_t L, double scale) {
    for (std::uint32_t j = 0; j < values.size(); ++j) values[j] = float((2 * hashed(j, L) - 1) * scale);
  });
}

/// As large and as uneven, and made in a tenth of the time: a thousand numbers over and over. Where values do not
/// matter.
inline std::map<std::string, weights::FloatTensor> cheap_vgg16() {
  return vgg16([](std::span<float> values, std::uint32_t L, double scale) {
    constexpr std::size_t period = 1021;  // prime: no layer's width is a multiple of it
    const std::size_t some = std::min(values.size(), period);
    for (std::uint32_t j = 0; j < some; ++j) values[j] = float((2 * hashed(j, L) - 1) * scale);
    for (std::size_t from = some; from < values.size(); from += period)
      std::copy_n(values.begin(), std::min(period, values.size() - from), values.begin() + std::ptrdiff_t(from));
  });
}

/// Of tensors that are in memory.
inline weights::TensorFile file_of(const std::map<std::string, weights::FloatTensor>& tensors,
                                   const std::string& name) {
  const std::string text = weights::encode_tensors(tensors);
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return weights::TensorFile::parse(std::move(bytes), name).value();
}

}  // namespace engine::diffusion
