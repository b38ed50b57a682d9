// Adapters of low rank (LoRA) in files: what is added to the weights of some layers.
// Source: Hu et al. 2021, "LoRA: low-rank adaptation of large language models", eq. 3: W x + (alpha / r) B A x.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
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

  [[nodiscard]] std::uint64_t bytes() const;  ///< Of its numbers, in memory.
};

/// What peft's configuration says of an adapter's layers.
struct AdapterSettings {
  double alpha = 0;       ///< Of layers without one of their own; 0: their rank.
  std::int64_t rank = 0;  ///< r, which every layer must have; 0: not said.
};

/// Reads an adapter, in the layouts of diffusers (".lora.down.weight", ".lora_A.weight", attention processors as before
/// 0.22; r and lora_alpha from the text "lora_adapter_metadata" among the file's, where there is one), of peft
/// ("base_model.model...", with adapter_config.json beside it, for r and lora_alpha) and of kohya's scripts
/// ("lora_unet_..." with alphas). Without an alpha the scale is 1.
///   configs  of the checkpoint that it is for
///   errors   those of TensorFile::open(); corrupt_data: half of a pair is missing or there twice, or shapes do not fit
///            each other, their layer or r; not_found: peft's configuration; unsupported: a tensor that is no part of
///            such an adapter, of another type than F16, BF16 and F32, or for a layer that the networks do not have; a
///            field that scales layers otherwise (use_rslora, use_dora, alpha_pattern, rank_pattern). `where` names the
///            tensor or the field
[[nodiscard]] Result<AdapterWeights> read_adapter(const std::filesystem::path& path, const Configs& configs);
/// The same of a file that is open.
///   settings  of peft's configuration; those in the file's own texts count more
[[nodiscard]] Result<AdapterWeights> decode_adapter(const TensorFile& file, const Configs& configs,
                                                    const std::optional<AdapterSettings>& settings = std::nullopt);

/// May these layers be put on the networks? What decode_adapter() gives may.
///   errors  invalid_argument: a layer that the networks do not have, shapes that do not fit it, or a number that is
///           not finite; `where` names the layer
[[nodiscard]] Result<void> check_adapter(const AdapterWeights& weights, const Configs& configs);

/// Of all that is used of it: names, shapes, numbers and scales.
[[nodiscard]] std::string digest_of(const AdapterWeights& weights);

/// The file that diffusers' training scripts write today ("unet.LAYER.lora.down.weight"). It has no place for a scale:
/// one other than 1 is multiplied into B.
[[nodiscard]] std::string encode_adapter(const AdapterWeights& weights);

}  // namespace engine::weights
