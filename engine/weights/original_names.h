// The names that tensors have in checkpoints of one file, as the first authors' programs wrote them.
// Source: the layouts of the files v1-5-pruned-emaonly.safetensors and v2-1_512-ema-pruned.safetensors, whose programs
// are Rombach et al.'s latent-diffusion and (for the text encoder of 2.x) Ilharco et al.'s open_clip.
#pragma once

#include <cstdint>
#include <string>

#include "engine/weights/networks.h"

namespace engine::weights {

/// Where a tensor lies in such a file.
struct OriginalPlace {
  std::string name;
  /// open_clip keeps the matrices of queries, keys and values in one, below each other: this is part 0, 1 or 2 of
  /// three of its rows. -1: it is the whole tensor.
  int third = -1;
};

/// Place of a tensor of tensors_of().
///   open_clip  the text encoder is that of 2.x
[[nodiscard]] OriginalPlace original_place(const Configs& configs, Network network, const std::string& name,
                                           bool open_clip);

/// A tensor of the autoencoder's attention by the name of diffusers before 0.14 ("query" for "to_q"); other names stay.
[[nodiscard]] std::string old_autoencoder_name(const std::string& name);

}  // namespace engine::weights
