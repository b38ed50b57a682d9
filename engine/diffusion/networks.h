// What all copies of a StableDiffusion share. For this room alone.
#pragma once

#include <string>

#include "engine/core/result.h"
#include "engine/diffusion/adapter.h"
#include "engine/diffusion/parameters.h"
#include "engine/diffusion/stable_diffusion.h"
#include "engine/diffusion/tensor.h"
#include "engine/diffusion/tokenizer.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

struct StableDiffusion::Networks {
  weights::Configs configs;
  std::string digest;  ///< Of all that was read of the checkpoint.
  Tokenizer tokenizer;
  Parameters unet, autoencoder, text_encoder;

  /// What the UNet attends to of a prompt: [1, 77, width].
  ///   name     of the option that the prompt is, for errors
  ///   adapter  of the text encoder; null: none
  ///   errors   those of Tokenizer::encode()
  [[nodiscard]] Result<Tensor> context_of(const std::string& prompt, const char* name, const Adapter* adapter) const;
};

}  // namespace engine::diffusion
