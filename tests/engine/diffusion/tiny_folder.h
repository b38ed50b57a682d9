// A checkpoint of a few kilobytes with random weights.
#pragma once

#include <filesystem>
#include <string>

#include "engine/weights/vocabulary.h"
#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

namespace engine::diffusion {

inline const std::string vocab_json = [] {
  const weights::Vocabulary clip = weights::clip_vocabulary({{"a", "t</w>"}});
  std::string text;
  for (const auto& [piece, number] : clip.numbers) {
    std::string escaped;
    for (const char c : piece) escaped += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    text += (text.empty() ? "{\"" : ",\"") + escaped + "\":" + std::to_string(number);
  }
  return text + "}";
}();

/// A folder as diffusers writes it, of networks of a few kilobytes.
class TinyFolder {
 public:
  TinyFolder() {
    const weights::Configs configs = weights::tiny_configs();
    write("unet/config.json", R"({"block_out_channels":[4,8,8],"attention_head_dim":[2,2,4],"cross_attention_dim":6,
      "norm_num_groups":2,"sample_size":8,"down_block_types":["CrossAttnDownBlock2D","CrossAttnDownBlock2D","DownBlock2D"],
      "up_block_types":["UpBlock2D","CrossAttnUpBlock2D","CrossAttnUpBlock2D"]})");
    write("vae/config.json", R"({"block_out_channels":[4,8],"norm_num_groups":2,"layers_per_block":2,
      "down_block_types":["DownEncoderBlock2D","DownEncoderBlock2D"],"up_block_types":["UpDecoderBlock2D","UpDecoderBlock2D"]})");
    write("text_encoder/config.json", R"({"hidden_size":6,"intermediate_size":10,"num_hidden_layers":2,
      "num_attention_heads":2,"vocab_size":520})");
    write("scheduler/scheduler_config.json",
          R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012})");
    write("tokenizer/vocab.json", vocab_json);
    write("tokenizer/merges.txt", "#version: 0.2\na t</w>\n");
    write("unet/diffusion_pytorch_model.safetensors", tensors(configs, weights::Network::unet));
    write("vae/diffusion_pytorch_model.safetensors", tensors(configs, weights::Network::autoencoder));
    write("text_encoder/model.safetensors", tensors(configs, weights::Network::text_encoder));
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  void write(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    support::write_file(folder_.path() / name, bytes);
  }

 private:
  static std::string tensors(const weights::Configs& configs, weights::Network network) {
    return weights::encode_tensors(weights::random_tensors(configs, network, 3));
  }
  support::TempDir folder_;
};

}  // namespace engine::diffusion
