// Configurations of networks out of JSON.
#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/io/json_fields.h"
#include "engine/weights/networks.h"

namespace engine::weights {
namespace {

using io::JsonFields;

constexpr int max_width = 1 << 14;  // channels; 2.x has 1,280. What a file asks for is multiplied and then allocated.
constexpr std::size_t max_levels = 8;

int whole(const JsonFields& value, int low, int high) {
  const double number = value.number();
  if (number >= low && number <= high && number == std::floor(number)) return int(number);
  value.fail_here("expected a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  return low;
}

int whole(const JsonFields& fields, const char* key, int low, int high, int otherwise) {
  return fields.has_value(key) ? whole(fields.at(key), low, high) : otherwise;
}

/// What is divided by it, or it is added to, stays a float.
double positive(const JsonFields& fields, const char* key, double otherwise) {
  constexpr double least = 1e-12, most = 1e6;
  if (!fields.has_value(key)) return otherwise;
  const double number = fields.at(key).number();
  if (!(number >= least && number <= most)) fields.at(key).fail_here("expected a number from 1e-12 to 1e6");
  return number;
}

/// One number for all levels, or one for each.
std::vector<int> per_level(const JsonFields& value, std::size_t levels, int low, int high) {
  if (!value.is_array()) return std::vector<int>(levels, whole(value, low, high));
  std::vector<int> all;
  if (value.size() != levels) value.fail_here("expected one number for each of " + std::to_string(levels) + " levels");
  for (std::size_t i = 0; i < std::min(value.size(), levels); ++i) all.push_back(whole(value.at(i), low, high));
  all.resize(levels, low);
  return all;
}

std::vector<int> channels_of(const JsonFields& fields) {
  const JsonFields list = fields.at("block_out_channels");
  std::vector<int> channels;
  const std::size_t levels = list.size();
  if (levels < 1 || levels > max_levels) list.fail_here("expected 1 to 8 levels");
  for (std::size_t i = 0; i < std::min(levels, max_levels); ++i) channels.push_back(whole(list.at(i), 1, max_width));
  if (channels.empty()) channels.push_back(1);
  return channels;
}

/// Collects the first thing that makes a network one of another kind, if no error was met before it. Networks of other
/// kinds may have lists where ours have numbers (SDXL's transformer_layers_per_block), so a value of another type is
/// one of another kind, too.
class Kind {
 public:
  Kind(const JsonFields& fields, const std::optional<Error>& error) : fields_(fields), error_(error) {}

  /// A field that must be absent, null, or this.
  void must_be(const char* key, const char* value) {
    if (fields_.has_value(key)) check(fields_.at(key), value);
  }
  void must_be(const char* key, bool value) {
    if (!fields_.has_value(key)) return;
    const JsonFields field = fields_.at(key);
    if (!field.is_boolean() || field.boolean() != value) refuse(field, value ? "true" : "false");
  }
  void must_be(const char* key, int value) {
    if (!fields_.has_value(key)) return;
    const JsonFields field = fields_.at(key);
    if (!field.is_number() || field.number() != value) refuse(field, std::to_string(value));
  }
  void must_be_absent(const char* key) {
    if (fields_.has_value(key)) refuse(fields_.at(key), "nothing");
  }
  /// Names of blocks, each of which is one of two; which of them are the first.
  std::vector<bool> one_of(const char* key, std::size_t levels, const std::string& first, const std::string& second) {
    const JsonFields list = fields_.at(key);
    if (list.size() != levels) list.fail_here("expected a block for each of " + std::to_string(levels) + " levels");
    std::vector<bool> found(levels, false);
    for (std::size_t i = 0; i < std::min(list.size(), levels); ++i) {
      found[i] = list.at(i).string() == first;
      if (!found[i]) check(list.at(i), second);
    }
    return found;
  }
  void check(const JsonFields& value, const std::string& expected) {
    if (!value.is_string() || value.string() != expected) refuse(value, expected);
  }

  [[nodiscard]] const std::optional<Error>& other() const { return other_; }

 private:
  void refuse(const JsonFields& value, const std::string& expected) {
    if (other_ || error_) return;
    other_ = Error{ErrorCode::unsupported,
                   "a network of another kind than Stable Diffusion 1.x and 2.x-base, which have " + expected + " here",
                   value.where()};
  }
  const JsonFields& fields_;
  const std::optional<Error>& error_;
  std::optional<Error> other_;
};

void check_divisible(const JsonFields& fields, const char* key, const std::vector<int>& channels,
                     const std::vector<int>& parts) {
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels[i] % parts[i] != 0)
      fields.at(key).fail_here(std::to_string(channels[i]) + " channels do not part into " + std::to_string(parts[i]));
}

/// Reads a document by `read(fields, kind)`. An error that was met is the result; what makes it one of another kind,
/// and was met before it, goes first: what is asked of the fields of one kind says nothing of another's.
template <class Config, class Read>
Result<Config> parse(std::span<const std::byte> json, const std::string& file, Read&& read) {
  const auto document = io::parse_json(json, file);
  if (!document) return propagate(document);
  std::optional<Error> error;
  const JsonFields fields(*document, file + ":", error);
  if (!document->is_object()) return fail(ErrorCode::corrupt_data, "expected an object", file);
  Kind kind(fields, error);
  Config config;
  read(fields, kind, config);
  if (kind.other()) return tl::make_unexpected(*kind.other());
  if (error) return tl::make_unexpected(std::move(*error));
  return config;
}

/// Samplers divide by the picture that is left and by the noise that is there, and take logarithms of both.
void check_noise(const JsonFields& fields, const NoiseConfig& config) {
  constexpr double least = 1e-9;
  if (!(config.beta_start > least && config.beta_start <= config.beta_end && config.beta_end < 1))
    return fields.fail_here("expected 1e-9 < beta_start <= beta_end < 1");
  const double first = std::sqrt(config.beta_start), last = std::sqrt(config.beta_end);
  double left = 1;
  for (int t = 0; t < config.training_steps; ++t) {
    const double root = first + (last - first) * t / (config.training_steps - 1);
    left *= 1 - root * root;
  }
  if (!(left > least)) fields.fail_here("with these betas nothing is left of a picture at the last step of training");
}

/// All that diffusers' UNet2DConditionModel can be and Stable Diffusion 1.x and 2.x-base are not.
void check_kind(Kind& kind) {
  kind.must_be("_class_name", "UNet2DConditionModel");
  for (const char* key : {"class_embed_type", "addition_embed_type", "encoder_hid_dim", "encoder_hid_dim_type",
                          "num_class_embeds", "time_cond_proj_dim", "time_embedding_act_fn", "timestep_post_act",
                          "cross_attention_norm", "addition_time_embed_dim", "reverse_transformer_layers_per_block"})
    kind.must_be_absent(key);
  kind.must_be("act_fn", "silu");
  kind.must_be("mid_block_type", "UNetMidBlock2DCrossAttn");
  kind.must_be("resnet_time_scale_shift", "default");
  kind.must_be("time_embedding_type", "positional");
  kind.must_be("attention_type", "default");
  for (const char* key : {"center_input_sample", "dual_cross_attention", "only_cross_attention",
                          "class_embeddings_concat", "resnet_skip_time_act"})
    kind.must_be(key, false);
  kind.must_be("flip_sin_to_cos", true);
  for (const char* key :
       {"downsample_padding", "mid_block_scale_factor", "transformer_layers_per_block", "resnet_out_scale_factor"})
    kind.must_be(key, 1);
  kind.must_be("freq_shift", 0);
  kind.must_be("conv_in_kernel", 3);
  kind.must_be("conv_out_kernel", 3);
  kind.must_be("in_channels", 4);  // 9: inpainting, 8: upscaling or instructions
  kind.must_be("out_channels", 4);
}

}  // namespace

Result<UNetConfig> parse_unet_config(std::span<const std::byte> json, const std::string& file) {
  return parse<UNetConfig>(json, file, [](const JsonFields& fields, Kind& kind, UNetConfig& config) {
    check_kind(kind);
    config.channels = channels_of(fields);
    const std::size_t levels = config.channels.size();
    config.down_attends = kind.one_of("down_block_types", levels, "CrossAttnDownBlock2D", "DownBlock2D");
    config.up_attends = kind.one_of("up_block_types", levels, "CrossAttnUpBlock2D", "UpBlock2D");
    config.layers_per_block = whole(fields, "layers_per_block", 1, 16, config.layers_per_block);
    config.context_width = whole(fields, "cross_attention_dim", 1, max_width, 1280);
    config.norm_groups = whole(fields, "norm_num_groups", 1, max_width, config.norm_groups);
    config.norm_eps = positive(fields, "norm_eps", config.norm_eps);
    config.sample_side = whole(fields, "sample_size", 1, 1 << 10, config.sample_side);
    config.linear_projection =
        fields.has_value("use_linear_projection") && fields.at("use_linear_projection").boolean();
    // The field that is called a head's width has always been the number of heads; the right name came later.
    const char* heads = fields.has_value("num_attention_heads") ? "num_attention_heads" : "attention_head_dim";
    config.heads =
        fields.has_value(heads) ? per_level(fields.at(heads), levels, 1, max_width) : std::vector<int>(levels, 8);
    check_divisible(fields, "block_out_channels", config.channels, config.heads);
    check_divisible(fields, "block_out_channels", config.channels, std::vector<int>(levels, config.norm_groups));
    if (config.channels.front() % 2 != 0) fields.at("block_out_channels").fail_here("expected an even first width");
  });
}

Result<AutoencoderConfig> parse_autoencoder_config(std::span<const std::byte> json, const std::string& file) {
  return parse<AutoencoderConfig>(json, file, [](const JsonFields& fields, Kind& kind, AutoencoderConfig& config) {
    kind.must_be("_class_name", "AutoencoderKL");
    kind.must_be("act_fn", "silu");
    for (const char* key : {"mid_block_add_attention", "use_quant_conv", "use_post_quant_conv"})
      kind.must_be(key, true);
    kind.must_be_absent("shift_factor");
    kind.must_be("in_channels", 3);
    kind.must_be("out_channels", 3);
    kind.must_be("latent_channels", 4);
    config.channels = channels_of(fields);
    const std::size_t levels = config.channels.size();
    (void)kind.one_of("down_block_types", levels, "DownEncoderBlock2D", "DownEncoderBlock2D");
    (void)kind.one_of("up_block_types", levels, "UpDecoderBlock2D", "UpDecoderBlock2D");
    config.layers_per_block = whole(fields, "layers_per_block", 1, 16, 1);
    config.norm_groups = whole(fields, "norm_num_groups", 1, max_width, config.norm_groups);
    config.scaling_factor = positive(fields, "scaling_factor", config.scaling_factor);
    check_divisible(fields, "block_out_channels", config.channels, std::vector<int>(levels, config.norm_groups));
  });
}

Result<TextEncoderConfig> parse_text_encoder_config(std::span<const std::byte> json, const std::string& file) {
  return parse<TextEncoderConfig>(json, file, [](const JsonFields& fields, Kind& kind, TextEncoderConfig& config) {
    kind.must_be("model_type", "clip_text_model");
    config.width = whole(fields, "hidden_size", 1, max_width, 512);
    config.feed_forward_width = whole(fields, "intermediate_size", 1, 4 * max_width, 2048);
    config.layers = whole(fields, "num_hidden_layers", 1, 64, 12);
    config.heads = whole(fields, "num_attention_heads", 1, max_width, 8);
    config.positions = whole(fields, "max_position_embeddings", 2, 4096, 77);
    config.vocabulary = whole(fields, "vocab_size", 3, 1 << 20, 49408);
    config.norm_eps = positive(fields, "layer_norm_eps", 1e-5);
    if (config.width % config.heads != 0) fields.at("hidden_size").fail_here("its width does not part into its heads");
    const bool exact = fields.has_value("hidden_act") && fields.at("hidden_act").string() == "gelu";
    config.activation = exact ? Activation::gelu : Activation::quick_gelu;
    if (!exact) kind.must_be("hidden_act", "quick_gelu");
  });
}

Result<NoiseConfig> parse_noise_config(std::span<const std::byte> json, const std::string& file) {
  return parse<NoiseConfig>(json, file, [](const JsonFields& fields, Kind& kind, NoiseConfig& config) {
    kind.must_be("prediction_type", "epsilon");  // 2.x at 768 pixels predicts velocities
    kind.must_be_absent("trained_betas");
    kind.must_be("rescale_betas_zero_snr", false);
    if (fields.has_value("beta_schedule"))
      kind.must_be("beta_schedule", "scaled_linear");
    else
      (void)fields.at("beta_schedule").string();  // says that it is missing
    config.training_steps = whole(fields, "num_train_timesteps", 2, 1 << 16, config.training_steps);
    config.beta_start = fields.at("beta_start").number();
    config.beta_end = fields.at("beta_end").number();
    check_noise(fields, config);
    config.steps_offset = whole(fields, "steps_offset", 0, config.training_steps - 1, 0);
    // The libraries' DDIM and LCM end without noise unless they are told otherwise, PNDM does not.
    const std::string sampler = fields.has_value("_class_name") ? fields.at("_class_name").string() : "";
    config.ends_without_noise = sampler == "DDIMScheduler" || sampler == "LCMScheduler";
    if (fields.has_value("set_alpha_to_one")) config.ends_without_noise = fields.at("set_alpha_to_one").boolean();
  });
}

int side_multiple(const Configs& configs) {
  return configs.autoencoder.pixels_per_latent() << (configs.unet.channels.size() - 1);
}

int picture_side(const Configs& configs) {
  const int trained = configs.unet.sample_side * configs.autoencoder.pixels_per_latent();
  const int multiple = side_multiple(configs);
  return std::max(1, (trained + multiple / 2) / multiple) * multiple;
}

Result<void> validate(const Configs& configs) {
  const auto too_large = [](int pixels, const char* field) {
    return fail(ErrorCode::unsupported,
                "networks for pictures of " + std::to_string(pixels) + " pixels a side, which have at most " +
                    std::to_string(max_picture_side) + " here",
                std::string("unet/config.json:") + field);
  };
  if (configs.unet.context_width != configs.text_encoder.width)
    return fail(ErrorCode::corrupt_data,
                "the text encoder's tokens have " + std::to_string(configs.text_encoder.width) +
                    " numbers, of which the UNet takes " + std::to_string(configs.unet.context_width),
                "unet/config.json:cross_attention_dim");
  if (side_multiple(configs) > max_picture_side) return too_large(side_multiple(configs), "block_out_channels");
  const int side = picture_side(configs);
  if (side > max_picture_side) return too_large(side, "sample_size");
  return {};
}

}  // namespace engine::weights
