#include "engine/weights/networks.h"

#include <utility>

namespace engine::weights {
namespace {

/// A list of tensors that grows by layers, each below a name.
class List {
 public:
  void matrix(const std::string& name, int out, int in, bool bias = true) { layer(name, {out, in}, bias); }
  void convolution(const std::string& name, int out, int in, int side) { layer(name, {out, in, side, side}, true); }
  void norm(const std::string& name, int channels) { layer(name, {channels}, true); }
  void tensor(std::string name, Shape shape) { tensors_.push_back({std::move(name), std::move(shape)}); }

  /// Two convolutions and what goes around them.
  ///   embedding_width  of the time step's embedding; 0: it has none
  void resnet(const std::string& name, int in, int out, int embedding_width) {
    norm(name + ".norm1", in);
    convolution(name + ".conv1", out, in, 3);
    if (embedding_width > 0) matrix(name + ".time_emb_proj", out, embedding_width);
    norm(name + ".norm2", out);
    convolution(name + ".conv2", out, out, 3);
    if (in != out) convolution(name + ".conv_shortcut", out, in, 1);
  }

  void attention(const std::string& name, int width, int context_width) {
    matrix(name + ".to_q", width, width, false);
    matrix(name + ".to_k", width, context_width, false);
    matrix(name + ".to_v", width, context_width, false);
    matrix(name + ".to_out.0", width, width);
  }

  void transformer(const std::string& name, int width, const UNetConfig& config) {
    const auto projection = [&](const std::string& at) {
      if (config.linear_projection)
        matrix(at, width, width);
      else
        convolution(at, width, width, 1);
    };
    norm(name + ".norm", width);
    projection(name + ".proj_in");
    const std::string block = name + ".transformer_blocks.0";
    norm(block + ".norm1", width);
    attention(block + ".attn1", width, width);
    norm(block + ".norm2", width);
    attention(block + ".attn2", width, config.context_width);
    norm(block + ".norm3", width);
    matrix(block + ".ff.net.0.proj", 8 * width, width);
    matrix(block + ".ff.net.2", width, 4 * width);
    projection(name + ".proj_out");
  }

  [[nodiscard]] std::vector<TensorSpec> take() && { return std::move(tensors_); }

 private:
  void layer(const std::string& name, Shape shape, bool bias) {
    const std::int64_t out = shape.front();
    tensor(name + ".weight", std::move(shape));
    if (bias) tensor(name + ".bias", {out});
  }

  std::vector<TensorSpec> tensors_;
};

std::string numbered(const std::string& name, int i) { return name + "." + std::to_string(i); }

/// The coarsest level of encoder and decoder: the one place where an autoencoder attends.
void list_middle(List& list, const std::string& name, int width) {
  list.resnet(name + ".resnets.0", width, width, 0);
  const std::string attention = name + ".attentions.0";
  list.norm(attention + ".group_norm", width);
  for (const char* projection : {".to_q", ".to_k", ".to_v", ".to_out.0"})
    list.matrix(attention + projection, width, width);
  list.resnet(name + ".resnets.1", width, width, 0);
}

void list_down(List& list, const UNetConfig& config) {
  const int levels = int(config.channels.size());
  int in = config.channels.front();
  for (int level = 0; level < levels; ++level) {
    const std::string block = numbered("down_blocks", level);
    const int out = config.channels[std::size_t(level)];
    for (int layer = 0; layer < config.layers_per_block; ++layer) {
      list.resnet(numbered(block + ".resnets", layer), layer == 0 ? in : out, out, config.embedding_width());
      if (config.down_attends[std::size_t(level)])
        list.transformer(numbered(block + ".attentions", layer), out, config);
    }
    if (level + 1 < levels) list.convolution(block + ".downsamplers.0.conv", out, out, 3);
    in = out;
  }
}

void list_up(List& list, const UNetConfig& config) {
  const int levels = int(config.channels.size());
  int in = config.channels.back();
  for (int i = 0; i < levels; ++i) {
    const std::string block = numbered("up_blocks", i);
    const int level = levels - 1 - i;
    const int out = config.channels[std::size_t(level)];
    const int finer = config.channels[std::size_t(level > 0 ? level - 1 : 0)];
    for (int layer = 0; layer <= config.layers_per_block; ++layer) {
      // Beside what comes up lies what the way down left at this level, whose first piece has the finer level's width.
      const int skipped = layer == config.layers_per_block ? finer : out;
      list.resnet(numbered(block + ".resnets", layer), (layer == 0 ? in : out) + skipped, out,
                  config.embedding_width());
      if (config.up_attends[std::size_t(i)]) list.transformer(numbered(block + ".attentions", layer), out, config);
    }
    if (level > 0) list.convolution(block + ".upsamplers.0.conv", out, out, 3);
    in = out;
  }
}

}  // namespace

Configs stable_diffusion_1() { return {}; }

Configs stable_diffusion_2_base() {
  Configs configs;
  configs.unet.heads = {5, 10, 20, 20};
  configs.unet.context_width = 1024;
  configs.unet.linear_projection = true;
  configs.text_encoder.width = 1024;
  configs.text_encoder.feed_forward_width = 4096;
  configs.text_encoder.layers = 23;  // of 24: the last one's output is not used
  configs.text_encoder.heads = 16;
  configs.text_encoder.activation = Activation::gelu;
  return configs;
}

std::vector<TensorSpec> tensors_of(const UNetConfig& config) {
  List list;
  const int first = config.channels.front(), last = config.channels.back(), embedding = config.embedding_width();
  list.convolution("conv_in", first, config.in_channels, 3);
  list.matrix("time_embedding.linear_1", embedding, first);
  list.matrix("time_embedding.linear_2", embedding, embedding);
  list_down(list, config);
  list.resnet("mid_block.resnets.0", last, last, embedding);
  list.transformer("mid_block.attentions.0", last, config);
  list.resnet("mid_block.resnets.1", last, last, embedding);
  list_up(list, config);
  list.norm("conv_norm_out", first);
  list.convolution("conv_out", config.out_channels, first, 3);
  return std::move(list).take();
}

std::vector<TensorSpec> tensors_of(const AutoencoderConfig& config) {
  List list;
  const int levels = int(config.channels.size()), latents = config.latent_channels;
  const int first = config.channels.front(), last = config.channels.back();
  list.convolution("encoder.conv_in", first, config.image_channels, 3);
  int in = first;
  for (int level = 0; level < levels; ++level) {
    const std::string block = numbered("encoder.down_blocks", level);
    const int out = config.channels[std::size_t(level)];
    for (int layer = 0; layer < config.layers_per_block; ++layer)
      list.resnet(numbered(block + ".resnets", layer), layer == 0 ? in : out, out, 0);
    if (level + 1 < levels) list.convolution(block + ".downsamplers.0.conv", out, out, 3);
    in = out;
  }
  list_middle(list, "encoder.mid_block", last);
  list.norm("encoder.conv_norm_out", last);
  list.convolution("encoder.conv_out", 2 * latents, last, 3);
  list.convolution("quant_conv", 2 * latents, 2 * latents, 1);
  list.convolution("post_quant_conv", latents, latents, 1);
  list.convolution("decoder.conv_in", last, latents, 3);
  list_middle(list, "decoder.mid_block", last);
  in = last;
  for (int i = 0; i < levels; ++i) {
    const std::string block = numbered("decoder.up_blocks", i);
    const int out = config.channels[std::size_t(levels - 1 - i)];
    for (int layer = 0; layer <= config.layers_per_block; ++layer)
      list.resnet(numbered(block + ".resnets", layer), layer == 0 ? in : out, out, 0);
    if (i + 1 < levels) list.convolution(block + ".upsamplers.0.conv", out, out, 3);
    in = out;
  }
  list.norm("decoder.conv_norm_out", first);
  list.convolution("decoder.conv_out", config.image_channels, first, 3);
  return std::move(list).take();
}

std::vector<TensorSpec> tensors_of(const TextEncoderConfig& config) {
  List list;
  list.tensor("text_model.embeddings.token_embedding.weight", {config.vocabulary, config.width});
  list.tensor("text_model.embeddings.position_embedding.weight", {config.positions, config.width});
  for (int layer = 0; layer < config.layers; ++layer) {
    const std::string name = numbered("text_model.encoder.layers", layer);
    for (const char* projection :
         {".self_attn.q_proj", ".self_attn.k_proj", ".self_attn.v_proj", ".self_attn.out_proj"})
      list.matrix(name + projection, config.width, config.width);
    list.norm(name + ".layer_norm1", config.width);
    list.norm(name + ".layer_norm2", config.width);
    list.matrix(name + ".mlp.fc1", config.feed_forward_width, config.width);
    list.matrix(name + ".mlp.fc2", config.width, config.feed_forward_width);
  }
  list.norm("text_model.final_layer_norm", config.width);
  return std::move(list).take();
}

std::vector<TensorSpec> tensors_of(const Configs& configs, Network network) {
  switch (network) {
    case Network::unet:
      return tensors_of(configs.unet);
    case Network::autoencoder:
      return tensors_of(configs.autoencoder);
    case Network::text_encoder:
      return tensors_of(configs.text_encoder);
  }
  return {};
}

}  // namespace engine::weights
