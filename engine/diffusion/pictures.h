// Pictures as tensors, and back.
#pragma once

#include <cstdint>
#include <span>

#include "engine/core/result.h"
#include "engine/core/rng.h"
#include "engine/diffusion/tensor.h"
#include "engine/scene/image.h"

namespace engine::diffusion {

/// [1, C, H, W] in -1 to 1, of a picture in 0 to 1.
[[nodiscard]] Tensor as_tensor(const scene::Image& picture);
/// And back, clamped.
///   errors  internal: a number is not finite
[[nodiscard]] Result<scene::Image> as_picture(const Tensor& tensor);

/// The picture in another size, by cubic curves and without aliases; within 0 to 1.
[[nodiscard]] scene::Image resized(const scene::Image& picture, int width, int height);

/// The numbers of a contiguous tensor of floats.
[[nodiscard]] std::span<float> numbers_of(Tensor& tensor);
/// Fills with normal numbers.
void fill_normal(std::span<float> values, Rng& rng);
/// A tensor of normal numbers, of that shape.
[[nodiscard]] Tensor normal_numbers(std::span<const std::int64_t> shape, Rng& rng);

}  // namespace engine::diffusion
