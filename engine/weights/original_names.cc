#include "engine/weights/original_names.h"

#include <array>
#include <charconv>
#include <string_view>
#include <utility>

namespace engine::weights {
namespace {

/// A name with its first part taken off: walks along "down_blocks.1.resnets.0.norm1.weight".
class Walk {
 public:
  explicit Walk(std::string_view name) : rest_(name) {}

  [[nodiscard]] std::string rest() const { return std::string(rest_); }
  /// Steps over `part` and the dot after it, if the name goes on so.
  bool take(std::string_view part) {
    if (!rest_.starts_with(part) || rest_.size() <= part.size() || rest_[part.size()] != '.') return false;
    rest_.remove_prefix(part.size() + 1);
    return true;
  }
  /// Steps over a number and the dot after it.
  int number() {
    int value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    (void)error;  // names are those of tensors_of(), which has a number here
    rest_.remove_prefix(std::size_t(end - rest_.data()) + 1);
    return value;
  }

 private:
  std::string_view rest_;
};

using Renamed = std::pair<std::string_view, std::string_view>;

/// `name` with its first part replaced, by the first pair that fits.
template <std::size_t N>
std::string renamed(const std::string& name, const std::array<Renamed, N>& pairs) {
  for (const auto& [from, to] : pairs)
    if (name.starts_with(from)) return std::string(to) + name.substr(from.size());
  return name;
}

std::string of_resnet(const std::string& part) {
  static constexpr std::array<Renamed, 6> pairs = {{{"norm1.", "in_layers.0."},
                                                    {"conv1.", "in_layers.2."},
                                                    {"time_emb_proj.", "emb_layers.1."},
                                                    {"norm2.", "out_layers.0."},
                                                    {"conv2.", "out_layers.3."},
                                                    {"conv_shortcut.", "skip_connection."}}};
  return renamed(part, pairs);
}

/// Blocks are counted through, across levels, with what halves and doubles the size among them.
std::string of_unet(const UNetConfig& config, const std::string& name) {
  Walk at(name);
  const int layers = config.layers_per_block;
  const auto of_layer = [&](const std::string& blocks, int first) {
    const bool is_resnet = at.take("resnets");
    if (!is_resnet) at.take("attentions");
    const std::string block = blocks + std::to_string(first + at.number());
    return is_resnet ? block + ".0." + of_resnet(at.rest()) : block + ".1." + at.rest();
  };
  if (at.take("down_blocks")) {
    const int first = 1 + at.number() * (layers + 1);
    if (at.take("downsamplers.0.conv")) return "input_blocks." + std::to_string(first + layers) + ".0.op." + at.rest();
    return of_layer("input_blocks.", first);
  }
  if (at.take("mid_block")) {
    if (at.take("attentions.0")) return "middle_block.1." + at.rest();
    at.take("resnets");
    const int which = at.number();
    return "middle_block." + std::to_string(2 * which) + "." + of_resnet(at.rest());
  }
  if (at.take("up_blocks")) {
    const int level = at.number(), first = level * (layers + 1);
    if (at.take("upsamplers.0.conv")) {
      // It shares its block with the level's last layer: a resnet, and a transformer where the level has them.
      const int place = config.up_attends[std::size_t(level)] ? 2 : 1;
      return "output_blocks." + std::to_string(first + layers) + "." + std::to_string(place) + ".conv." + at.rest();
    }
    return of_layer("output_blocks.", first);
  }
  static constexpr std::array<Renamed, 5> pairs = {{{"conv_in.", "input_blocks.0.0."},
                                                    {"time_embedding.linear_1.", "time_embed.0."},
                                                    {"time_embedding.linear_2.", "time_embed.2."},
                                                    {"conv_norm_out.", "out.0."},
                                                    {"conv_out.", "out.2."}}};
  return renamed(name, pairs);
}

std::string of_autoencoder(const AutoencoderConfig& config, const std::string& name) {
  static constexpr std::array<Renamed, 1> resnet = {{{"conv_shortcut.", "nin_shortcut."}}};
  static constexpr std::array<Renamed, 5> attention = {
      {{"group_norm.", "norm."}, {"to_q.", "q."}, {"to_k.", "k."}, {"to_v.", "v."}, {"to_out.0.", "proj_out."}}};
  static constexpr std::array<Renamed, 1> ends = {{{"conv_norm_out.", "norm_out."}}};
  Walk at(name);
  std::string half;
  if (at.take("encoder"))
    half = "encoder.";
  else if (at.take("decoder"))
    half = "decoder.";
  else
    return name;  // quant_conv, post_quant_conv
  if (at.take("mid_block")) {
    if (at.take("attentions.0")) return half + "mid.attn_1." + renamed(at.rest(), attention);
    at.take("resnets");
    const int which = at.number();
    return half + "mid.block_" + std::to_string(which + 1) + "." + renamed(at.rest(), resnet);
  }
  const bool down = at.take("down_blocks");
  if (!down && !at.take("up_blocks")) return half + renamed(at.rest(), ends);
  // Levels are counted from the finest one on, also where the decoder begins with the coarsest.
  const int i = at.number(), level = down ? i : int(config.channels.size()) - 1 - i;
  const std::string block = half + (down ? "down." : "up.") + std::to_string(level);
  if (at.take("downsamplers.0")) return block + ".downsample." + at.rest();
  if (at.take("upsamplers.0")) return block + ".upsample." + at.rest();
  at.take("resnets");
  const int layer = at.number();
  return block + ".block." + std::to_string(layer) + "." + renamed(at.rest(), resnet);
}

OriginalPlace of_open_clip(const std::string& name) {
  Walk at(name);
  at.take("text_model");
  if (!at.take("encoder.layers")) {
    static constexpr std::array<Renamed, 3> pairs = {{{"embeddings.token_embedding.weight", "token_embedding.weight"},
                                                      {"embeddings.position_embedding.weight", "positional_embedding"},
                                                      {"final_layer_norm.", "ln_final."}}};
    return {renamed(at.rest(), pairs), -1};
  }
  const int layer = at.number();
  const std::string block = "transformer.resblocks." + std::to_string(layer) + ".";
  static constexpr std::array<std::string_view, 3> thirds = {"self_attn.q_proj", "self_attn.k_proj",
                                                             "self_attn.v_proj"};
  for (std::size_t third = 0; third < thirds.size(); ++third)
    if (at.take(thirds[third])) return {block + "attn.in_proj_" + at.rest(), int(third)};
  static constexpr std::array<Renamed, 5> pairs = {{{"layer_norm1.", "ln_1."},
                                                    {"layer_norm2.", "ln_2."},
                                                    {"mlp.fc1.", "mlp.c_fc."},
                                                    {"mlp.fc2.", "mlp.c_proj."},
                                                    {"self_attn.out_proj.", "attn.out_proj."}}};
  return {block + renamed(at.rest(), pairs), -1};
}

}  // namespace

OriginalPlace original_place(const Configs& configs, Network network, const std::string& name, bool open_clip) {
  switch (network) {
    case Network::unet:
      return {"model.diffusion_model." + of_unet(configs.unet, name), -1};
    case Network::autoencoder:
      return {"first_stage_model." + of_autoencoder(configs.autoencoder, name), -1};
    case Network::text_encoder:
      break;
  }
  if (!open_clip) return {"cond_stage_model.transformer." + name, -1};
  OriginalPlace place = of_open_clip(name);
  place.name.insert(0, "cond_stage_model.model.");
  return place;
}

std::string old_autoencoder_name(const std::string& name) {
  static constexpr std::array<Renamed, 4> pairs = {
      {{".to_q.", ".query."}, {".to_k.", ".key."}, {".to_v.", ".value."}, {".to_out.0.", ".proj_attn."}}};
  for (const auto& [now, before] : pairs)
    if (const std::size_t at = name.find(now); at != std::string::npos)
      return name.substr(0, at) + std::string(before) + name.substr(at + now.size());
  return name;
}

}  // namespace engine::weights
