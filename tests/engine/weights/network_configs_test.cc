#include <gtest/gtest.h>

#include <cctype>
#include <set>
#include <string>
#include <vector>

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
  EXPECT_EQ(refused(with(unet, "\"DownBlock2D\"", "7")).code, ErrorCode::corrupt_data);
  EXPECT_EQ(refused(with(unet, "\"class_embed_type\":null", "\"only_cross_attention\":[true,false]")).code,
            ErrorCode::unsupported);
}

TEST(NetworkConfigs, TheUNetOfSdxlIsSaidToBeAnotherKind) {
  const Error xl = refused(R"({"_class_name":"UNet2DConditionModel","act_fn":"silu","addition_embed_type":"text_time",
    "addition_embed_type_num_heads":64,"addition_time_embed_dim":256,"attention_head_dim":[5,10,20],
    "block_out_channels":[320,640,1280],"center_input_sample":false,"class_embed_type":null,"conv_in_kernel":3,
    "conv_out_kernel":3,"cross_attention_dim":2048,"cross_attention_norm":null,
    "down_block_types":["DownBlock2D","CrossAttnDownBlock2D","CrossAttnDownBlock2D"],"downsample_padding":1,
    "flip_sin_to_cos":true,"freq_shift":0,"in_channels":4,"layers_per_block":2,"mid_block_scale_factor":1,
    "mid_block_type":"UNetMidBlock2DCrossAttn","norm_eps":1e-05,"norm_num_groups":32,"num_attention_heads":null,
    "out_channels":4,"projection_class_embeddings_input_dim":2816,"resnet_out_scale_factor":1.0,
    "transformer_layers_per_block":[1,2,10],"up_block_types":["CrossAttnUpBlock2D","CrossAttnUpBlock2D","UpBlock2D"],
    "use_linear_projection":true})");
  EXPECT_EQ(xl.code, ErrorCode::unsupported);
  EXPECT_EQ(xl.where, "unet/config.json:addition_embed_type");
  const Error layers = refused(with(unet, "\"class_embed_type\":null", "\"transformer_layers_per_block\":[1,2]"));
  EXPECT_EQ(layers.code, ErrorCode::unsupported);
  EXPECT_EQ(layers.where, "unet/config.json:transformer_layers_per_block");
}

const std::string scheduler =
    R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012,"prediction_type":"epsilon"})";

Result<NoiseConfig> noise_of(const std::string& json) { return parse_noise_config(bytes_of(json), "scheduler.json"); }

TEST(NetworkConfigs, ASchedulerIsReadFieldByField) {
  const auto config = noise_of(scheduler);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->training_steps, 1000);
  EXPECT_EQ(config->beta_end, 0.012);
  EXPECT_EQ(config->steps_offset, 0);
  EXPECT_FALSE(config->ends_without_noise);
  const std::string& last = "\"epsilon\"";
  EXPECT_TRUE(noise_of(with(scheduler, last, "\"epsilon\",\"set_alpha_to_one\":true"))->ends_without_noise);
  EXPECT_TRUE(noise_of(with(scheduler, last, "\"epsilon\",\"_class_name\":\"DDIMScheduler\""))->ends_without_noise)
      << "its default";
  EXPECT_FALSE(noise_of(with(scheduler, last, "\"epsilon\",\"_class_name\":\"PNDMScheduler\""))->ends_without_noise);
}

TEST(NetworkConfigs, NoiseThatNobodyCanComputeWithIsRefused) {
  const auto refused_at = [](const std::string& from, const std::string& to) {
    const auto config = noise_of(with(scheduler, from, to));
    return config ? "accepted" : config.error().where;
  };
  EXPECT_EQ(noise_of(with(scheduler, "epsilon", "v_prediction")).error().code, ErrorCode::unsupported);
  EXPECT_EQ(noise_of(with(scheduler, "scaled_linear", "linear")).error().code, ErrorCode::unsupported);
  EXPECT_EQ(refused_at("\"beta_schedule\":\"scaled_linear\",", ""), "scheduler.json:beta_schedule");
  EXPECT_EQ(refused_at("\"scaled_linear\"", "null"), "scheduler.json:beta_schedule");
  EXPECT_EQ(refused_at("\"scaled_linear\"", "7"), "scheduler.json:beta_schedule");
  EXPECT_EQ(refused_at("\"beta_start\":0.00085,", ""), "scheduler.json:beta_start");
  EXPECT_EQ(refused_at("\"beta_end\":0.012,", ""), "scheduler.json:beta_end");
  EXPECT_EQ(refused_at("0.00085", "1e-300"), "scheduler.json:") << "its first level has no noise at all";
  EXPECT_EQ(refused_at("0.012", "0.999999"), "scheduler.json:") << "its last ones have no picture";
  EXPECT_EQ(refused_at("0.012", "0.0001"), "scheduler.json:") << "less at the end than at the beginning";
  EXPECT_EQ(refused_at("0.012", "1.5"), "scheduler.json:");
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

/// The name of the field that the value at `at` is in.
std::string key_at(const std::string& json, std::size_t at) {
  const std::size_t end = json.rfind("\":", at), begin = json.rfind('"', end - 1) + 1;
  return json.substr(begin, end - begin);
}

/// Every number of a file, in place of it what no network has.
TEST(NetworkConfigs, NoNumberIsBelieved) {
  const std::vector<std::string> numbers{
      "0",    "-1",   "1.5",   "1e400", "-1e400", "2147483648", "1e18", "9223372036854775808",
      "null", "true", "\"4\"", "{}",    "[[]]"};
  int refused_ones = 0;
  std::set<std::string> accepted;
  const auto look = [&](auto parse, const std::string& file, const std::string& usual) {
    ASSERT_TRUE(parse(bytes_of(usual), file)) << usual;
    for (std::size_t at = 0; at < usual.size(); ++at) {
      if (!std::isdigit(static_cast<unsigned char>(usual[at])) ||
          std::string(":[,").find(usual[at - 1]) == std::string::npos)
        continue;
      const std::size_t end = usual.find_first_not_of("0123456789.e-", at);
      for (const std::string& number : numbers) {
        const std::string json = usual.substr(0, at) + number + usual.substr(end);
        const auto config = parse(bytes_of(json), file);
        if (config) {
          accepted.insert(file + ":" + key_at(usual, at) + " " + number);
          continue;
        }
        EXPECT_TRUE(config.error().where.starts_with(file)) << json << ": " << config.error().where;
        ++refused_ones;
      }
    }
  };
  look(parse_unet_config, "unet", unet.substr(0, unet.size() - 1) + R"(,"norm_eps":1e-5,"sample_size":64})");
  look(parse_autoencoder_config, "vae",
       R"({"block_out_channels":[4,8],"norm_num_groups":2,"layers_per_block":2,"scaling_factor":0.18215,
           "down_block_types":["DownEncoderBlock2D","DownEncoderBlock2D"],
           "up_block_types":["UpDecoderBlock2D","UpDecoderBlock2D"]})");
  look(parse_text_encoder_config, "text",
       R"({"hidden_size":6,"intermediate_size":10,"num_hidden_layers":2,"num_attention_heads":2,"vocab_size":520,
           "max_position_embeddings":77,"layer_norm_eps":1e-5})");
  look(
      parse_noise_config, "noise",
      R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012,"num_train_timesteps":1000,"steps_offset":1})");
  EXPECT_GT(refused_ones, 250);
  std::set<std::string> allowed{"noise:steps_offset 0", "text:layer_norm_eps 1.5", "unet:norm_eps 1.5",
                                "vae:scaling_factor 1.5"};
  for (const char* as_usual :  // what is absent is as the libraries have it
       {"noise:num_train_timesteps", "noise:steps_offset", "text:hidden_size", "text:intermediate_size",
        "text:layer_norm_eps", "text:max_position_embeddings", "text:num_hidden_layers", "text:vocab_size",
        "unet:cross_attention_dim", "unet:layers_per_block", "unet:norm_eps", "unet:sample_size",
        "vae:layers_per_block", "vae:scaling_factor"})
    allowed.insert(std::string(as_usual) + " null");
  EXPECT_EQ(accepted, allowed);
}

TEST(NetworkConfigs, PicturesThatNobodyHasMemoryForAreRefused) {
  Configs configs;
  EXPECT_TRUE(validate(configs));
  configs.unet.sample_side = 128;
  EXPECT_TRUE(validate(configs)) << "1,024 pixels";
  configs.unet.sample_side = 131;
  EXPECT_EQ(picture_side(configs), 1024) << "1,048 are shown as the nearest multiple of 64";
  EXPECT_TRUE(validate(configs));
  configs.unet.sample_side = 132;
  EXPECT_EQ(picture_side(configs), 1088);
  EXPECT_EQ(validate(configs).error().where, "unet/config.json:sample_size");
  configs = {};
  configs.unet.context_width = 767;
  EXPECT_EQ(validate(configs).error().where, "unet/config.json:cross_attention_dim");
  configs = {};
  configs.unet.sample_side = 1;
  configs.unet.channels.assign(8, 320);
  EXPECT_EQ(side_multiple(configs), 1024);
  EXPECT_EQ(picture_side(configs), 1024) << "no smaller picture has so many levels";
  EXPECT_TRUE(validate(configs));
  configs.autoencoder.channels.assign(5, 128);
  EXPECT_EQ(validate(configs).error().where, "unet/config.json:block_out_channels") << "multiples of 2,048 pixels";
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
