#include "engine/weights/adapter_file.h"

#include <gtest/gtest.h>

#include "tests/engine/weights/samples.h"

namespace engine::weights {
namespace {

using Tensors = std::map<std::string, FloatTensor>;

Result<AdapterWeights> decoded(const Tensors& tensors) {
  const auto file = TensorFile::parse(bytes_of(encode_tensors(tensors)), "lora.safetensors");
  if (!file) return propagate(file);
  return decode_adapter(*file, tiny_configs());
}

FloatTensor ones(const Shape& shape) {
  std::size_t count = 1;
  for (const std::int64_t size : shape) count *= std::size_t(size);
  return {shape, std::vector<float>(count, 1.0f)};
}

TEST(AdapterFile, WhatIsWrittenIsReadWithItsScaleInB) {
  AdapterWeights weights;
  weights.unet["mid_block.attentions.0.transformer_blocks.0.attn1.to_q"] = {ones({2, 8}), ones({8, 2}), 4.0};
  weights.text_encoder["text_model.encoder.layers.0.self_attn.q_proj"] = {ones({2, 6}), ones({6, 2}), 1.0};
  const auto file = TensorFile::parse(bytes_of(encode_adapter(weights)), "lora.safetensors");
  ASSERT_TRUE(file);
  EXPECT_NE(file->find("unet.mid_block.attentions.0.transformer_blocks.0.attn1.to_q.lora.down.weight"), nullptr);
  const auto read = decode_adapter(*file, tiny_configs());
  ASSERT_TRUE(read) << read.error().where << read.error().message;
  const LowRank& to_q = read->unet.begin()->second;
  EXPECT_EQ(to_q.scale, 1.0);
  EXPECT_EQ(to_q.up.values, std::vector<float>(16, 4.0f));
  EXPECT_EQ(read->text_encoder.begin()->second.up.values, std::vector<float>(12, 1.0f));
}

TEST(AdapterFile, ConvolutionsOfKohyasScriptsAreKept) {
  const auto read = decoded({{"lora_unet_down_blocks_0_resnets_0_conv1.lora_down.weight", ones({2, 4, 3, 3})},
                             {"lora_unet_down_blocks_0_resnets_0_conv1.lora_up.weight", ones({4, 2, 1, 1})},
                             {"lora_unet_down_blocks_0_resnets_0_conv1.alpha", {{}, {1.0f}}},
                             {"lora_te_text_model_encoder_layers_1_mlp_fc1.lora_down.weight", ones({1, 6})},
                             {"lora_te_text_model_encoder_layers_1_mlp_fc1.lora_up.weight", ones({10, 1})}});
  ASSERT_TRUE(read) << read.error().where << read.error().message;
  const LowRank& conv = read->unet.at("down_blocks.0.resnets.0.conv1");
  EXPECT_EQ(conv.down.shape, (Shape{2, 4, 3, 3}));
  EXPECT_EQ(conv.up.shape, (Shape{4, 2, 1, 1}));
  EXPECT_EQ(conv.scale, 0.5);
  EXPECT_EQ(read->text_encoder.at("text_model.encoder.layers.1.mlp.fc1").scale, 1.0);
}

TEST(AdapterFile, WhatDoesNotFitIsNamed) {
  const std::string layer = "unet.mid_block.attentions.0.transformer_blocks.0.attn1.to_q";
  const auto where = [](const Tensors& tensors) {
    const auto read = decoded(tensors);
    return read ? "accepted" : read.error().where;
  };
  EXPECT_EQ(where({{layer + ".lora.down.weight", ones({2, 8})}}), "lora.safetensors:" + layer + ".lora.down.weight");
  EXPECT_EQ(where({{layer + ".lora.down.weight", ones({2, 7})}, {layer + ".lora.up.weight", ones({8, 2})}}),
            "lora.safetensors:" + layer + ".lora.down.weight");
  EXPECT_EQ(where({{layer + ".lora.down.weight", ones({2, 8})}, {layer + ".lora.up.weight", ones({8, 3})}}),
            "lora.safetensors:" + layer + ".lora.down.weight");
  EXPECT_EQ(where({{"unet.nowhere.lora.down.weight", ones({2, 8})}}), "lora.safetensors:unet.nowhere.lora.down.weight");
  EXPECT_EQ(where({{layer + ".hada_w1_a", ones({2, 8})}}), "lora.safetensors:" + layer + ".hada_w1_a");
  EXPECT_EQ(where({{layer + ".alpha", ones({1})}}).substr(0, 16), "lora.safetensors");
  EXPECT_EQ(where({}), "lora.safetensors");
}

}  // namespace
}  // namespace engine::weights
