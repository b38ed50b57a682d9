// The corrector `sd`: Stable Diffusion, fine-tuned on the edit's history, repaints what lies within the masks.
// Source: 3DGS-Drag (ICLR 2025), sections 3.4 and 4.1; Ruiz et al. 2023, "DreamBooth" (one prompt for a scene); Hu et
// al. 2021, "LoRA".
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/correct/repainter.h"
#include "engine/diffusion/stable_diffusion.h"
#include "engine/scene/image.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

/// Of requests that give none: a word that means nothing, which fine-tuning gives the scene for a meaning (DreamBooth).
constexpr const char* default_prompt = "a photo of sks scene";

struct RepainterOptions {
  std::string prompt = default_prompt;  ///< Of training and painting alike.
  std::string negative_prompt = {};
  double guidance = 7.5;                             ///< 1 to 100; 1 halves the time of painting.
  SamplerOptions sampling = {Sampler::dpmpp2m, 20};  ///< Its strength is that of each call.
  int rank = 4;                                      ///< Of the adapter, 1 to 256; its scale is 1.
  int batch = 4;                                     ///< Pictures of a step of training, 1 to 64.
  double learning_rate = 1e-4;                       ///< Of AdamW.
  int threads = 0;                                   ///< Of libtorch; 0: as many as it takes by itself.
};
/// errors  invalid_argument; `where` names the option
[[nodiscard]] Result<void> validate(const RepainterOptions& options, const weights::NoiseConfig& noise);

/// The part of a picture that the networks see, and in what size.
struct Crop {
  scene::Rect part;
  int width = 0, height = 0;  ///< Pixels for the networks.
  bool operator==(const Crop&) const = default;
};
/// A box with some of what is around it, its longer side as long as the networks have learned to see. A small box is
/// shown with more around it: it is magnified four times at most.
///   box       not empty, inside the picture
///   side      pixels of the longer side for the networks
///   multiple  of which both are
[[nodiscard]] Crop crop_around(scene::Rect box, int picture_width, int picture_height, int side, int multiple);

/// What a repainter takes on one thread of the machine of docs/stable-diffusion.md, seconds; from the sizes of the
/// networks alone.
struct RepainterSeconds {
  double training_step = 0;
  double picture = 0;        ///< Whatever the strength.
  double full_strength = 0;  ///< Besides, at strength 1.
};
[[nodiscard]] RepainterSeconds seconds_of(const weights::Configs& configs, const RepainterOptions& options);

/// What it takes of memory, bytes; from the sizes of the networks alone.
struct RepainterBytes {
  std::uint64_t networks = 0;  ///< With the adapter and its optimiser.
  std::uint64_t painting = 0;  ///< Besides, while it paints,
  std::uint64_t learning = 0;  ///< and while it learns.
};
[[nodiscard]] RepainterBytes bytes_of(const weights::Configs& configs, const RepainterOptions& options);

/// Same seeds, same bytes, at a fixed number of libtorch's threads.
class StableDiffusionRepainter final : public correct::Repainter {
 public:
  /// errors  those of validate()
  [[nodiscard]] static Result<std::unique_ptr<StableDiffusionRepainter>> create(StableDiffusion model,
                                                                                const RepainterOptions& options);
  ~StableDiffusionRepainter() override;

  /// Pictures are seen whole, or as they are when they are repainted, as often the one as the other.
  ///   errors  those of `advance`, which is asked before each picture of a batch and each block of a network, on the
  ///           way back too; those of Tokenizer::encode(); internal: a loss or a gradient is not finite; too_large
  [[nodiscard]] Result<void> fine_tune(std::span<const correct::HistoryPicture> history, int steps, std::uint64_t seed,
                                       const correct::Advance& advance) override;
  /// Each picture by itself, cut out around its mask.
  ///   errors  those of StableDiffusion::repaint()
  [[nodiscard]] Result<std::vector<scene::Image>> repaint(std::span<const correct::RepaintTask> tasks, double strength,
                                                          std::uint64_t seed, const correct::Advance& advance) override;
  /// The adapter and its optimiser, as safetensors, without tensors as long as nothing was learned; and a digest of the
  /// model.
  [[nodiscard]] std::string state() const override;
  /// errors  as of Repainter; conflict: the model is not that of then
  [[nodiscard]] Result<void> restore(std::string_view state) override;

 private:
  struct Learned;
  StableDiffusionRepainter(StableDiffusion model, const RepainterOptions& options);
  /// Pixels of the longer side of what the networks are shown.
  [[nodiscard]] int side() const;
  /// libtorch keeps the number of its threads for each thread that calls it.
  void use_threads() const;

  StableDiffusion model_;
  RepainterOptions options_;
  std::unique_ptr<Learned> learned_;  ///< Null: nothing.
};

}  // namespace engine::diffusion
