// Gradient checkpointing: what a part of a network computes on its way is not kept for the way back, where it is
// computed again.
// Source: Chen et al. 2016, "Training deep nets with sublinear memory cost".
#pragma once

#include <functional>

#include "engine/diffusion/tensor.h"

namespace engine::diffusion {

/// A part of a network, of what comes from the part before it and of what all parts are given.
using Part = std::function<Tensor(const Tensor& x, const Tensor& context)>;

/// part(x, context). With gradients, nothing of it is kept but its arguments, and it is computed once more on the way
/// back. Gradients reach the arguments and the parameters that `part` uses.
///   part  gives the same whenever it is computed; what it refers to lives until the way back is over
[[nodiscard]] Tensor recomputed(const Part& part, const Tensor& x, const Tensor& context);

}  // namespace engine::diffusion
