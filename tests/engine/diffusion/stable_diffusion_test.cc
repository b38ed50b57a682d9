#include "engine/diffusion/stable_diffusion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/rng.h"
#include "engine/weights/vocabulary.h"
#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

namespace engine::diffusion {
namespace {

using weights::Configs;
using weights::Network;

const std::string vocab_json = [] {
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
    const Configs configs = weights::tiny_configs();
    write("unet/config.json", R"({"block_out_channels":[4,8,8],"attention_head_dim":[2,2,4],"cross_attention_dim":6,
      "norm_num_groups":2,"down_block_types":["CrossAttnDownBlock2D","CrossAttnDownBlock2D","DownBlock2D"],
      "up_block_types":["UpBlock2D","CrossAttnUpBlock2D","CrossAttnUpBlock2D"]})");
    write("vae/config.json", R"({"block_out_channels":[4,8],"norm_num_groups":2,"layers_per_block":2,
      "down_block_types":["DownEncoderBlock2D","DownEncoderBlock2D"],"up_block_types":["UpDecoderBlock2D","UpDecoderBlock2D"]})");
    write("text_encoder/config.json", R"({"hidden_size":6,"intermediate_size":10,"num_hidden_layers":2,
      "num_attention_heads":2,"vocab_size":520})");
    write("scheduler/scheduler_config.json",
          R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012})");
    write("tokenizer/vocab.json", vocab_json);
    write("tokenizer/merges.txt", "#version: 0.2\na t</w>\n");
    write("unet/diffusion_pytorch_model.safetensors", tensors(configs, Network::unet));
    write("vae/diffusion_pytorch_model.safetensors", tensors(configs, Network::autoencoder));
    write("text_encoder/model.safetensors", tensors(configs, Network::text_encoder));
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  void write(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    support::write_file(folder_.path() / name, bytes);
  }

 private:
  static std::string tensors(const Configs& configs, Network network) {
    return weights::encode_tensors(weights::random_tensors(configs, network, 3));
  }
  support::TempDir folder_;
};

scene::Image picture() {
  scene::Image image(16, 8, 3);
  Rng rng(5);
  for (float& value : image.data) value = rng.uniform();
  return image;
}

const RepaintOptions few_steps = {.prompt = "a hat", .guidance = 2, .sampling = {.steps = 3}};

TEST(StableDiffusion, RepaintsWithEverySampler) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd) << sd.error().message << " " << sd.error().where;
  EXPECT_EQ(sd->side_multiple(), 8);
  for (const auto& [sampler, name] : names<Sampler>) {
    RepaintOptions options = few_steps;
    options.sampling.sampler = sampler;
    const auto repainted = sd->repaint(picture(), options);
    ASSERT_TRUE(repainted) << name << repainted.error().message;
    EXPECT_EQ(repainted->width, 16);
    EXPECT_EQ(repainted->height, 8);
    for (const float value : repainted->data) ASSERT_TRUE(value >= 0 && value <= 1) << name;
    EXPECT_EQ(*repainted, sd->repaint(picture(), options).value()) << name << ": same seed, same bytes";
    options.seed = 1;
    EXPECT_NE(*repainted, sd->repaint(picture(), options).value()) << name;
  }
}

TEST(StableDiffusion, ThePromptMattersAndSoDoesWhatIsNotWanted) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  RepaintOptions options = few_steps;
  const scene::Image hat = sd->repaint(picture(), options).value();
  options.prompt = "a cat";
  EXPECT_NE(sd->repaint(picture(), options).value(), hat);
  options = few_steps;
  options.negative_prompt = "a cat";
  EXPECT_NE(sd->repaint(picture(), options).value(), hat);
  options.guidance = 1;
  const scene::Image alone = sd->repaint(picture(), options).value();
  options.negative_prompt = "";
  EXPECT_EQ(sd->repaint(picture(), options).value(), alone) << "without guidance nobody asks what is not wanted";
}

TEST(StableDiffusion, WithoutAStepThePictureStays) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  RepaintOptions options = few_steps;
  options.sampling.strength = 0.1;
  EXPECT_EQ(sd->repaint(picture(), options).value(), picture());
}

TEST(StableDiffusion, AnAdapterIsPutOnAndTakenOff) {
  const TinyFolder folder;
  auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto plain = *sd;
  weights::AdapterWeights weights;
  weights.unet["mid_block.attentions.0.transformer_blocks.0.attn1.to_q"] = {
      {{1, 8}, std::vector<float>(8, 1.0f)}, {{8, 1}, {1, -1, 2, -2, 3, -3, 4, -4}}, 1.0};
  ASSERT_TRUE(sd->adapt(weights));
  const scene::Image without = plain.repaint(picture(), few_steps).value();
  EXPECT_NE(sd->repaint(picture(), few_steps).value(), without);
  // What cannot be put on leaves the one that is there.
  const scene::Image with = sd->repaint(picture(), few_steps).value();
  weights::AdapterWeights other = weights;
  other.unet["nowhere"] = weights.unet.begin()->second;
  EXPECT_EQ(sd->adapt(other).error().where, "nowhere");
  other = weights;
  other.unet.begin()->second.up.values.pop_back();
  EXPECT_EQ(sd->adapt(other).error().where, weights.unet.begin()->first);
  EXPECT_EQ(sd->adapt(weights, std::nan("")).error().where, "factor");
  EXPECT_EQ(sd->repaint(picture(), few_steps).value(), with);
  ASSERT_TRUE(sd->adapt({}));
  EXPECT_EQ(sd->repaint(picture(), few_steps).value(), without);
}

TEST(StableDiffusion, WhatIsNotFiniteNeverBecomesAPicture) {
  const TinyFolder folder;
  const auto error = [&] {
    const auto sd = StableDiffusion::open(folder.path());
    const auto repainted = sd.value().repaint(picture(), few_steps);
    return repainted ? Error{ErrorCode::internal, "accepted", {}} : repainted.error();
  };
  const auto with_great = [&](Network network, const std::string& name, const std::string& file) {
    auto tensors = weights::random_tensors(weights::tiny_configs(), network, 3);
    for (float& value : tensors.at(name).values) value = 3e38f;
    folder.write(file, weights::encode_tensors(tensors));
  };
  with_great(Network::autoencoder, "decoder.conv_out.weight", "vae/diffusion_pytorch_model.safetensors");
  EXPECT_EQ(error().where, "autoencoder");
  EXPECT_EQ(error().code, ErrorCode::internal);
  with_great(Network::unet, "conv_out.weight", "unet/diffusion_pytorch_model.safetensors");
  EXPECT_EQ(error().where, "latents");
}

TEST(StableDiffusion, IsCancelledBetweenCalls) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  std::stop_source stop;
  stop.request_stop();
  const auto repainted = sd->repaint(picture(), few_steps, stop.get_token());
  ASSERT_FALSE(repainted);
  EXPECT_EQ(repainted.error().code, ErrorCode::cancelled);
}

TEST(StableDiffusion, WhatCannotBeRepaintedIsNamed) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto where = [&](const scene::Image& image, const RepaintOptions& options) {
    const auto repainted = sd->repaint(image, options);
    return repainted ? "accepted" : repainted.error().where;
  };
  EXPECT_EQ(where(scene::Image(16, 12, 3), few_steps), "picture");
  EXPECT_EQ(where(scene::Image(16, 8, 1), few_steps), "picture");
  EXPECT_EQ(where({}, few_steps), "picture");
  EXPECT_EQ(where(picture(), {.guidance = 0.5}), "guidance");
  EXPECT_EQ(where(picture(), {.sampling = {.steps = 0}}), "steps");
  EXPECT_EQ(where(picture(), {.guidance = 101}), "guidance");
  EXPECT_EQ(where(picture(), {.prompt = "\xff"}), "prompt");
  EXPECT_EQ(where(picture(), {.negative_prompt = "\xff"}), "negative_prompt");
  scene::Image poisoned = picture();
  poisoned.data[7] = std::nanf("");
  EXPECT_EQ(where(poisoned, few_steps), "picture[7]");
  const auto large = sd->repaint(scene::Image(1024, 1032, 3), few_steps);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::too_large);
}

TEST(StableDiffusion, ACheckpointWhoseStepsBeginBeyondTrainingIsNamed) {
  const TinyFolder folder;
  folder.write("scheduler/scheduler_config.json",
               R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012,"steps_offset":999})");
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto repainted = sd->repaint(picture(), few_steps);
  ASSERT_FALSE(repainted);
  EXPECT_EQ(repainted.error().where, "steps_offset");
}

TEST(StableDiffusion, ADamagedCheckpointIsNamed) {
  const TinyFolder folder;
  const auto where = [&] {
    const auto sd = StableDiffusion::open(folder.path());
    return sd ? "accepted" : sd.error().where;
  };
  auto tensors = weights::random_tensors(weights::tiny_configs(), Network::unet, 3);
  tensors.at("mid_block.resnets.0.conv1.bias").values[5] = std::numeric_limits<float>::infinity();
  folder.write("unet/diffusion_pytorch_model.safetensors", weights::encode_tensors(tensors));
  EXPECT_EQ(where(), "diffusion_pytorch_model.safetensors:mid_block.resnets.0.conv1.bias[5]");
  tensors.erase("mid_block.resnets.0.conv1.bias");
  folder.write("unet/diffusion_pytorch_model.safetensors", weights::encode_tensors(tensors));
  EXPECT_EQ(where(), "diffusion_pytorch_model.safetensors:mid_block.resnets.0.conv1.bias");
  folder.write("tokenizer/vocab.json", R"({"<|startoftext|>":0,"<|endoftext|>":520})");
  EXPECT_EQ(where(), "vocab.json:<|endoftext|>");
}

}  // namespace
}  // namespace engine::diffusion
