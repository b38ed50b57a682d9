#include "engine/weights/checkpoint.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

namespace engine::weights {
namespace {

constexpr std::uint64_t seed = 7;

Result<Checkpoint> checkpoint_of(const std::map<std::string, FloatTensor>& tensors, const Configs& configs) {
  auto file = TensorFile::parse(bytes_of(encode_tensors(tensors)), "model.safetensors");
  if (!file) return propagate(file);
  return Checkpoint::of_file(std::move(*file), configs);
}

/// A place of each generation where the authors' names are known by heart.
TEST(Checkpoint, KnowsTheFirstAuthorsNames) {
  const Configs one = stable_diffusion_1(), two = stable_diffusion_2_base();
  const auto unet = [&](const char* name) { return original_place(one, Network::unet, name, false).name; };
  EXPECT_EQ(unet("conv_in.weight"), "model.diffusion_model.input_blocks.0.0.weight");
  EXPECT_EQ(unet("down_blocks.0.resnets.1.time_emb_proj.bias"),
            "model.diffusion_model.input_blocks.2.0.emb_layers.1.bias");
  EXPECT_EQ(unet("down_blocks.0.downsamplers.0.conv.weight"), "model.diffusion_model.input_blocks.3.0.op.weight");
  EXPECT_EQ(unet("down_blocks.3.resnets.1.conv2.weight"),
            "model.diffusion_model.input_blocks.11.0.out_layers.3.weight");
  EXPECT_EQ(unet("mid_block.resnets.1.norm1.weight"), "model.diffusion_model.middle_block.2.in_layers.0.weight");
  EXPECT_EQ(unet("mid_block.attentions.0.proj_in.weight"), "model.diffusion_model.middle_block.1.proj_in.weight");
  EXPECT_EQ(unet("up_blocks.0.upsamplers.0.conv.weight"), "model.diffusion_model.output_blocks.2.1.conv.weight");
  EXPECT_EQ(unet("up_blocks.1.upsamplers.0.conv.weight"), "model.diffusion_model.output_blocks.5.2.conv.weight");
  EXPECT_EQ(unet("up_blocks.3.attentions.2.transformer_blocks.0.attn2.to_v.weight"),
            "model.diffusion_model.output_blocks.11.1.transformer_blocks.0.attn2.to_v.weight");
  EXPECT_EQ(unet("up_blocks.3.resnets.2.conv_shortcut.weight"),
            "model.diffusion_model.output_blocks.11.0.skip_connection.weight");
  const auto vae = [&](const char* name) { return original_place(one, Network::autoencoder, name, false).name; };
  EXPECT_EQ(vae("encoder.down_blocks.1.resnets.0.conv_shortcut.weight"),
            "first_stage_model.encoder.down.1.block.0.nin_shortcut.weight");
  EXPECT_EQ(vae("decoder.up_blocks.0.upsamplers.0.conv.weight"), "first_stage_model.decoder.up.3.upsample.conv.weight");
  EXPECT_EQ(vae("decoder.mid_block.attentions.0.to_out.0.bias"), "first_stage_model.decoder.mid.attn_1.proj_out.bias");
  EXPECT_EQ(vae("encoder.conv_norm_out.weight"), "first_stage_model.encoder.norm_out.weight");
  EXPECT_EQ(vae("quant_conv.weight"), "first_stage_model.quant_conv.weight");
  const OriginalPlace key =
      original_place(two, Network::text_encoder, "text_model.encoder.layers.22.self_attn.k_proj.bias", true);
  EXPECT_EQ(key.name, "cond_stage_model.model.transformer.resblocks.22.attn.in_proj_bias");
  EXPECT_EQ(key.third, 1);
  EXPECT_EQ(original_place(two, Network::text_encoder, "text_model.embeddings.position_embedding.weight", true).name,
            "cond_stage_model.model.positional_embedding");
}

TEST(Checkpoint, NoTwoTensorsHaveOnePlace) {
  for (const bool open_clip : {false, true}) {
    const Configs configs = open_clip ? stable_diffusion_2_base() : stable_diffusion_1();
    std::set<std::pair<std::string, int>> places;
    std::size_t tensors = 0;
    for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder})
      for (const TensorSpec& spec : tensors_of(configs, network)) {
        const OriginalPlace place = original_place(configs, network, spec.name, open_clip);
        EXPECT_TRUE(places.emplace(place.name, place.third).second) << place.name;
        ++tensors;
      }
    EXPECT_EQ(places.size(), tensors);
  }
}

TEST(Checkpoint, OfOneFileHasEveryTensorOfBothGenerations) {
  for (const bool open_clip : {false, true}) {
    const Configs configs = tiny_configs(open_clip);
    const auto checkpoint = checkpoint_of(original_tensors(configs, open_clip, seed), configs);
    ASSERT_TRUE(checkpoint) << checkpoint.error().message;
    EXPECT_EQ(checkpoint->is_open_clip(), open_clip);
    const auto checked = checkpoint->check();
    EXPECT_TRUE(checked) << checked.error().where << checked.error().message;
    for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder}) {
      const auto expected = random_tensors(configs, network, seed);
      for (const TensorSpec& spec : tensors_of(configs, network)) {
        const auto found = checkpoint->find(network, spec);
        ASSERT_TRUE(found) << found.error().where;
        std::vector<float> values(found->tensor.elements());
        ASSERT_TRUE(read_floats(found->tensor, found->where, values));
        EXPECT_EQ(values, expected.at(spec.name).values) << spec.name;
      }
    }
  }
}

TEST(Checkpoint, MatricesMayBeKeptAsConvolutions) {
  const Configs configs = tiny_configs();
  auto tensors = original_tensors(configs, false, seed);
  tensors.at("first_stage_model.encoder.mid.attn_1.q.weight").shape = {8, 8, 1, 1};
  const auto checkpoint = checkpoint_of(tensors, configs);
  ASSERT_TRUE(checkpoint);
  const auto found = checkpoint->find(Network::autoencoder, {"encoder.mid_block.attentions.0.to_q.weight", {8, 8}});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->tensor.shape, (Shape{8, 8}));
}

TEST(Checkpoint, WhatIsMissingOrMisshapenIsNamedAsItIsInTheFile) {
  const Configs configs = tiny_configs();
  auto tensors = original_tensors(configs, false, seed);
  const std::string name = "model.diffusion_model.middle_block.1.norm.weight";
  tensors.at(name).shape = {2, 4};
  auto checked = checkpoint_of(tensors, configs)->check();
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().where, "model.safetensors:" + name);
  EXPECT_NE(checked.error().message.find("[2, 4]; expected [8]"), std::string::npos) << checked.error().message;
  tensors.erase(name);
  checked = checkpoint_of(tensors, configs)->check();
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().where, "model.safetensors:" + name);
}

TEST(Checkpoint, AFileWithoutATextEncoderIsNoCheckpoint) {
  const auto checkpoint = checkpoint_of({{"x", {{1}, {1}}}}, tiny_configs());
  ASSERT_FALSE(checkpoint);
  EXPECT_EQ(checkpoint.error().code, ErrorCode::unsupported);
}

TEST(Checkpoint, AFolderThatLacksAFileSaysWhich) {
  support::TempDir folder;
  const auto checkpoint = Checkpoint::open(folder.path());
  ASSERT_FALSE(checkpoint);
  EXPECT_EQ(checkpoint.error().code, ErrorCode::not_found);
  EXPECT_NE(checkpoint.error().message.find("config.json"), std::string::npos) << checkpoint.error().message;
}

}  // namespace
}  // namespace engine::weights
