// The reference's files: a checkpoint in the real layout, the full size's keys, and one adapter in five layouts.
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "engine/weights/adapter_file.h"
#include "engine/weights/checkpoint.h"
#include "engine/weights/original_names.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace engine::weights {
namespace {

namespace fs = std::filesystem;

std::map<std::string, Shape> listed(const nlohmann::json& shapes) { return shapes.get<std::map<std::string, Shape>>(); }

std::map<std::string, Shape> as_map(const std::vector<TensorSpec>& specs, bool old_names = false) {
  std::map<std::string, Shape> all;
  for (const TensorSpec& spec : specs)
    EXPECT_TRUE(all.emplace(old_names ? old_autoencoder_name(spec.name) : spec.name, spec.shape).second) << spec.name;
  return all;
}

TEST(WeightsGolden, StableDiffusion15HasExactlyTheFullSizesKeysAndShapes) {
  const fs::path path = support::golden_dir() / "sd15_full_size_keys_and_shapes.json";
  REQUIRE_SHARED(path);
  const auto expected = nlohmann::json::parse(support::read_file(path));
  const Configs configs = stable_diffusion_1();
  EXPECT_EQ(as_map(tensors_of(configs.unet)), listed(expected["unet"]));
  EXPECT_EQ(as_map(tensors_of(configs.autoencoder), true), listed(expected["vae_names_in_v1-5_file"]));
  auto text_encoder = as_map(tensors_of(configs.text_encoder));
  text_encoder.emplace("text_model.embeddings.position_ids", Shape{1, 77});  // numbers from 0 to 76, of no use
  EXPECT_EQ(text_encoder, listed(expected["text_encoder"]));
}

TEST(WeightsGolden, TheTinyFolderIsWhole) {
  REQUIRE_SHARED(support::golden_dir() / "tiny_sd");
  const auto checkpoint = Checkpoint::open(support::golden_dir() / "tiny_sd");
  ASSERT_TRUE(checkpoint) << checkpoint.error().message << " " << checkpoint.error().where;
  const auto checked = checkpoint->check();
  EXPECT_TRUE(checked) << checked.error().where << ": " << checked.error().message;
  EXPECT_EQ(checkpoint->configs().unet.channels, (std::vector<int>{16, 32, 48, 48}));
  EXPECT_EQ(checkpoint->configs().text_encoder.activation, Activation::quick_gelu);
  EXPECT_FALSE(checkpoint->is_open_clip());
  // Every number is as another reader of the same format has it.
  const support::TensorFile reference(support::golden_dir() / "tiny_sd/unet/diffusion_pytorch_model.safetensors");
  for (const TensorSpec& spec : tensors_of(checkpoint->configs().unet)) {
    const auto found = checkpoint->find(Network::unet, spec);
    ASSERT_TRUE(found);
    std::vector<float> values(found->tensor.elements());
    ASSERT_TRUE(read_floats(found->tensor, found->where, values));
    EXPECT_EQ(values, reference.at(spec.name).floats()) << spec.name;
  }
}

/// Layers with the product scale B A, which all layouts agree on but for the scale.
void expect_scaled(const AdapterWeights& weights, const AdapterWeights& first, double scale) {
  ASSERT_EQ(weights.unet.size(), 128u);
  for (const auto& [layer, pair] : weights.unet) {
    const LowRank& expected = first.unet.at(layer);
    EXPECT_EQ(pair.down.values, expected.down.values) << layer;
    EXPECT_EQ(pair.up.values, expected.up.values) << layer;
    EXPECT_EQ(pair.scale, scale) << layer;
  }
}

TEST(WeightsGolden, OneAdapterIsTheSameInFiveLayouts) {
  const fs::path folder = support::golden_dir() / "lora";
  REQUIRE_SHARED(folder);
  const auto checkpoint = Checkpoint::open(support::golden_dir() / "tiny_sd");
  ASSERT_TRUE(checkpoint);
  const auto first = read_adapter(folder / "diffusers_current.safetensors", checkpoint->configs());
  ASSERT_TRUE(first) << first.error().where << first.error().message;
  const std::map<std::string, double> scales = {{"diffusers_current", 1},
                                                {"diffusers_peft_lora_AB", 1},
                                                {"diffusers_legacy_processor", 1},
                                                {"peft_adapter_model", 2},
                                                {"kohya_alpha8", 2}};
  for (const auto& [layout, scale] : scales) {
    SCOPED_TRACE(layout);
    const auto weights = read_adapter(folder / (layout + ".safetensors"), checkpoint->configs());
    ASSERT_TRUE(weights) << weights.error().where << weights.error().message;
    expect_scaled(*weights, *first, scale);
  }
}

TEST(WeightsGolden, AnAdapterIsWrittenUnderTheNamesOfToday) {
  const fs::path path = support::golden_dir() / "lora/diffusers_current.safetensors";
  REQUIRE_SHARED(path);
  const auto checkpoint = Checkpoint::open(support::golden_dir() / "tiny_sd");
  const auto weights = read_adapter(path, checkpoint->configs());
  ASSERT_TRUE(weights);
  const std::string text = encode_adapter(*weights);
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  const auto written = TensorFile::parse({bytes, bytes + text.size()}, "lora.safetensors");
  ASSERT_TRUE(written) << written.error().message;
  const support::TensorFile reference(path);
  ASSERT_EQ(written->tensors().size(), reference.all().size());
  for (const auto& [name, tensor] : reference.all()) {
    ASSERT_NE(written->find(name), nullptr) << name;
    std::vector<float> values(written->find(name)->elements());
    ASSERT_TRUE(read_floats(*written->find(name), name, values));
    EXPECT_EQ(values, tensor.floats()) << name;
  }
}

TEST(WeightsGolden, ATextEncodersAdapterIsReadToo) {
  const fs::path path = support::golden_dir() / "lora/text_encoder_diffusers_current.safetensors";
  REQUIRE_SHARED(path);
  const auto checkpoint = Checkpoint::open(support::golden_dir() / "tiny_sd");
  const auto weights = read_adapter(path, checkpoint->configs());
  ASSERT_TRUE(weights) << weights.error().where << weights.error().message;
  EXPECT_EQ(weights->text_encoder.size(), 4u);
  EXPECT_TRUE(weights->unet.empty());
}

}  // namespace
}  // namespace engine::weights
