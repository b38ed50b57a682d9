// Whole ways from picture to picture against the reference: prompt, encoding, every call, decoding.
#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/cat.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/img2img.h"
#include "engine/diffusion/stable_diffusion.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/tokenizer.h"
#include "tests/engine/diffusion/golden.h"

namespace engine::diffusion {
namespace {

SamplerOptions options_of(const nlohmann::json& run) {
  const auto name = run["scheduler"].get<std::string>();
  SamplerOptions options{.sampler = Sampler::dpmpp2m, .steps = run["N"], .strength = run["strength"]};
  if (name == "ddim") options.sampler = Sampler::ddim;
  if (name == "pndm") options.sampler = Sampler::pndm;
  if (name == "dpmpp2m_linspace") options.spacing = Spacing::linspace;
  return options;
}

class Img2ImgGolden : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_SHARED(support::golden_dir() / "img2img.safetensors");
    models.emplace(tiny_models());
    file.emplace(support::golden_dir() / "img2img.safetensors");
    json = nlohmann::json::parse(support::read_file(support::golden_dir() / "img2img.json"));
    tokenizer.emplace(weights::read_vocabulary(models->checkpoint.tokenizer_folder(), false,
                                               models->configs().text_encoder.vocabulary)
                          .value());
  }

  /// [2, 77, width]: negative prompt, prompt.
  Tensor contexts(const std::string& negative) const {
    std::vector<Tensor> both;
    for (const std::string& prompt : {negative, json["prompt"].get<std::string>()}) {
      const auto pieces = tokenizer->encode(prompt).value();
      Tensor numbers = at::empty({1, 77}, at::kLong);
      std::ranges::copy(pieces, numbers.data_ptr<std::int64_t>());
      both.push_back(encode_text(models->text_encoder, models->configs().text_encoder, numbers));
    }
    return at::cat(both);
  }

  /// The noised latents that a run begins with.
  Tensor first_latents(const Scheduler& scheduler) const {
    const auto& config = models->configs().autoencoder;
    const Tensor picture = as_tensor(file->at("image01")) * 2 - 1;
    Tensor latents = sample_latents(config, encode_moments(models->autoencoder, config, picture),
                                    as_tensor(file->at("vae_posterior_eps")));
    latents = latents.contiguous();
    scheduler.add_noise({latents.data_ptr<float>(), std::size_t(latents.numel())}, file->at("noise").floats(),
                        scheduler.timesteps().front());
    return latents;
  }

  at::NoGradGuard no_gradients;
  std::optional<TinyModels> models;
  std::optional<support::TensorFile> file;
  std::optional<Tokenizer> tokenizer;
  nlohmann::json json;
};

TEST_F(Img2ImgGolden, EveryCallIsTheReferences) {
  for (const auto& [name, run] : json["runs"].items()) {
    SCOPED_TRACE(name);
    const Tensor latents = as_tensor(file->at(name + ".latents_in")),
                 expected = as_tensor(file->at(name + ".noise_pred_guided"));
    const Tensor both = contexts(run["negative_prompt"]);
    const auto timesteps = run["timesteps"].get<std::vector<int>>();
    EXPECT_EQ(make_scheduler(models->configs().noise, options_of(run))->timesteps(), timesteps);
    ASSERT_EQ(std::int64_t(timesteps.size()), latents.size(0));
    for (std::size_t i = 0; i < timesteps.size(); ++i) {
      const Tensor noise = guided_noise(models->unet, models->configs().unet, latents.narrow(0, std::int64_t(i), 1),
                                        timesteps[i], both, run["guidance"]);
      EXPECT_TRUE(near(noise, expected.narrow(0, std::int64_t(i), 1), 2e-4)) << "call " << i;
    }
  }
}

TEST_F(Img2ImgGolden, EndToEndIsTheReferences) {
  EXPECT_EQ(json["runs"].size(), 7u);
  for (const auto& [name, run] : json["runs"].items()) {
    SCOPED_TRACE(name);
    const auto scheduler = make_scheduler(models->configs().noise, options_of(run));
    Tensor latents = first_latents(*scheduler);
    EXPECT_TRUE(near(latents, as_tensor(file->at(name + ".latents_in")).narrow(0, 0, 1), 1e-4));
    const auto done = denoise(models->unet, models->configs().unet, *scheduler, latents,
                              contexts(run["negative_prompt"]), run["guidance"], {}, {});
    ASSERT_TRUE(done);
    EXPECT_TRUE(near(latents, as_tensor(file->at(name + ".latents_final")), 3e-4));
    const Tensor picture = decode_latents(models->autoencoder, models->configs().autoencoder, latents);
    EXPECT_TRUE(near((picture * 0.5 + 0.5).clamp(0, 1), as_tensor(file->at(name + ".image_out")), 1e-4));
  }
}

TEST_F(Img2ImgGolden, AFolderIsOpenedAndRepaintsByItsSeed) {
  const auto sd = StableDiffusion::open(support::golden_dir() / "tiny_sd");
  ASSERT_TRUE(sd) << sd.error().message;
  EXPECT_EQ(sd->side_multiple(), 64);
  const support::Tensor& image = file->at("image01");
  scene::Image picture(128, 128, 3);
  picture.data = image.floats();
  RepaintOptions options{.prompt = json["prompt"], .sampling = {.steps = 4, .strength = 0.5}};
  const auto first = sd->repaint(picture, options), again = sd->repaint(picture, options);
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_EQ(*first, *again);
  options.seed = 1;
  EXPECT_NE(sd->repaint(picture, options).value(), *first);
}

}  // namespace
}  // namespace engine::diffusion
