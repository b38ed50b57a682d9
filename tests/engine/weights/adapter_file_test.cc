#include "engine/weights/adapter_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

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
  EXPECT_EQ(where({{layer + ".alpha", ones({1})}}), "lora.safetensors:" + layer + ".alpha");
  const FloatTensor down = ones({2, 8}), up = ones({8, 2});
  EXPECT_EQ(where({{layer + ".lora.down.weight", down}, {layer + ".lora.up.weight", up}}), "accepted");
  EXPECT_EQ(where({{layer + ".lora_down.weight", down}, {layer + ".lora.down.weight", down}}),
            "lora.safetensors:" + layer + ".lora_down.weight")
      << "its layer has one of the other name";
  EXPECT_EQ(where({{layer + ".lora.down.weight", ones({9, 8})}, {layer + ".lora.up.weight", ones({8, 9})}}),
            "lora.safetensors:" + layer + ".lora.down.weight")
      << "of a greater rank than its layer has rows or columns";
  const std::string pieces = "text_encoder.text_model.embeddings.token_embedding.lora_A.weight";
  EXPECT_EQ(where({{pieces, ones({2, 6})}}), "lora.safetensors:" + pieces) << "nothing is multiplied by that table";
  EXPECT_EQ(where({}), "lora.safetensors");
}

TEST(AdapterFile, AShapeThatNoBytesStandForIsRefusedBeforeAnythingIsAllocated) {
  const auto refused = [](const std::string& claim) {
    const auto file = TensorFile::parse(hostile_adapter(claim), "a");
    if (!file) return file.error();
    const auto read = decode_adapter(*file, tiny_configs());
    return read ? Error{ErrorCode::internal, "accepted", {}} : read.error();
  };
  const std::string tensor = "a:unet.mid_block.attentions.0.transformer_blocks.0.attn1.to_q.lora.down.weight";
  EXPECT_EQ(refused(R"("Q","shape":[8000000000000,8])").code, ErrorCode::unsupported);
  EXPECT_EQ(refused(R"("Q","shape":[8000000000000,8])").where, tensor);
  for (const char* dtype : {R"("Q")", R"("F32")", R"("F16")", R"("I64")"}) {
    EXPECT_EQ(refused(dtype + std::string(R"(,"shape":[2305843009213693952,8])")).code, ErrorCode::corrupt_data)
        << dtype;
    EXPECT_EQ(refused(dtype + std::string(R"(,"shape":[2305843009213693952,8])")).where, tensor) << dtype;
  }
}

const std::string some_layer = "mid_block.attentions.0.transformer_blocks.0.attn1.to_q";

Result<AdapterWeights> with_metadata(const std::string& json) {
  const auto file = TensorFile::parse(bytes_of(encode_tensors({{"unet." + some_layer + ".lora_A.weight", ones({2, 8})},
                                                               {"unet." + some_layer + ".lora_B.weight", ones({8, 2})}},
                                                              {{"lora_adapter_metadata", json}})),
                                      "a");
  return decode_adapter(file.value(), tiny_configs());
}

TEST(AdapterFile, TheScaleIsThatOfTheFilesOwnTexts) {
  const auto scale = [](const std::string& json) { return with_metadata(json).value().unet.at(some_layer).scale; };
  EXPECT_EQ(scale(R"({"unet.r":2,"unet.lora_alpha":6,"unet.use_dora":false,"unet.alpha_pattern":{}})"), 3);
  EXPECT_EQ(scale(R"({"r":2,"lora_alpha":6})"), 3);
  EXPECT_EQ(scale(R"({"text_encoder.r":8,"text_encoder.lora_alpha":6})"), 1) << "of the other network";
}

TEST(AdapterFile, AScaleThatIsNotReadIsRefused) {
  const auto refused = [](const std::string& json) {
    const auto read = with_metadata(json);
    return read ? Error{ErrorCode::internal, "accepted", {}} : read.error();
  };
  for (const std::string field :
       {"use_rslora\":true", "use_dora\":true", "alpha_pattern\":{\"to_q\":4}", "rank_pattern\":{\"to_q\":4}"}) {
    const Error error = refused(R"({"unet.r":2,"unet.lora_alpha":6,"unet.)" + field + "}");
    EXPECT_EQ(error.code, ErrorCode::unsupported) << field;
    EXPECT_EQ(error.where, "a:lora_adapter_metadata:unet." + field.substr(0, field.find('"')));
  }
  EXPECT_EQ(refused(R"({"unet.r":4,"unet.lora_alpha":6})").where, "a:unet." + some_layer + ".lora_A.weight");
  EXPECT_EQ(refused(R"({"unet.r":2,"unet.lora_alpha":0})").where, "a:lora_adapter_metadata:unet.lora_alpha");
  EXPECT_EQ(refused(R"({"unet.r":1.5,"unet.lora_alpha":1})").where, "a:lora_adapter_metadata:unet.r");
  EXPECT_EQ(refused("7").where, "a:lora_adapter_metadata");
  EXPECT_EQ(refused("{").where, "a:lora_adapter_metadata");
}

TEST(AdapterFile, OneOfPeftsNeedsItsConfiguration) {
  support::TempDir folder;
  const auto path = folder.path() / "adapter_model.safetensors";
  const std::string tensor = "base_model.model." + some_layer + ".lora_A.weight";
  support::write_file(path, encode_tensors({{tensor, ones({2, 8})},
                                            {"base_model.model." + some_layer + ".lora_B.weight", ones({8, 2})}}));
  const auto alone = read_adapter(path, tiny_configs());
  ASSERT_FALSE(alone);
  EXPECT_EQ(alone.error().code, ErrorCode::not_found);
  const auto configured = [&](const std::string& json) {
    support::write_file(folder.path() / "adapter_config.json", json);
    return read_adapter(path, tiny_configs());
  };
  EXPECT_EQ(configured(R"({"r":2,"lora_alpha":5})").value().unet.at(some_layer).scale, 2.5);
  EXPECT_EQ(configured(R"({"r":3,"lora_alpha":5})").error().where, "adapter_model.safetensors:" + tensor);
  EXPECT_EQ(configured(R"({"r":2,"lora_alpha":5,"use_rslora":true})").error().where, "adapter_config.json:use_rslora");
  EXPECT_EQ(configured(R"({"lora_alpha":5})").error().where, "adapter_config.json:r");
}

TEST(AdapterFile, LayersThatDoNotFitTheNetworksAreNamed) {
  const auto where = [](const std::string& layer, const LowRank& pair) {
    const auto checked = check_adapter({.unet = {{layer, pair}}, .text_encoder = {}}, tiny_configs());
    return checked ? "accepted" : checked.error().where;
  };
  EXPECT_EQ(where(some_layer, {ones({2, 8}), ones({8, 2}), 1}), "accepted");
  EXPECT_EQ(where("nowhere", {ones({2, 8}), ones({8, 2}), 1}), "nowhere");
  EXPECT_EQ(where(some_layer, {ones({2, 7}), ones({8, 2}), 1}), some_layer);
  EXPECT_EQ(where(some_layer, {ones({2, 8, 1, 1}), ones({8, 2, 1, 1}), 1}), some_layer) << "matrices are kept as such";
  EXPECT_EQ(where(some_layer, {{{2, 8}, {1, 2}}, ones({8, 2}), 1}), some_layer);
  EXPECT_EQ(where(some_layer, {ones({2, 8}), ones({8, 2}), std::nan("")}), some_layer);
  LowRank poisoned{ones({2, 8}), ones({8, 2}), 1};
  poisoned.up.values[3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(where(some_layer, poisoned), some_layer);
}

}  // namespace
}  // namespace engine::weights
