// Prompts as numbers of pieces into what the UNet attends to.
// Source: Radford et al. 2021, "Learning transferable visual models from natural language supervision", section 2.4.
#pragma once

#include "engine/diffusion/layers.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

/// A vector for each place of a prompt, the last layer normalised. A place sees those before it, the filling included.
///   pieces   [B, positions] int64, each below the vocabulary's size: Tokenizer::encode()
///   returns  [B, positions, width]
[[nodiscard]] Tensor encode_text(const Model& model, const weights::TextEncoderConfig& config, const Tensor& pieces);

}  // namespace engine::diffusion
