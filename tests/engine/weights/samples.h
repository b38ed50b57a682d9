// Checkpoints of a few kilobytes, made by formula.
#pragma once

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/weights/networks.h"
#include "engine/weights/original_names.h"
#include "engine/weights/safetensors.h"

namespace engine::weights {

/// Networks of every part that the real ones have, and hardly a channel.
inline Configs tiny_configs(bool open_clip = false) {
  Configs configs = open_clip ? stable_diffusion_2_base() : stable_diffusion_1();
  configs.unet.channels = {4, 8, 8};
  configs.unet.heads = {2, 2, 4};
  configs.unet.down_attends = {true, true, false};
  configs.unet.up_attends = {false, true, true};
  configs.unet.context_width = 6;
  configs.unet.norm_groups = 2;
  configs.autoencoder.channels = {4, 8};
  configs.autoencoder.norm_groups = 2;
  configs.text_encoder.width = 6;
  configs.text_encoder.feed_forward_width = 10;
  configs.text_encoder.layers = 2;
  configs.text_encoder.heads = 2;
  configs.text_encoder.vocabulary = 520;
  return configs;
}

/// Another number for each place of each tensor of a network.
inline std::map<std::string, FloatTensor> random_tensors(const Configs& configs, Network network, std::uint64_t seed) {
  std::map<std::string, FloatTensor> tensors;
  std::uint64_t stream = 0;
  for (const TensorSpec& spec : tensors_of(configs, network)) {
    std::size_t count = 1;
    for (const std::int64_t size : spec.shape) count *= std::size_t(size);
    FloatTensor tensor{spec.shape, std::vector<float>(count)};
    Rng rng(seed + std::uint64_t(network), stream++);
    for (float& value : tensor.values) value = 0.2f * rng.normal();
    tensors.emplace(spec.name, std::move(tensor));
  }
  return tensors;
}

inline std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  if (!text.empty()) std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

/// The tensors of all three networks in one file, under the first authors' names.
inline std::map<std::string, FloatTensor> original_tensors(const Configs& configs, bool open_clip, std::uint64_t seed) {
  std::map<std::string, FloatTensor> file;
  for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder})
    for (const auto& [name, tensor] : random_tensors(configs, network, seed)) {
      const OriginalPlace place = original_place(configs, network, name, open_clip);
      if (place.third < 0) {
        file.emplace(place.name, tensor);
        continue;
      }
      FloatTensor& whole = file[place.name];
      const std::size_t part = tensor.values.size();
      whole.values.resize(3 * part);
      whole.shape = tensor.shape;
      whole.shape[0] *= 3;
      std::copy(tensor.values.begin(), tensor.values.end(),
                whole.values.begin() + std::ptrdiff_t(place.third) * std::ptrdiff_t(part));
    }
  return file;
}

/// A file whose header is given as text.
inline std::vector<std::byte> file_of(const std::string& header, const std::string& data) {
  const std::uint64_t size = header.size();
  std::string bytes(reinterpret_cast<const char*>(&size), sizeof size);
  return bytes_of(bytes + header + data);
}

/// An adapter of a few hundred bytes whose first half claims a type and shape ("DTYPE","shape":[...]) for no bytes.
inline std::vector<std::byte> hostile_adapter(const std::string& claim) {
  const std::string layer = "unet.mid_block.attentions.0.transformer_blocks.0.attn1.to_q.lora.";
  return file_of("{\"" + layer + "down.weight\":{\"dtype\":" + claim + ",\"data_offsets\":[0,0]},\"" + layer +
                     "up.weight\":{\"dtype\":\"F32\",\"shape\":[8,1],\"data_offsets\":[0,32]}}",
                 std::string(32, '\0'));
}

}  // namespace engine::weights
