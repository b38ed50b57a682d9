// The three networks against the reference, output by output and layer by layer.
#include <ATen/core/Tensor.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/full.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/unet.h"
#include "tests/engine/diffusion/golden.h"

namespace engine::diffusion {
namespace {

/// Keeps what layers give.
class Shown {
 public:
  explicit Shown(Model& model) {
    model.probe = [this](const std::string& layer, const Tensor& out) { outputs_[layer] = out; };
  }
  [[nodiscard]] Tensor of(const std::string& layer) const {
    const auto found = outputs_.find(layer);
    EXPECT_NE(found, outputs_.end()) << layer;
    return found == outputs_.end() ? Tensor() : found->second;
  }

 private:
  std::map<std::string, Tensor> outputs_;
};

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

class NetworksGolden : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_SHARED(support::golden_dir() / "tiny_sd");
    models.emplace(tiny_models());
  }
  static support::TensorFile golden(const char* name) { return support::TensorFile(support::golden_dir() / name); }
  static Tensor at_time(std::int64_t t, std::int64_t batch) { return at::full({batch}, t, at::kLong); }

  std::optional<TinyModels> models;
};

TEST_F(NetworksGolden, TextEncoder) {
  const auto file = golden("text_encoder.safetensors");
  const Shown shown(models->text_encoder);
  const Tensor pieces = as_tensor(file.at("input_ids"));
  const auto& config = models->configs().text_encoder;
  EXPECT_TRUE(near(encode_text(models->text_encoder, config, pieces), as_tensor(file.at("last_hidden_state")), 1e-4));
  (void)encode_text(models->text_encoder, config, pieces.narrow(0, 0, 6));
  EXPECT_TRUE(near(shown.of("text_model.embeddings"), as_tensor(file.at("embeddings")), 1e-4));
  EXPECT_TRUE(near(shown.of("text_model.encoder.layers.0"), as_tensor(file.at("layer_0_out")), 1e-4));
  EXPECT_TRUE(near(shown.of("text_model.encoder.layers.1"), as_tensor(file.at("layer_1_out_before_final_norm")), 1e-4));
}

TEST_F(NetworksGolden, Autoencoder) {
  const auto file = golden("vae.safetensors");
  const auto& config = models->configs().autoencoder;
  for (const std::string size : {"64x96", "128x128"}) {
    SCOPED_TRACE(size);
    const Tensor moments = encode_moments(models->autoencoder, config, as_tensor(file.at(size + ".image")));
    EXPECT_TRUE(near(moments.narrow(1, 0, 4), as_tensor(file.at(size + ".mean")), 1e-4));
    EXPECT_TRUE(near(moments.narrow(1, 4, 4), as_tensor(file.at(size + ".logvar")), 1e-4));
    EXPECT_TRUE(near((moments.narrow(1, 4, 4) * 0.5).exp(), as_tensor(file.at(size + ".std")), 1e-4));
    const Tensor latents = sample_latents(config, moments, as_tensor(file.at(size + ".eps")));
    const Tensor expected = as_tensor(file.at(size + ".latent_scaled"));
    EXPECT_TRUE(near(latents, expected, 1e-4));
    EXPECT_TRUE(
        near(decode_latents(models->autoencoder, config, expected), as_tensor(file.at(size + ".decoded")), 1e-4));
  }
}

TEST_F(NetworksGolden, AutoencoderLayerByLayer) {
  const auto file = golden("vae.safetensors");
  const Shown shown(models->autoencoder);
  const auto& config = models->configs().autoencoder;
  (void)encode_moments(models->autoencoder, config, as_tensor(file.at("64x96.image")));
  (void)decode_latents(models->autoencoder, config, as_tensor(file.at("64x96.latent_scaled")));
  std::size_t compared = 0;
  const std::string prefix = "64x96.act.";
  for (const auto& [name, reference] : file.all()) {
    if (!name.starts_with(prefix)) continue;
    std::string layer = replaced(replaced(name.substr(prefix.size()), "enc.", "encoder."), "dec.", "decoder.");
    if (layer == "decoder.post_quant_conv") layer = "post_quant_conv";
    const Tensor expected = as_tensor(reference);
    EXPECT_TRUE(near(shown.of(layer), expected, 1e-4 * largest(expected))) << name;
    ++compared;
  }
  EXPECT_EQ(compared, 14u);
}

TEST_F(NetworksGolden, AutoencoderUnderItsNewNames) {
  const auto path = support::golden_dir() / "tiny_sd_vae_newnames/diffusion_pytorch_model.safetensors";
  // A folder in which only the autoencoder differs.
  const support::TempDir folder;
  std::filesystem::copy(support::golden_dir() / "tiny_sd", folder.path() / "sd",
                        std::filesystem::copy_options::recursive);
  const auto vae = folder.path() / "sd/vae/diffusion_pytorch_model.safetensors";
  std::filesystem::permissions(folder.path() / "sd/vae", std::filesystem::perms::owner_all);
  std::filesystem::remove(vae);
  std::filesystem::copy(path, vae);
  const auto checkpoint = weights::Checkpoint::open(folder.path() / "sd");
  ASSERT_TRUE(checkpoint) << checkpoint.error().message;
  const auto renamed = Parameters::load(*checkpoint, weights::Network::autoencoder);
  ASSERT_TRUE(renamed) << renamed.error().where;
  for (const weights::TensorSpec& spec : weights::tensors_of(models->configs().autoencoder))
    EXPECT_TRUE(near(renamed->at(spec.name), models->autoencoder.parameters.at(spec.name), 0)) << spec.name;
  for (const char* part : {"unet", "text_encoder", "tokenizer", "scheduler", ""})  // so that the folder can be removed
    std::filesystem::permissions(folder.path() / "sd" / part, std::filesystem::perms::owner_all);
}

TEST_F(NetworksGolden, UNet) {
  const auto file = golden("unet.safetensors");
  const Tensor context = as_tensor(file.at("encoder_hidden_states"));
  const auto& config = models->configs().unet;
  for (const std::string size : {"16x16", "8x24"})
    for (const int t : {0, 1, 21, 261, 500, 741, 999}) {
      const std::string name = size + ".t" + std::to_string(t) + ".out";
      const Tensor out =
          predict_noise(models->unet, config, as_tensor(file.at(size + ".sample")), at_time(t, 2), context);
      EXPECT_TRUE(near(out, as_tensor(file.at(name)), 2e-5)) << name;
    }
  const Tensor two_times = at::cat({at_time(37, 1), at_time(812, 1)});
  EXPECT_TRUE(near(predict_noise(models->unet, config, as_tensor(file.at("16x16.sample")), two_times, context),
                   as_tensor(file.at("16x16.t_batch_37_812.out")), 2e-5));
}

/// A layer of the UNet by the reference's short name for it.
std::string layer_named(const std::string& name) {
  std::string layer = replaced(replaced(name, "tb0", "transformer_blocks.0"), "t261.out", "conv_out");
  const std::size_t left = layer.find(".res");
  if (left == std::string::npos || layer.find("resnets") != std::string::npos) return layer;
  const int which = std::stoi(layer.substr(left + 4));
  const std::string block = layer.substr(0, left);
  if (which == 2) return block + ".downsamplers.0";
  return block + (block == "down_blocks.3" ? ".resnets." : ".attentions.") + std::to_string(which);
}

TEST_F(NetworksGolden, UNetLayerByLayer) {
  const auto file = golden("unet.safetensors");
  const Shown shown(models->unet);
  (void)predict_noise(models->unet, models->configs().unet, as_tensor(file.at("act.sample")), at_time(261, 1),
                      as_tensor(file.at("act.encoder_hidden_states")));
  std::size_t compared = 0;
  const std::string prefix = "act.";
  for (const auto& [name, reference] : file.all()) {
    if (!name.starts_with(prefix) || name == "act.sample" || name == "act.encoder_hidden_states") continue;
    const Tensor expected = as_tensor(reference);
    EXPECT_TRUE(near(shown.of(layer_named(name.substr(prefix.size()))), expected, 1e-4 * largest(expected))) << name;
    ++compared;
  }
  EXPECT_EQ(compared, 42u);
}

}  // namespace
}  // namespace engine::diffusion
