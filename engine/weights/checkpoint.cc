#include "engine/weights/checkpoint.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "engine/io/read_bytes.h"
#include "engine/weights/digest.h"
#include "engine/weights/original_names.h"

namespace engine::weights {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t max_config_bytes = 1 << 20;  // diffusers writes 2 KB

struct Part {
  const char* folder;
  const char* stem;  ///< Of its files of tensors.
};
constexpr std::array<Part, 3> parts = {
    {{"unet", "diffusion_pytorch_model"}, {"vae", "diffusion_pytorch_model"}, {"text_encoder", "model"}}};

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// The file of tensors in a part's folder: full precision first, since it is what f16 was rounded from.
Result<TensorFile> open_part(const fs::path& folder, const std::string& stem) {
  for (const char* ending : {".safetensors", ".fp16.safetensors"})
    if (is_file(folder / (stem + ending))) return TensorFile::open(folder / (stem + ending));
  for (const char* ending : {".bin", ".fp16.bin"})
    if (is_file(folder / (stem + ending)) || is_file(folder / ("pytorch_" + stem + ending)))
      return fail(ErrorCode::unsupported,
                  folder.string() + " has its tensors as a pickle (.bin) only, which can run any program when it is " +
                      "opened; get " + stem + ".safetensors",
                  folder.string());
  return fail(ErrorCode::not_found, folder.string() + " has no " + stem + ".safetensors",
              (folder / (stem + ".safetensors")).string());
}

template <class Config>
Result<void> read_config(const fs::path& folder, const char* part, const char* name,
                         Result<Config> (*parse)(std::span<const std::byte>, const std::string&), Config& config,
                         Digest& digest) {
  const auto bytes = io::read_bytes(folder / part / name, max_config_bytes);
  if (!bytes) return propagate(bytes);
  digest.add(*bytes);
  auto parsed = parse(*bytes, std::string(part) + "/" + name);
  if (!parsed) return propagate(parsed);
  config = std::move(*parsed);
  return {};
}

Result<Configs> read_configs(const fs::path& folder, Digest& digest) {
  Configs configs;
  const auto read = [&](const char* part, const char* name, auto parse, auto& config) {
    return read_config(folder, part, name, parse, config, digest);
  };
  if (auto done = read("unet", "config.json", parse_unet_config, configs.unet); !done) return propagate(done);
  if (auto done = read("vae", "config.json", parse_autoencoder_config, configs.autoencoder); !done)
    return propagate(done);
  if (auto done = read("text_encoder", "config.json", parse_text_encoder_config, configs.text_encoder); !done)
    return propagate(done);
  if (auto done = read("scheduler", "scheduler_config.json", parse_noise_config, configs.noise); !done)
    return propagate(done);
  if (const auto valid = validate(configs); !valid) return propagate(valid);
  return configs;
}

/// Are two shapes the same but for sides of length 1 at their ends? Matrices of attention are also kept as 1 x 1
/// convolutions.
bool same_but_for_ones(Shape a, Shape b) {
  for (Shape* shape : {&a, &b})
    while (shape->size() > 2 && shape->back() == 1) shape->pop_back();
  return a == b;
}

}  // namespace

Result<Checkpoint> Checkpoint::open(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) {
    auto file = TensorFile::open(path);
    if (!file) return propagate(file);
    auto checkpoint = of_file(std::move(*file));
    if (checkpoint) checkpoint->tokenizer_folder_ = path.parent_path() / "tokenizer";
    return checkpoint;
  }
  Checkpoint checkpoint;
  Digest of_configs;
  auto configs = read_configs(path, of_configs);
  if (!configs) return propagate(configs);
  checkpoint.configs_digest_ = of_configs.text();
  checkpoint.configs_ = std::move(*configs);
  for (const Part& part : parts) {
    auto file = open_part(path / part.folder, part.stem);
    if (!file) return propagate(file);
    checkpoint.files_.push_back(std::move(*file));
  }
  checkpoint.tokenizer_folder_ = path / "tokenizer";
  checkpoint.open_clip_ = checkpoint.configs_.text_encoder.activation == Activation::gelu;
  return checkpoint;
}

Result<Checkpoint> Checkpoint::open_file(const fs::path& path, const Configs& configs) {
  auto file = TensorFile::open(path);
  if (!file) return propagate(file);
  auto checkpoint = of_file(std::move(*file), configs);
  if (checkpoint) checkpoint->tokenizer_folder_ = path.parent_path() / "tokenizer";
  return checkpoint;
}

Result<Checkpoint> Checkpoint::of_file(TensorFile file, const std::optional<Configs>& configs) {
  Checkpoint checkpoint;
  checkpoint.single_ = true;
  checkpoint.open_clip_ = file.find("cond_stage_model.model.token_embedding.weight") != nullptr;
  if (!checkpoint.open_clip_ &&
      file.find("cond_stage_model.transformer.text_model.embeddings.token_embedding.weight") == nullptr)
    return fail(
        ErrorCode::unsupported,
        file.name() + " is no whole checkpoint of Stable Diffusion 1.x or 2.x-base: it has no text encoder of theirs",
        file.name());
  checkpoint.configs_ = configs.value_or(checkpoint.open_clip_ ? stable_diffusion_2_base() : stable_diffusion_1());
  checkpoint.files_.push_back(std::move(file));
  return checkpoint;
}

Result<FoundTensor> Checkpoint::find(Network network, const TensorSpec& spec) const {
  const TensorFile& file = files_[single_ ? 0 : std::size_t(network)];
  const OriginalPlace place =
      single_ ? original_place(configs_, network, spec.name, open_clip_) : OriginalPlace{spec.name, -1};
  std::string name = place.name;
  const StoredTensor* stored = file.find(name);
  if (stored == nullptr && !single_ && network == Network::autoencoder) {
    const std::string old = old_autoencoder_name(name);
    if ((stored = file.find(old)) != nullptr) name = old;
  }
  FoundTensor found;
  found.where = file.name() + ":" + name;
  found.owner = file.owner();
  if (stored == nullptr) return fail(ErrorCode::corrupt_data, "this tensor is missing", found.where);
  found.tensor = *stored;
  Shape expected = spec.shape;
  if (place.third >= 0) expected[0] *= 3;
  if (!same_but_for_ones(stored->shape, expected))
    return fail(
        ErrorCode::corrupt_data,
        "its shape is " + text_of(stored->shape) + "; expected " + text_of(expected) + " for this configuration",
        found.where);
  if (place.third >= 0) {
    const std::size_t bytes = stored->bytes.size() / 3;
    found.tensor.bytes = stored->bytes.subspan(std::size_t(place.third) * bytes, bytes);
  }
  found.tensor.shape = spec.shape;
  return found;
}

Result<void> Checkpoint::check() const {
  for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder})
    for (const TensorSpec& spec : tensors_of(configs_, network))
      if (const auto found = find(network, spec); !found) return propagate(found);
  return {};
}

Result<std::string> Checkpoint::digest() const {
  Digest digest;
  digest.add(configs_digest_);
  for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder})
    for (const TensorSpec& spec : tensors_of(configs_, network)) {
      const auto found = find(network, spec);
      if (!found) return propagate(found);
      digest.add(spec.name, found->tensor);
    }
  return digest.text();
}

}  // namespace engine::weights
