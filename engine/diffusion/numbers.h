// Tensors as plain numbers, and back.
#pragma once

#include "engine/diffusion/tensor.h"
#include "engine/weights/safetensors.h"

namespace engine::diffusion {

/// A tensor of its own with these numbers.
[[nodiscard]] Tensor tensor_of(const weights::FloatTensor& values);
/// The numbers of a tensor of floats, without its gradients.
[[nodiscard]] weights::FloatTensor values_of(const Tensor& tensor);

}  // namespace engine::diffusion
