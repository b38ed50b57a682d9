// Adapters of low rank (LoRA) in files: what is added to the weights of some layers.
// Source: Hu et al. 2021, "LoRA: low-rank adaptation of large language models", eq. 3: W x + (alpha / r) B A x.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "engine/core/result.h"
#include "engine/weights/networks.h"
#include "engine/weights/safetensors.h"

namespace engine::weights {

/// What is added to one layer.
struct LowRank {
  FloatTensor down;  ///< A, [r, in], or [r, in, side, side] of a convolution.
  FloatTensor up;    ///< B, [out, r], or [out, r, 1, 1].
  double scale = 1;  ///< alpha / r.

  [[nodiscard]] std::int64_t rank() const { return down.shape.front(); }
};

/// Layers by the names of their networks: "mid_block.attentions.0.transformer_blocks.0.attn1.to_q".
struct AdapterWeights {
  std::map<std::string, LowRank> unet, text_encoder;
};

/// Reads an adapter, in the layouts of diffusers (".lora.down.weight", ".lora_A.weight", attention processors as before
/// 0.22), peft (with adapter_config.json beside it, of which r and lora_alpha are read) and kohya's scripts
/// ("lora_unet_..." with alphas). Without an alpha the scale is 1.
///   configs  of the checkpoint that it is for
///   errors   those of TensorFile::open(); corrupt_data: half of a pair is missing, or their shapes do not fit each
///   other
///            or their layer; unsupported: a tensor that is no part of such an adapter, or for a layer that the
///            networks do not have. `where` names the tensor
[[nodiscard]] Result<AdapterWeights> read_adapter(const std::filesystem::path& path, const Configs& configs);
/// The same of a file that is open.
///   alpha  of layers without one of their own; 0: their rank
[[nodiscard]] Result<AdapterWeights> decode_adapter(const TensorFile& file, const Configs& configs, double alpha = 0);

/// The file that diffusers' training scripts write today ("unet.LAYER.lora.down.weight"). It has no place for a scale:
/// one other than 1 is multiplied into B.
[[nodiscard]] std::string encode_adapter(const AdapterWeights& weights);

}  // namespace engine::weights
