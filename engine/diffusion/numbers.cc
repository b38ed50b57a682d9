#include "engine/diffusion/numbers.h"

#include <ATen/core/Tensor.h>
#include <ATen/ops/empty.h>

#include <algorithm>

namespace engine::diffusion {

Tensor tensor_of(const weights::FloatTensor& values) {
  Tensor tensor = at::empty(values.shape, at::kFloat);
  std::ranges::copy(values.values, tensor.data_ptr<float>());
  return tensor;
}

weights::FloatTensor values_of(const Tensor& tensor) {
  const Tensor flat = tensor.detach().contiguous();
  return {flat.sizes().vec(), {flat.data_ptr<float>(), flat.data_ptr<float>() + flat.numel()}};
}

}  // namespace engine::diffusion
