// Stable Diffusion on pictures: what the rest of the engine sees of the networks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/correct/repainter.h"
#include "engine/diffusion/scheduler.h"
#include "engine/scene/image.h"
#include "engine/weights/adapter_file.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

using correct::Advance;

/// Pixels of the largest picture that is repainted. The autoencoder holds several tensors of 128 channels at that size,
/// each of half a gigabyte.
constexpr std::int64_t max_repaint_pixels = std::int64_t{weights::max_picture_side} * weights::max_picture_side;

/// How a picture is repainted.
struct RepaintOptions {
  std::string prompt = {}, negative_prompt = {};
  double guidance = 7.5;  ///< 1 to 100: how much more the prompt counts than the lack of it; 1 halves the time.
  SamplerOptions sampling = {};
  std::uint64_t seed = 0;  ///< Same seed, same picture, at a fixed number of libtorch's threads.
};
/// Prompts are checked where they are taken to pieces.
///   errors  invalid_argument; `where` names the option
[[nodiscard]] Result<void> validate(const RepaintOptions& options, const weights::NoiseConfig& noise);

/// The networks of a checkpoint, with their tokenizer. Its tensors are shared by all copies, and never change; a thread
/// of its own may use each copy.
class StableDiffusion {
 public:
  /// errors  those of weights::Checkpoint::open(), weights::read_vocabulary() and Parameters::load(); corrupt_data: the
  ///         vocabulary has more pieces than the text encoder
  [[nodiscard]] static Result<StableDiffusion> open(const std::filesystem::path& path);

  /// The same networks with an adapter on them that stays, beside whatever adapt() puts on from then on: what it had
  /// put on is left off.
  ///   errors  those of weights::check_adapter(); too_large
  [[nodiscard]] Result<StableDiffusion> with(const weights::AdapterWeights& weights) const;
  /// Puts an adapter on the networks in place of the one before, or takes that off (no layers).
  ///   factor  multiplies its scales; finite
  ///   errors  those of weights::check_adapter(); invalid_argument ("factor"); too_large. The adapter of before stays
  [[nodiscard]] Result<void> adapt(const weights::AdapterWeights& weights, double factor = 1);

  /// Sides of pictures are multiples of this: 64 for Stable Diffusion 1.x and 2.x.
  [[nodiscard]] int side_multiple() const;
  [[nodiscard]] const weights::Configs& configs() const;
  /// Of all that was read of the checkpoint and of adapters that stay.
  [[nodiscard]] const std::string& digest() const { return digest_; }

  /// The picture as the prompt describes it; the less strength, the nearer to what it was. Without a step (little
  /// strength) it is given back as it is.
  ///   picture  [3], 0 to 1, sides multiples of side_multiple()
  ///   advance  asked before each call of a network, and within it before each block; may be empty
  ///   returns  of the same size, within 0 to 1
  ///   errors   invalid_argument (`where`: picture, a place in it that is not finite, or the name of an option); those
  ///            of `advance`; too_large (more than max_repaint_pixels, which is said before anything is allocated; a
  ///            prompt; memory); internal: what the networks make of it is not finite
  [[nodiscard]] Result<scene::Image> repaint(const scene::Image& picture, const RepaintOptions& options,
                                             const Advance& advance = {}) const;

  /// The picture as the autoencoder gives it back, of means, without noise: what repainting loses at any rate.
  ///   errors  those of repaint() that are the picture's; too_large (memory); internal
  [[nodiscard]] Result<scene::Image> through_autoencoder(const scene::Image& picture) const;

  struct Networks;  ///< networks.h: for this room.
  [[nodiscard]] const Networks& networks() const { return *networks_; }

 private:
  struct Adapters;
  [[nodiscard]] Result<void> check(const scene::Image& picture) const;
  std::shared_ptr<const Networks> networks_;
  std::shared_ptr<const Adapters> staying_, adapters_;  ///< The second with that of adapt().
  std::string digest_;
};

}  // namespace engine::diffusion
