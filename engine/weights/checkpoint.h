// A checkpoint of Stable Diffusion on disk: where each tensor of its networks lies, whatever the layout.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/weights/networks.h"
#include "engine/weights/safetensors.h"

namespace engine::weights {

/// A tensor of a checkpoint, as it lies in its file.
struct FoundTensor {
  StoredTensor tensor;                ///< Of the shape that was asked for.
  std::string where;                  ///< Its address, for errors: "model.safetensors:conv_in.weight".
  std::shared_ptr<const void> owner;  ///< Keeps its bytes.
};

/// A folder as diffusers writes it (unet/, vae/, text_encoder/, each with config.json and .safetensors; scheduler/,
/// tokenizer/), or one .safetensors file in the layout of the first authors. Files are mapped when they are opened;
/// tensors are looked at when they are asked for.
class Checkpoint {
 public:
  /// errors  not_found: a file of it is missing (`message` names it); those of TensorFile::open() and of the parsers of
  ///         configurations
  [[nodiscard]] static Result<Checkpoint> open(const std::filesystem::path& path);
  /// One file of networks that are not those of 1.x or 2.x-base in size.
  [[nodiscard]] static Result<Checkpoint> open_file(const std::filesystem::path& path, const Configs& configs);
  /// The same of a file that is in memory. Without configurations, those of the generation that it is of.
  [[nodiscard]] static Result<Checkpoint> of_file(TensorFile file, const std::optional<Configs>& configs = {});

  [[nodiscard]] const Configs& configs() const { return configs_; }
  /// The folder that has vocab.json and merges.txt; of one file, the folder `tokenizer` beside it.
  [[nodiscard]] const std::filesystem::path& tokenizer_folder() const { return tokenizer_folder_; }
  /// Of 2.x's text encoder, whose prompts are filled up in another way (tokenizer.h).
  [[nodiscard]] bool is_open_clip() const { return open_clip_; }

  /// A tensor of tensors_of().
  ///   errors  corrupt_data: it is missing, or of another shape; `where` is its name in the file
  [[nodiscard]] Result<FoundTensor> find(Network network, const TensorSpec& spec) const;
  /// Are all tensors of all networks there, in their shapes? Their numbers are not looked at.
  [[nodiscard]] Result<void> check() const;
  /// Of all tensors of all networks and of the folder's configurations. Reads every number, as loading them does.
  ///   errors  those of find()
  [[nodiscard]] Result<std::string> digest() const;

 private:
  Configs configs_;
  std::string configs_digest_;  ///< Of a folder's files of them.
  std::filesystem::path tokenizer_folder_;
  bool single_ = false;  ///< One file in the original layout; its networks share files_[0].
  bool open_clip_ = false;
  std::vector<TensorFile> files_;  ///< Of unet, autoencoder, text encoder.
};

}  // namespace engine::weights
