#include "engine/diffusion/pictures.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/_upsample_bicubic2d_aa.h>
#include <ATen/ops/empty.h>

#include <algorithm>

#include "engine/core/finite.h"

namespace engine::diffusion {

Tensor as_tensor(const scene::Image& picture) {
  Tensor tensor = at::empty({1, picture.channels, picture.height, picture.width}, at::kFloat);
  std::ranges::transform(picture.data, tensor.data_ptr<float>(), [](float value) { return 2 * value - 1; });
  return tensor;
}

Result<scene::Image> as_picture(const Tensor& tensor) {
  const Tensor flat = (tensor * 0.5 + 0.5).contiguous();
  scene::Image picture(int(flat.size(3)), int(flat.size(2)), int(flat.size(1)));
  std::copy_n(flat.data_ptr<float>(), picture.data.size(), picture.data.begin());
  // Asked before clamping, which makes an infinity look like a colour, and lets NaN through.
  if (first_not_finite(picture.data))
    return fail(ErrorCode::internal, "what the autoencoder makes of the latents is not finite", "autoencoder");
  for (float& value : picture.data) value = std::clamp(value, 0.0f, 1.0f);
  return picture;
}

scene::Image resized(const scene::Image& picture, int width, int height) {
  if (picture.width == width && picture.height == height) return picture;
  const at::NoGradGuard no_gradients;
  Tensor tensor = at::empty({1, picture.channels, picture.height, picture.width}, at::kFloat);
  std::ranges::copy(picture.data, tensor.data_ptr<float>());
  const Tensor scaled = at::_upsample_bicubic2d_aa(tensor, {height, width}, /*align_corners=*/false).contiguous();
  scene::Image out(width, height, picture.channels);
  std::transform(scaled.data_ptr<float>(), scaled.data_ptr<float>() + scaled.numel(), out.data.begin(),
                 [](float value) { return std::clamp(value, 0.0f, 1.0f); });
  return out;
}

std::span<float> numbers_of(Tensor& tensor) { return {tensor.data_ptr<float>(), std::size_t(tensor.numel())}; }

void fill_normal(std::span<float> values, Rng& rng) {
  for (float& value : values) value = rng.normal();
}

Tensor normal_numbers(std::span<const std::int64_t> shape, Rng& rng) {
  Tensor numbers = at::empty({shape.data(), shape.size()}, at::kFloat);
  fill_normal(numbers_of(numbers), rng);
  return numbers;
}

}  // namespace engine::diffusion
