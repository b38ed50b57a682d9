// What copies of a StableDiffusion share. For this room alone.
#pragma once

#include <string>
#include <vector>

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
  Tokenizer tokenizer;
  Parameters unet, autoencoder, text_encoder;

  /// What the UNet attends to of a prompt: [1, 77, width].
  ///   name      of the option that the prompt is, for errors
  ///   adapters  of the text encoder
  ///   errors    those of Tokenizer::encode()
  [[nodiscard]] Result<Tensor> context_of(const std::string& prompt, const char* name,
                                          const std::vector<Adapter>& adapters) const;
};

}  // namespace engine::diffusion
