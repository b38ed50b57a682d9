#include <gtest/gtest.h>

#include "engine/weights/networks.h"
#include "tests/engine/weights/samples.h"

namespace engine::weights {
namespace {

const std::string unet = R"({"_class_name":"UNet2DConditionModel","block_out_channels":[4,8],"attention_head_dim":[1,2],
  "cross_attention_dim":6,"norm_num_groups":2,"down_block_types":["CrossAttnDownBlock2D","DownBlock2D"],
  "up_block_types":["UpBlock2D","CrossAttnUpBlock2D"],"layers_per_block":1,"use_linear_projection":true,
  "class_embed_type":null,"upcast_attention":true})";

std::string with(std::string json, const std::string& from, const std::string& to) {
  const std::size_t at = json.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return json.replace(at, from.size(), to);
}

Error refused(const std::string& json) {
  const auto config = parse_unet_config(bytes_of(json), "unet/config.json");
  return config ? Error{ErrorCode::internal, "accepted", ""} : config.error();
}

TEST(NetworkConfigs, AreReadFieldByField) {
  const auto config = parse_unet_config(bytes_of(unet), "unet/config.json");
  ASSERT_TRUE(config) << config.error().message << " " << config.error().where;
  EXPECT_EQ(config->channels, (std::vector<int>{4, 8}));
  EXPECT_EQ(config->heads, (std::vector<int>{1, 2}));
  EXPECT_EQ(config->down_attends, (std::vector<bool>{true, false}));
  EXPECT_EQ(config->up_attends, (std::vector<bool>{false, true}));
  EXPECT_EQ(config->context_width, 6);
  EXPECT_TRUE(config->linear_projection);
}

TEST(NetworkConfigs, OneNumberOfHeadsIsForAllLevels) {
  const auto config = parse_unet_config(bytes_of(with(unet, "[1,2]", "2")), "unet/config.json");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->heads, (std::vector<int>{2, 2}));
}

TEST(NetworkConfigs, AnotherKindOfNetworkIsNamedByItsField) {
  const Error xl = refused(with(unet, "\"class_embed_type\":null", "\"addition_embed_type\":\"text_time\""));
  EXPECT_EQ(xl.code, ErrorCode::unsupported);
  EXPECT_EQ(xl.where, "unet/config.json:addition_embed_type");
  EXPECT_EQ(refused(with(unet, "\"class_embed_type\":null", "\"in_channels\":9")).where,
            "unet/config.json:in_channels");
  EXPECT_EQ(refused(with(unet, "\"DownBlock2D\"", "\"KDownBlock2D\"")).where, "unet/config.json:down_block_types[1]");
  const std::string velocities = R"({"prediction_type":"v_prediction"})";
  const auto noise = parse_noise_config(bytes_of(velocities), "scheduler/scheduler_config.json");
  ASSERT_FALSE(noise);
  EXPECT_EQ(noise.error().code, ErrorCode::unsupported);
}

TEST(NetworkConfigs, SizesThatCannotBeAreNamed) {
  EXPECT_EQ(refused(with(unet, "[4,8]", "[4,9]")).where, "unet/config.json:block_out_channels");
  EXPECT_EQ(refused(with(unet, "[4,8]", "[4,8000000]")).where, "unet/config.json:block_out_channels[1]");
  EXPECT_EQ(refused(with(unet, "[4,8]", "[]")).where, "unet/config.json:block_out_channels");
  EXPECT_EQ(refused(with(unet, "[1,2]", "[1,2,4]")).where, "unet/config.json:attention_head_dim");
  EXPECT_EQ(refused(with(unet, "\"layers_per_block\":1", "\"layers_per_block\":1.5")).where,
            "unet/config.json:layers_per_block");
  EXPECT_EQ(refused("[]").code, ErrorCode::corrupt_data);
  EXPECT_EQ(refused("{").code, ErrorCode::corrupt_data);
}

TEST(NetworkConfigs, OfTheSecondGenerationAreItsOwn) {
  std::size_t parameters = 0;
  for (const TensorSpec& spec : tensors_of(stable_diffusion_2_base().unet)) {
    std::size_t count = 1;
    for (const std::int64_t size : spec.shape) count *= std::size_t(size);
    parameters += count;
  }
  EXPECT_EQ(parameters, 865910724u) << "what stabilityai/stable-diffusion-2-base is said to have";
}

}  // namespace
}  // namespace engine::weights
