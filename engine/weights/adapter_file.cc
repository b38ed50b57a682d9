#include "engine/weights/adapter_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/io/json_fields.h"
#include "engine/io/read_bytes.h"

namespace engine::weights {
namespace {

enum class Piece { down, up, alpha };

/// The layers of a network that an adapter may be for, by name, with the shapes of their weights.
struct Layers {
  std::map<std::string, Shape, std::less<>> shapes;
  std::map<std::string, std::string, std::less<>> by_flat_name;  ///< kohya's: every dot is an underscore.

  explicit Layers(const std::vector<TensorSpec>& specs) {
    constexpr std::string_view ending = ".weight";
    for (const TensorSpec& spec : specs) {
      if (!spec.name.ends_with(ending) || spec.shape.size() < 2) continue;
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
    else if (take_beginning(name, "base_model.model.") || !take_beginning(name, "unet."))
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
  std::string down_name, up_name;
  double alpha = 0;
};

std::int64_t side_product(const Shape& shape, std::size_t from) {
  std::int64_t product = 1;
  for (std::size_t i = from; i < shape.size(); ++i) product *= shape[i];
  return product;
}

/// Do the shapes of a pair fit its layer's? Both may have sides of length 1 more, or fewer, than a matrix has.
bool fits(const Shape& down, const Shape& up, const Shape& layer) {
  if (down.size() < 2 || up.size() < 2 || down[0] < 1 || up[1] != down[0]) return false;
  return up[0] == layer[0] && side_product(up, 2) == 1 && down[1] == layer[1] &&
         side_product(down, 2) == side_product(layer, 2) && (layer.size() == 2 || down.size() == 2 || down.size() == 4);
}

Result<FloatTensor> read_piece(const StoredTensor& tensor, const Shape& shape, const std::string& where) {
  FloatTensor read{shape, std::vector<float>(std::size_t(tensor.elements()))};
  if (const auto done = read_floats(tensor, where, read.values); !done) return propagate(done);
  return read;
}

Result<LowRank> low_rank(const Pair& pair, const Shape& layer, const std::string& file, double alpha) {
  if (pair.down == nullptr || pair.up == nullptr)
    return fail(ErrorCode::corrupt_data, "the other half of this pair is missing",
                file + ":" + (pair.down != nullptr ? pair.down_name : pair.up_name));
  if (!fits(pair.down->shape, pair.up->shape, layer))
    return fail(ErrorCode::corrupt_data,
                "its shape " + text_of(pair.down->shape) + " and its other half's " + text_of(pair.up->shape) +
                    " do not fit a layer of " + text_of(layer),
                file + ":" + pair.down_name);
  const std::int64_t rank = pair.down->shape[0];
  // Kept in the layer's own form: of a matrix as matrices, of a convolution as convolutions.
  Shape down{rank, layer[1]}, up{layer[0], rank};
  if (layer.size() == 4) down.insert(down.end(), {layer[2], layer[3]}), up.insert(up.end(), {1, 1});
  LowRank result;
  auto read_down = read_piece(*pair.down, down, file + ":" + pair.down_name);
  if (!read_down) return propagate(read_down);
  auto read_up = read_piece(*pair.up, up, file + ":" + pair.up_name);
  if (!read_up) return propagate(read_up);
  result.down = std::move(*read_down), result.up = std::move(*read_up);
  const double own = pair.alpha != 0 ? pair.alpha : alpha;
  result.scale = own != 0 ? own / double(rank) : 1;
  return result;
}

/// lora_alpha of the adapter_config.json beside a file of peft; 0 if there is none.
Result<double> alpha_beside(const std::filesystem::path& path) {
  const auto config = path.parent_path() / "adapter_config.json";
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(config, ignored)) return 0.0;
  const auto bytes = io::read_bytes(config, 1 << 20);
  if (!bytes) return propagate(bytes);
  const auto document = io::parse_json(*bytes, "adapter_config.json");
  if (!document) return propagate(document);
  std::optional<Error> error;
  const double alpha = io::JsonFields(*document, "adapter_config.json:", error).at("lora_alpha").number();
  if (error) return tl::make_unexpected(std::move(*error));
  return alpha;
}

}  // namespace

Result<AdapterWeights> decode_adapter(const TensorFile& file, const Configs& configs, double alpha) {
  const AdapterReader reader(configs);
  std::map<std::string, Pair> unet, text_encoder;
  for (const auto& [name, tensor] : file.tensors()) {
    const auto address = reader.address_of(name);
    if (!address)
      return fail(ErrorCode::unsupported, "no tensor of a LoRA for these networks", file.name() + ":" + name);
    Pair& pair = (address->of_text_encoder ? text_encoder : unet)[address->layer];
    switch (address->piece) {
      case Piece::down:
        pair.down = &tensor, pair.down_name = name;
        break;
      case Piece::up:
        pair.up = &tensor, pair.up_name = name;
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
  for (const bool of_text_encoder : {false, true})
    for (const auto& [layer, pair] : of_text_encoder ? text_encoder : unet) {
      if (pair.down == nullptr && pair.up == nullptr)
        return fail(ErrorCode::corrupt_data, "an alpha without the layer that it is for", file.name() + ":" + layer);
      auto read = low_rank(pair, reader.layers(of_text_encoder).shapes.find(layer)->second, file.name(), alpha);
      if (!read) return propagate(read);
      (of_text_encoder ? weights.text_encoder : weights.unet).emplace(layer, std::move(*read));
    }
  if (weights.unet.empty() && weights.text_encoder.empty())
    return fail(ErrorCode::corrupt_data, "there is no tensor in it", file.name());
  return weights;
}

Result<AdapterWeights> read_adapter(const std::filesystem::path& path, const Configs& configs) {
  const auto file = TensorFile::open(path);
  if (!file) return propagate(file);
  // The configuration beside a file is of peft's alone: other layouts share folders with it.
  const bool of_peft = !file->tensors().empty() && file->tensors().begin()->first.starts_with("base_model.model.");
  const auto alpha = of_peft ? alpha_beside(path) : Result<double>(0.0);
  if (!alpha) return propagate(alpha);
  return decode_adapter(*file, configs, *alpha);
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
