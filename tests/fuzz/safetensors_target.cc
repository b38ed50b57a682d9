// Files of tensors: the header, a checkpoint in one file, an adapter, LPIPS, and a network's configuration.
#include <vector>

#include "engine/weights/adapter_file.h"
#include "engine/weights/checkpoint.h"
#include "engine/weights/lpips_files.h"
#include "engine/weights/networks.h"
#include "tests/engine/weights/samples.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace engine::weights;

/// A configuration that is accepted has tensors that can be listed.
void read_configs(std::span<const std::byte> bytes) {
  if (const auto unet = parse_unet_config(bytes, "config.json"))
    fuzz::demand(!tensors_of(*unet).empty(), "a network that is accepted has tensors");
  if (const auto autoencoder = parse_autoencoder_config(bytes, "config.json"))
    fuzz::demand(!tensors_of(*autoencoder).empty(), "a network that is accepted has tensors");
  if (const auto encoder = parse_text_encoder_config(bytes, "config.json"))
    fuzz::demand(!tensors_of(*encoder).empty(), "a network that is accepted has tensors");
  (void)parse_noise_config(bytes, "config.json");
}

std::string file_text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  read_configs(bytes);
  auto file = TensorFile::parse({bytes.begin(), bytes.end()}, "a.safetensors");
  if (!file) return;
  for (const auto& [name, tensor] : file->tensors()) {
    if (!tensor.has_floats()) continue;
    std::vector<float> values(tensor.elements());
    (void)read_floats(tensor, name, values);
  }
  if (const auto adapter = decode_adapter(*file, tiny_configs(), AdapterSettings{}); adapter) {
    demand(check_adapter(*adapter, tiny_configs()).has_value(), "an adapter that is accepted fits");
    demand(TensorFile::parse(bytes_of(encode_adapter(*adapter)), "a.safetensors").has_value(),
           "an adapter that is accepted can be written");
    demand(digest_of(*adapter).size() == 16, "it has a digest");
  }
  demand(!LpipsFiles{*file, *file}.check(), "LPIPS's networks have more numbers than an input here");
  if (const auto checkpoint = Checkpoint::of_file(std::move(*file), tiny_configs())) (void)checkpoint->check();
}

std::vector<std::string> fuzz::seeds() {
  const std::string layer = "unet.mid_block.attentions.0.transformer_blocks.0.attn1.to_q.lora.";
  const std::string text = "cond_stage_model.transformer.text_model.embeddings.token_embedding.weight";
  return {
      file_text(hostile_adapter(R"("Q","shape":[8000000000000,8])")),
      file_text(hostile_adapter(R"("F32","shape":[2305843009213693952,8])")),
      encode_tensors({{layer + "down.weight", {{1, 8}, std::vector<float>(8, 1.0f)}},
                      {layer + "up.weight", {{8, 1}, std::vector<float>(8, 1.0f)}}},
                     {{"lora_adapter_metadata", R"({"unet.r":1,"unet.lora_alpha":2,"unet.use_dora":false})"}}),
      encode_tensors({{"features.0.weight", {{64, 3, 3, 3}, std::vector<float>(1728, 0.5f)}},
                      {"features.0.bias", {{64}, std::vector<float>(64, 0.5f)}}}),
      encode_tensors({{"x", {{2, 2}, {1, 2, 3, 4}}}, {"y", {{}, {1}}}}, {{"format", "pt"}}),
      encode_tensors({{layer + "down.weight", {{1, 8}, std::vector<float>(8, 1.0f)}},
                      {layer + "up.weight", {{8, 1}, std::vector<float>(8, 1.0f)}}}),
      encode_tensors({{text, {{520, 6}, std::vector<float>(3120, 0.5f)}}}),
      R"({"block_out_channels":[4,8],"attention_head_dim":2,"cross_attention_dim":6,"norm_num_groups":2,)"
      R"("down_block_types":["CrossAttnDownBlock2D","DownBlock2D"],"up_block_types":["UpBlock2D","CrossAttnUpBlock2D"]})",
      R"({"hidden_size":6,"num_attention_heads":2,"hidden_act":"gelu","vocab_size":520})"};
}
