// Tensors of libtorch, by name only: its headers are included by this room's sources, and by no header.
#pragma once

namespace at {
class Tensor;
}

namespace engine::diffusion {

using at::Tensor;

}  // namespace engine::diffusion
