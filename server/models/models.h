// Pre-trained networks below the model folder (--model-dir): which there are, and what edits use of them.
//   DIR/stable-diffusion/              a checkpoint of Stable Diffusion 1.x or 2.x-base as diffusers writes it, or
//   DIR/stable-diffusion.safetensors   one in the first authors' layout, with DIR/tokenizer/
//   DIR/lora/NAME.safetensors          adapters of low rank for it, or folders DIR/lora/NAME/ as they are published
//   DIR/lpips/vgg16.safetensors        VGG16 of torchvision
//   DIR/lpips/vgg_v0.1.safetensors     LPIPS's own weights
// docs/stable-diffusion.md says where they come from.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/repainter.h"
#include "engine/optim/perceptual.h"
#include "engine/params/params.h"

namespace server::models {

using engine::Result;

/// What was found of one model.
struct Finding {
  std::string name;  ///< As a request names it: "sd", "lpips"; of an adapter "lora NAME".
  bool usable = false;
  std::string message;  ///< Of a usable one: what it is. Else what is missing and where it goes; names folders.
  bool absent = false;  ///< None of its files is there.
};

/// What a repainter is asked for beside the parameters.
struct Wishes {
  std::string prompt = {};           ///< Empty: diffusion::default_prompt.
  std::string negative_prompt = {};  ///< What should not be seen.
  std::string lora = {};             ///< The adapter that it paints with, one of Models::loras(). Empty: none.
};

/// What a repainter takes on this machine as it usually is; guessed from the sizes of the networks.
struct RepainterCost {
  double training_step = 0, picture = 0, full_strength = 0;  ///< Seconds, as in diffusion::RepainterSeconds.
  std::uint64_t network_bytes = 0, painting_bytes = 0, learning_bytes = 0;  ///< As in diffusion::RepainterBytes.
};

/// The same of the loss `lpips`.
struct PerceptualCost {
  double pixel_seconds = 0;  ///< Of an evaluation with its gradient, for each pixel of the pictures.
  std::uint64_t network_bytes = 0, pixel_bytes = 0;
};

/// What an edit's models take.
struct Costs {
  std::optional<RepainterCost> repainter;    ///< Null: there is none.
  std::optional<PerceptualCost> perceptual;  ///< Null: the engine's own loss, which is no network.
};

/// Looks at the folder once. Safe to use from several threads; what it makes is for one.
class Models {
 public:
  ///   folder   empty: there is none
  ///   threads  of libtorch; 0: as many as it takes by itself
  explicit Models(std::filesystem::path folder = {}, int threads = 0);

  /// Why an edit cannot have it, in words for clients: they name no folder of this machine. Empty: it can.
  [[nodiscard]] const std::string& no_sd() const { return no_sd_; }
  [[nodiscard]] const std::string& no_lpips() const { return no_lpips_; }
  /// Names of the adapters that `sd` can paint with, ascending.
  [[nodiscard]] std::vector<std::string> loras() const;
  /// Each model, for who installs them. Their files were opened, and every tensor's shape was looked at; of adapters
  /// the numbers as well.
  [[nodiscard]] const std::vector<Finding>& findings() const { return findings_; }

  /// The corrector `sd`. The networks are opened when they are first asked for, and shared from then on.
  ///   params  guidance, sampler and the like
  ///   errors  unsupported: no_sd(), or no such adapter ("lora"); those of StableDiffusion::open(), of read_adapter()
  ///           and of diffusion::validate()
  [[nodiscard]] Result<std::unique_ptr<engine::correct::Repainter>> repainter(const engine::params::Params& params,
                                                                              const Wishes& wishes) const;
  /// What that will take. Zero where there is none.
  ///   lora  of the wishes
  [[nodiscard]] RepainterCost cost(const engine::params::Params& params, const std::string& lora) const;
  /// The loss `lpips`. Its files are read each time.
  ///   errors  unsupported: no_lpips(); those of weights::LpipsFiles::open() and Lpips::create()
  [[nodiscard]] Result<std::unique_ptr<engine::optim::PerceptualLoss>> lpips() const;
  /// What that will take. Zero where there is none.
  [[nodiscard]] PerceptualCost lpips_cost() const;

 private:
  struct Loaded;
  [[nodiscard]] static bool has_libtorch();
  [[nodiscard]] static std::shared_ptr<Loaded> nothing_loaded();

  /// An adapter that can be used.
  struct Lora {
    std::filesystem::path file;
    std::uint64_t bytes = 0;  ///< In memory.
  };

  void look_at_adapters();

  std::filesystem::path folder_, checkpoint_;
  std::map<std::string, Lora> loras_;  ///< By name.
  int threads_;
  std::string no_sd_, no_lpips_;
  std::vector<Finding> findings_;
  std::shared_ptr<Loaded> loaded_;  ///< Networks, once they are asked for.
};

}  // namespace server::models
