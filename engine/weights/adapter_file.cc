#include "engine/weights/adapter_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/core/finite.h"
#include "engine/io/json_fields.h"
#include "engine/io/read_bytes.h"
#include "engine/weights/digest.h"

namespace engine::weights {
namespace {

enum class Piece { down, up, alpha };

constexpr std::string_view peft_beginning = "base_model.model.";

/// The layers of a network that an adapter may be for, by name, with the shapes of their weights. Tables of a text
/// encoder's pieces and positions are no layers: nothing is multiplied by them.
struct Layers {
  std::map<std::string, Shape, std::less<>> shapes;
  std::map<std::string, std::string, std::less<>> by_flat_name;  ///< kohya's: every dot is an underscore.

  explicit Layers(const std::vector<TensorSpec>& specs) {
    constexpr std::string_view ending = ".weight";
    for (const TensorSpec& spec : specs) {
      if (!spec.name.ends_with(ending) || spec.shape.size() < 2 || spec.name.starts_with("text_model.embeddings."))
        continue;
      std::string layer = spec.name.substr(0, spec.name.size() - ending.size());
      std::string flat = layer;
      std::ranges::replace(flat, '.', '_');
      by_flat_name.emplace(std::move(flat), layer);
      shapes.emplace(std::move(layer), spec.shape);
    }
  }
};

/// What a tensor's name says.
struct Address {
  bool of_text_encoder = false;
  std::string layer;
  Piece piece = Piece::down;
};

bool take_ending(std::string_view& name, std::string_view ending) {
  if (!name.ends_with(ending)) return false;
  name.remove_suffix(ending.size());
  return true;
}

bool take_beginning(std::string_view& name, std::string_view beginning) {
  if (!name.starts_with(beginning)) return false;
  name.remove_prefix(beginning.size());
  return true;
}

/// Takes what follows the layer off the name.
std::optional<Piece> take_piece(std::string_view& name) {
  using Ending = std::pair<std::string_view, Piece>;
  static constexpr std::array<Ending, 12> endings = {{{".lora.down.weight", Piece::down},
                                                      {".lora.up.weight", Piece::up},
                                                      {".lora_A.weight", Piece::down},
                                                      {".lora_B.weight", Piece::up},
                                                      {".lora_linear_layer.down.weight", Piece::down},
                                                      {".lora_linear_layer.up.weight", Piece::up},
                                                      {".lora_down.weight", Piece::down},
                                                      {".lora_up.weight", Piece::up},
                                                      {"_lora.down.weight", Piece::down},
                                                      {"_lora.up.weight", Piece::up},
                                                      {".lora.alpha", Piece::alpha},
                                                      {".alpha", Piece::alpha}}};
  for (const auto& [ending, piece] : endings)
    if (take_ending(name, ending)) return piece;
  return std::nullopt;
}

class AdapterReader {
 public:
  explicit AdapterReader(const Configs& configs)
      : unet_(tensors_of(configs.unet)), text_encoder_(tensors_of(configs.text_encoder)) {}

  [[nodiscard]] const Layers& layers(bool of_text_encoder) const { return of_text_encoder ? text_encoder_ : unet_; }

  /// Nothing if the name is none of an adapter's, or names no layer.
  [[nodiscard]] std::optional<Address> address_of(std::string_view name) const {
    Address address;
    const auto piece = take_piece(name);
    if (!piece) return std::nullopt;
    address.piece = *piece;
    const bool flat_unet = take_beginning(name, "lora_unet_"), flat_text = take_beginning(name, "lora_te_");
    if (flat_unet || flat_text) {
      address.of_text_encoder = flat_text;
      const auto& names = layers(flat_text).by_flat_name;
      const auto found = names.find(name);
      if (found == names.end()) return std::nullopt;
      address.layer = found->second;
      return address;
    }
    if (take_beginning(name, "text_encoder."))
      address.of_text_encoder = true;
    else if (take_beginning(name, peft_beginning) || !take_beginning(name, "unet."))
      address.of_text_encoder = name.starts_with("text_model.");
    address.layer = name;
    // Attention processors: "attn1.processor.to_q" is for attn1.to_q, "attn1.processor.to_out" for attn1.to_out.0.
    constexpr std::string_view processor = ".processor.";
    if (const std::size_t at = address.layer.find(processor); at != std::string::npos) {
      address.layer.replace(at, processor.size(), ".");
      if (address.layer.ends_with(".to_out")) address.layer += ".0";
    }
    if (!layers(address.of_text_encoder).shapes.contains(address.layer)) return std::nullopt;
    return address;
  }

 private:
  Layers unet_, text_encoder_;
};

/// A pair while its pieces come in.
struct Pair {
  const StoredTensor *down = nullptr, *up = nullptr;
  std::string down_name, up_name, alpha_name;
  double alpha = 0;
};

/// Of a tensor of a file, whose elements can be counted.
std::uint64_t side_product(const Shape& shape, std::size_t from) {
  std::uint64_t product = 1;
  for (std::size_t i = from; i < shape.size(); ++i) product *= std::uint64_t(shape[i]);
  return product;
}

/// Do the shapes of a pair fit its layer's? Both may have sides of length 1 more, or fewer, than a matrix has. A rank
/// of more than both widths is taken for damage; one above the lesser is of no use, but small layers of real adapters
/// have it.
bool fits(const Shape& down, const Shape& up, const Shape& layer) {
  if (down.size() < 2 || up.size() < 2 || down[0] < 1 || up[1] != down[0]) return false;
  if (down[0] > std::max(layer[0], layer[1])) return false;
  return up[0] == layer[0] && side_product(up, 2) == 1 && down[1] == layer[1] &&
         side_product(down, 2) == side_product(layer, 2) && (layer.size() == 2 || down.size() == 2 || down.size() == 4);
}

Result<FloatTensor> read_piece(const StoredTensor& tensor, const Shape& shape, const std::string& where) {
  FloatTensor read{shape, std::vector<float>(std::size_t(tensor.elements()))};
  if (const auto done = read_floats(tensor, where, read.values); !done) return propagate(done);
  return read;
}

Result<LowRank> low_rank(const Pair& pair, const Shape& layer, const std::string& file,
                         const AdapterSettings& settings) {
  if (pair.down == nullptr || pair.up == nullptr)
    return fail(ErrorCode::corrupt_data, "the other half of this pair is missing",
                file + ":" + (pair.down != nullptr ? pair.down_name : pair.up_name));
  // Of other types the file says nothing that can be held against their shape: nothing is allocated for them.
  for (const auto& [tensor, name] : {std::pair(pair.down, &pair.down_name), std::pair(pair.up, &pair.up_name)})
    if (!tensor->has_floats())
      return fail(ErrorCode::unsupported, "its numbers are " + tensor->dtype + "; F16, BF16 and F32 are read",
                  file + ":" + *name);
  if (!fits(pair.down->shape, pair.up->shape, layer))
    return fail(ErrorCode::corrupt_data,
                "its shape " + text_of(pair.down->shape) + " and its other half's " + text_of(pair.up->shape) +
                    " do not fit a layer of " + text_of(layer),
                file + ":" + pair.down_name);
  const std::int64_t rank = pair.down->shape[0];
  if (settings.rank != 0 && rank != settings.rank)
    return fail(ErrorCode::corrupt_data,
                "its rank is " + std::to_string(rank) + ", but r is " + std::to_string(settings.rank),
                file + ":" + pair.down_name);
  // Kept in the layer's own form: of a matrix as matrices, of a convolution as convolutions.
  Shape down{rank, layer[1]}, up{layer[0], rank};
  if (layer.size() == 4) down.insert(down.end(), {layer[2], layer[3]}), up.insert(up.end(), {1, 1});
  LowRank result;
  auto read_down = read_piece(*pair.down, down, file + ":" + pair.down_name);
  if (!read_down) return propagate(read_down);
  auto read_up = read_piece(*pair.up, up, file + ":" + pair.up_name);
  if (!read_up) return propagate(read_up);
  result.down = std::move(*read_down), result.up = std::move(*read_up);
  const double own = pair.alpha != 0 ? pair.alpha : settings.alpha;
  result.scale = own != 0 ? own / double(rank) : 1;
  return result;
}

/// peft's configuration, whose fields' names begin with `prefix`.
///   where  of the document
Result<AdapterSettings> settings_of(const nlohmann::json& document, const std::string& prefix,
                                    const std::string& where) {
  std::optional<Error> error;
  const io::JsonFields fields(document, where + ":", error);
  if (!document.is_object()) return fail(ErrorCode::corrupt_data, "expected an object", where);
  for (const char* name : {"use_rslora", "use_dora", "alpha_pattern", "rank_pattern"}) {
    const auto field = document.find(prefix + name);
    if (field == document.end() || field->is_null() || *field == false || (field->is_object() && field->empty()))
      continue;
    return fail(ErrorCode::unsupported, "an adapter whose layers are scaled in a way that is not read",
                where + ":" + prefix + name);
  }
  const io::JsonFields rank = fields.at((prefix + "r").c_str()), alpha = fields.at((prefix + "lora_alpha").c_str());
  const AdapterSettings settings{alpha.number(), std::int64_t(std::clamp(rank.number(), 0.0, 1e6))};
  if (!(settings.alpha > 0 && settings.alpha < 1e6)) alpha.fail_here("expected a number above 0");
  if (settings.rank < 1 || double(settings.rank) != rank.number()) rank.fail_here("expected a whole number above 0");
  if (error) return tl::make_unexpected(std::move(*error));
  return settings;
}

/// Those of the adapter_config.json beside a file of peft; nothing if there is none.
Result<std::optional<AdapterSettings>> settings_beside(const std::filesystem::path& path) {
  const auto config = path.parent_path() / "adapter_config.json";
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(config, ignored)) return std::nullopt;
  const auto bytes = io::read_bytes(config, 1 << 20);
  if (!bytes) return propagate(bytes);
  const auto document = io::parse_json(*bytes, "adapter_config.json");
  if (!document) return propagate(document);
  const auto settings = settings_of(*document, "", "adapter_config.json");
  if (!settings) return propagate(settings);
  return std::optional(*settings);
}

/// Those that diffusers writes among a file's texts since it keeps alphas: fields of both networks in one object, by
/// their names ("unet.lora_alpha"), or of one network without. Nothing if there are none for a network.
Result<std::optional<AdapterSettings>> settings_within(const TensorFile& file, bool of_text_encoder) {
  const auto text = file.metadata().find("lora_adapter_metadata");
  if (text == file.metadata().end()) return std::nullopt;
  const std::string where = file.name() + ":lora_adapter_metadata";
  const auto document = io::parse_json(std::as_bytes(std::span(text->second)), where);
  if (!document) return propagate(document);
  std::string prefix = of_text_encoder ? "text_encoder." : "unet.";
  if (document->is_object() && !document->contains(prefix + "lora_alpha")) {
    if (!document->contains("lora_alpha")) return std::nullopt;
    prefix.clear();
  }
  const auto settings = settings_of(*document, prefix, where);
  if (!settings) return propagate(settings);
  return std::optional(*settings);
}

}  // namespace

Result<AdapterWeights> decode_adapter(const TensorFile& file, const Configs& configs,
                                      const std::optional<AdapterSettings>& settings) {
  const AdapterReader reader(configs);
  std::map<std::string, Pair> unet, text_encoder;
  for (const auto& [name, tensor] : file.tensors()) {
    const auto address = reader.address_of(name);
    if (!address)
      return fail(ErrorCode::unsupported,
                  "these networks have no such layer: it was made for other ones, or is no LoRA",
                  file.name() + ":" + name);
    if (name.starts_with(peft_beginning) && !settings)
      return fail(ErrorCode::not_found, "the scale of peft's adapters is in adapter_config.json, which is not there",
                  file.name() + ":" + name);
    Pair& pair = (address->of_text_encoder ? text_encoder : unet)[address->layer];
    std::string& own_name = address->piece == Piece::down ? pair.down_name
                            : address->piece == Piece::up ? pair.up_name
                                                          : pair.alpha_name;
    if (!own_name.empty())
      return fail(ErrorCode::corrupt_data, "its layer has " + own_name + " already", file.name() + ":" + name);
    own_name = name;
    switch (address->piece) {
      case Piece::down:
        pair.down = &tensor;
        break;
      case Piece::up:
        pair.up = &tensor;
        break;
      case Piece::alpha: {
        float value = 0;
        if (tensor.elements() != 1)
          return fail(ErrorCode::corrupt_data, "expected one number", file.name() + ":" + name);
        if (const auto done = read_floats(tensor, file.name() + ":" + name, {&value, 1}); !done) return propagate(done);
        pair.alpha = double(value);
        break;
      }
    }
  }
  AdapterWeights weights;
  for (const bool of_text_encoder : {false, true}) {
    const auto within = settings_within(file, of_text_encoder);
    if (!within) return propagate(within);
    const AdapterSettings own = *within ? **within : settings.value_or(AdapterSettings{});
    for (const auto& [layer, pair] : of_text_encoder ? text_encoder : unet) {
      if (pair.down == nullptr && pair.up == nullptr)
        return fail(ErrorCode::corrupt_data, "an alpha without the layer that it is for",
                    file.name() + ":" + pair.alpha_name);
      auto read = low_rank(pair, reader.layers(of_text_encoder).shapes.find(layer)->second, file.name(), own);
      if (!read) return propagate(read);
      (of_text_encoder ? weights.text_encoder : weights.unet).emplace(layer, std::move(*read));
    }
  }
  if (weights.unet.empty() && weights.text_encoder.empty())
    return fail(ErrorCode::corrupt_data, "there is no tensor in it", file.name());
  return weights;
}

Result<AdapterWeights> read_adapter(const std::filesystem::path& path, const Configs& configs) {
  const auto file = TensorFile::open(path);
  if (!file) return propagate(file);
  // The configuration beside a file is of peft's alone: other layouts share folders with it.
  const bool of_peft = !file->tensors().empty() && file->tensors().begin()->first.starts_with(peft_beginning);
  if (!of_peft) return decode_adapter(*file, configs);
  const auto settings = settings_beside(path);
  if (!settings) return propagate(settings);
  return decode_adapter(*file, configs, *settings);
}

Result<void> check_adapter(const AdapterWeights& weights, const Configs& configs) {
  const auto count = [](const Shape& shape) { return side_product(shape, 0); };
  for (const bool of_text_encoder : {false, true}) {
    const Layers layers(of_text_encoder ? tensors_of(configs.text_encoder) : tensors_of(configs.unet));
    for (const auto& [layer, pair] : of_text_encoder ? weights.text_encoder : weights.unet) {
      const auto found = layers.shapes.find(layer);
      if (found == layers.shapes.end())
        return fail(ErrorCode::invalid_argument, "the networks have no such layer", layer);
      const Shape &down = pair.down.shape, &up = pair.up.shape, &shape = found->second;
      if (down.size() != shape.size() || up.size() != shape.size() || !fits(down, up, shape) ||
          pair.down.values.size() != count(down) || pair.up.values.size() != count(up))
        return fail(ErrorCode::invalid_argument,
                    text_of(down) + " and " + text_of(up) + " do not fit a layer of " + text_of(shape), layer);
      if (!std::isfinite(pair.scale) || first_not_finite(pair.down.values) || first_not_finite(pair.up.values))
        return fail(ErrorCode::invalid_argument, "a number is not finite", layer);
    }
  }
  return {};
}

std::uint64_t AdapterWeights::bytes() const {
  std::uint64_t numbers = 0;
  for (const auto* layers : {&unet, &text_encoder})
    for (const auto& [layer, pair] : *layers) numbers += pair.down.values.size() + pair.up.values.size();
  return sizeof(float) * numbers;
}

std::string digest_of(const AdapterWeights& weights) {
  Digest digest;
  const auto add = [&](const FloatTensor& tensor) {
    digest.add(std::as_bytes(std::span(tensor.shape)));
    digest.add(std::as_bytes(std::span(tensor.values)));
  };
  for (const auto* layers : {&weights.unet, &weights.text_encoder}) {
    digest.add(std::to_string(layers->size()));
    for (const auto& [layer, pair] : *layers) {
      digest.add(layer);
      add(pair.down);
      add(pair.up);
      digest.add(std::as_bytes(std::span(&pair.scale, 1)));
    }
  }
  return digest.text();
}

std::string encode_adapter(const AdapterWeights& weights) {
  std::map<std::string, FloatTensor> tensors;
  const auto put = [&](const std::string& layer, const char* infix, const LowRank& pair) {
    FloatTensor up = pair.up;
    if (pair.scale != 1)
      for (float& value : up.values) value = float(double(value) * pair.scale);
    tensors.emplace(layer + infix + "down.weight", pair.down);
    tensors.emplace(layer + infix + "up.weight", std::move(up));
  };
  for (const auto& [layer, pair] : weights.unet) put("unet." + layer, ".lora.", pair);
  for (const auto& [layer, pair] : weights.text_encoder) put("text_encoder." + layer, ".lora_linear_layer.", pair);
  return encode_tensors(tensors, {{"format", "pt"}});
}

}  // namespace engine::weights
