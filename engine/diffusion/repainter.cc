#include "engine/diffusion/repainter.h"

#include <ATen/Parallel.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/full.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <tuple>
#include <utility>

#include "engine/core/rng.h"
#include "engine/diffusion/adapter.h"
#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/going.h"
#include "engine/diffusion/guard.h"
#include "engine/diffusion/networks.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/training.h"

namespace engine::diffusion {
namespace {

// Of the longer side of a box, on each side: what is around tells what belongs there. A choice.
constexpr double margin = 0.125;
constexpr int least_margin_px = 8;  // a choice
constexpr int most_magnified = 4;   // a choice
// Seeds of a call: a step of training each from the one that is given; of a new adapter the last of its million.
constexpr std::uint64_t seed_of_adapter = 999'999;
const std::vector<std::string> targets{"to_q", "to_k", "to_v", "to_out.0"};  // as in the released code
constexpr const char *steps_key = "optimiser_steps", *model_key = "model";   // of a state's metadata

// Seconds at the size of 1.5, 512 x 512 pixels, and what is computed there takes beside the networks:
// docs/stable-diffusion.md. Both go with the pixels; attention's share of them, which goes with their square, is small
// as long as it is cut into slices, and in training as long as transformers are computed again.
constexpr double measured_parameters = 859.5e6, measured_latents = 64 * 64;
constexpr double call_seconds = 10.1, guided_call_seconds = 17, training_seconds = 29, autoencoder_seconds = 25;
constexpr double measured_width = 320, measured_autoencoder_width = 128;  // of their first layers
constexpr double painting_bytes = 1.3e9, learning_bytes = 1.7e9;
// Of each number of an adapter: itself, its gradient, two moments; and copies while a checkpoint is made of them.
constexpr std::uint64_t adapter_copies = 16;

/// `low` to `high` with more on either side until it is `least` long, as far as there is room from 0 to `most`.
std::pair<int, int> widened(int low, int high, int least, int most) {
  least = std::min(least, most);
  if (high - low < least) low -= (least - (high - low)) / 2, high = low + least;
  if (low < 0) high -= low, low = 0;
  if (high > most) low -= high - most, high = most;
  return {std::max(low, 0), high};
}

int nearest_multiple(double value, int multiple) {
  return std::max(multiple, int(std::lround(value / multiple)) * multiple);
}

double numbers_in(const weights::TensorSpec& tensor) {
  double count = 1;
  for (const std::int64_t size : tensor.shape) count *= double(size);
  return count;
}

double latents_of(const weights::Configs& configs) {
  const double side = double(weights::picture_side(configs)) / configs.autoencoder.pixels_per_latent();
  return side * side;
}

tl::unexpected<Error> of_another(const std::string& what) {
  return fail(ErrorCode::invalid_argument, "what was learned is of another model or rank: " + what, "checkpoint");
}

}  // namespace

/// The adapter, and how far its training is.
struct StableDiffusionRepainter::Learned {
  Adapter adapter;
  std::vector<Tensor> trained;
  AdamW optimiser;

  Learned(Adapter fresh, const RepainterOptions& options)
      : adapter(std::move(fresh)),
        trained(tensors_of(adapter)),
        optimiser(trained, {.learning_rate = options.learning_rate}) {}

 private:
  static std::vector<Tensor> tensors_of(const Adapter& adapter) {
    std::vector<Tensor> tensors;
    adapter.collect(tensors);
    return tensors;
  }
};

Result<void> validate(const RepainterOptions& options, const weights::NoiseConfig& noise) {
  const auto refused = [](const char* option, const char* expected) {
    return fail(ErrorCode::invalid_argument, std::string("expected ") + expected, option);
  };
  if (options.rank < 1 || options.rank > 256) return refused("rank", "1 to 256");
  if (options.batch < 1 || options.batch > 64) return refused("batch", "1 to 64");
  if (auto valid = validate(AdamWOptions{.learning_rate = options.learning_rate}); !valid) return valid;
  return validate(RepaintOptions{.guidance = options.guidance, .sampling = options.sampling}, noise);
}

Crop crop_around(scene::Rect box, int picture_width, int picture_height, int side, int multiple) {
  const int longer = std::max(box.width(), box.height());
  const int more = std::max(least_margin_px, int(std::lround(margin * longer)));
  const int least = side / most_magnified;
  Crop crop;
  std::tie(crop.part.x0, crop.part.x1) =
      widened(std::max(box.x0 - more, 0), std::min(box.x1 + more, picture_width), least, picture_width);
  std::tie(crop.part.y0, crop.part.y1) =
      widened(std::max(box.y0 - more, 0), std::min(box.y1 + more, picture_height), least, picture_height);
  const double scale = double(side) / std::max(crop.part.width(), crop.part.height());
  crop.width = nearest_multiple(scale * crop.part.width(), multiple);
  crop.height = nearest_multiple(scale * crop.part.height(), multiple);
  return crop;
}

RepainterSeconds seconds_of(const weights::Configs& configs, const RepainterOptions& options) {
  double parameters = 0;
  for (const weights::TensorSpec& tensor : weights::tensors_of(configs.unet)) parameters += numbers_in(tensor);
  const double size = parameters / measured_parameters * latents_of(configs) / measured_latents;
  return {
      .training_step = size * options.batch * training_seconds,
      .picture = size * autoencoder_seconds,
      .full_strength = size * options.sampling.steps * (options.guidance != 1 ? guided_call_seconds : call_seconds)};
}

RepainterBytes bytes_of(const weights::Configs& configs, const RepainterOptions& options) {
  double networks = 0, adapter = 0;
  for (const auto network : {weights::Network::unet, weights::Network::autoencoder, weights::Network::text_encoder})
    for (const weights::TensorSpec& tensor : weights::tensors_of(configs, network)) networks += numbers_in(tensor);
  for (const weights::TensorSpec& tensor : weights::tensors_of(configs.unet))
    if (std::ranges::any_of(targets, [&](const auto& target) { return tensor.name.ends_with(target + ".weight"); }))
      adapter += options.rank * double(tensor.shape[0] + tensor.shape[1]);
  const double size = latents_of(configs) / measured_latents;
  const double painting = painting_bytes * size * configs.autoencoder.channels.front() / measured_autoencoder_width;
  const double learning = learning_bytes * size * configs.unet.channels.front() / measured_width;
  const auto in_bytes = [](double bytes) { return std::uint64_t(std::llround(bytes)); };
  return {.networks = in_bytes(sizeof(float) * (networks + adapter_copies * adapter)),
          .painting = in_bytes(painting),
          // What is learned from is encoded before.
          .learning = in_bytes(std::max(painting, learning))};
}

StableDiffusionRepainter::StableDiffusionRepainter(StableDiffusion model, const RepainterOptions& options)
    : model_(std::move(model)), options_(options) {}
StableDiffusionRepainter::~StableDiffusionRepainter() = default;

Result<std::unique_ptr<StableDiffusionRepainter>> StableDiffusionRepainter::create(StableDiffusion model,
                                                                                   const RepainterOptions& options) {
  if (auto valid = validate(options, model.configs().noise); !valid) return propagate(valid);
  return std::unique_ptr<StableDiffusionRepainter>(new StableDiffusionRepainter(std::move(model), options));
}

int StableDiffusionRepainter::side() const { return weights::picture_side(model_.configs()); }

void StableDiffusionRepainter::use_threads() const {
  if (options_.threads > 0) at::set_num_threads(options_.threads);
}

Result<void> StableDiffusionRepainter::fine_tune(std::span<const correct::HistoryPicture> history, int steps,
                                                 std::uint64_t seed, const correct::Advance& advance) {
  if (steps <= 0 || history.empty()) return {};
  const StableDiffusion::Networks& networks = model_.networks();
  const weights::Configs& configs = networks.configs;
  auto tuned = guarded("fine_tune", [&]() -> Result<void> {
    use_threads();
    if (!learned_)
      learned_ = std::make_unique<Learned>(Adapter::fresh(weights::tensors_of(configs.unet), targets, options_.rank,
                                                          options_.rank, seed + seed_of_adapter),
                                           options_);
    Going going(advance);
    const Model autoencoder{.parameters = networks.autoencoder, .before_block = going.asked()};
    // Without an adapter of the model's own: one that was distilled to take few steps would be taught to take many.
    const Model unet{.parameters = networks.unet, .adapters = {learned_->adapter}, .before_block = going.asked()};
    Result<Tensor> context = fail(ErrorCode::internal, "");
    {
      const at::NoGradGuard no_gradients;
      context = networks.context_of(options_.prompt, "prompt", {});
    }
    if (!context) return propagate(context);
    // A picture is encoded when it is first drawn: 50 views of 1.5's size are 13 MB of moments, and hours less.
    std::map<std::pair<std::size_t, bool>, Tensor> known;
    const auto moments_of = [&](std::size_t k, bool whole) -> const Tensor& {
      auto [place, is_new] = known.try_emplace({k, whole});
      if (!is_new) return place->second;
      const at::NoGradGuard no_gradients;
      const correct::HistoryPicture& example = history[k];
      const scene::Image picture = correct::as_image(example.picture);
      const scene::Rect box = whole ? scene::Rect{0, 0, picture.width, picture.height} : example.box;
      const Crop crop = crop_around(box, picture.width, picture.height, side(), model_.side_multiple());
      const scene::Image shown = resized(scene::cut_out(picture, crop.part), crop.width, crop.height);
      return place->second = encode_moments(autoencoder, configs.autoencoder, as_tensor(shown));
    };
    for (int step = 0; step < steps; ++step) {
      double loss = 0;
      learned_->optimiser.clear_gradients();
      for (int k = 0; k < options_.batch; ++k) {
        if (auto begun = going.at((step + double(k) / options_.batch) / steps); !begun) return begun;
        Rng rng(seed + std::uint64_t(step), std::uint64_t(k));
        const std::size_t drawn = rng.below(std::uint32_t(history.size()));
        const bool whole = rng.uniform() < 0.5f || history[drawn].box.empty();
        const Tensor& moments = moments_of(drawn, whole);
        const Tensor timestep =
            at::full({1}, std::int64_t(rng.below(std::uint32_t(configs.noise.training_steps))), at::kLong);
        const Tensor latents = sample_latents(configs.autoencoder, moments, rng);
        const Tensor noise = normal_numbers(latents.sizes(), rng);
        const auto added = add_gradient(unet, configs, {&latents, &noise, &timestep, &*context}, 1.0 / options_.batch);
        if (!added) return propagate(added);
        loss += *added / options_.batch;
      }
      if (auto stepped = take_step(learned_->optimiser, loss); !stepped) return stepped;
    }
    return {};
  });
  if (!tuned) return tuned;
  return model_.adapt({learned_->adapter.layers(), {}});
}

Result<std::vector<scene::Image>> StableDiffusionRepainter::repaint(std::span<const correct::RepaintTask> tasks,
                                                                    double strength, std::uint64_t seed,
                                                                    const correct::Advance& advance) {
  return guarded("repaint", [&]() -> Result<std::vector<scene::Image>> {
    use_threads();
    std::vector<scene::Image> out;
    RepaintOptions options{options_.prompt, options_.negative_prompt, options_.guidance, options_.sampling};
    options.sampling.strength = strength;
    for (const correct::RepaintTask& task : tasks) {
      options.seed = derived_seed(seed, {std::uint32_t(out.size()), 0, 0, 0});
      const auto within = [&](double part) -> Result<void> {
        return advance ? advance((double(out.size()) + part) / double(tasks.size())) : Result<void>{};
      };
      const Crop crop = crop_around(scene::bounding_box(task.mask), task.picture.width, task.picture.height, side(),
                                    model_.side_multiple());
      const scene::Image shown = resized(scene::cut_out(task.picture, crop.part), crop.width, crop.height);
      const auto painted = model_.repaint(shown, options, within);
      if (!painted) return propagate(painted);
      scene::Image picture = task.picture;
      scene::paste(resized(*painted, crop.part.width(), crop.part.height()), crop.part, picture);
      out.push_back(std::move(picture));
    }
    return out;
  });
}

std::string StableDiffusionRepainter::state() const {
  const std::string& model = model_.digest();
  if (!learned_) return weights::encode_tensors({}, {{model_key, model}});
  std::map<std::string, weights::FloatTensor> tensors;
  const AdamW::Moments moments = learned_->optimiser.moments();
  std::size_t k = 0;  // of the tensors that are trained: A and B of each layer, in the order of their names
  for (const auto& [layer, pair] : learned_->adapter.layers())
    for (const auto& [half, values] : {std::pair{".down", &pair.down}, {".up", &pair.up}}) {
      tensors.emplace(layer + half, *values);
      tensors.emplace(layer + half + ".mean", moments.mean[k]);
      tensors.emplace(layer + half + ".square", moments.square[k]);
      ++k;
    }
  return weights::encode_tensors(tensors, {{model_key, model}, {steps_key, std::to_string(moments.steps)}});
}

Result<void> StableDiffusionRepainter::restore(std::string_view state) {
  learned_.reset();
  std::vector<std::byte> bytes(state.size());
  std::memcpy(bytes.data(), state.data(), state.size());
  auto file = weights::TensorFile::parse(std::move(bytes), "checkpoint");
  if (!file) return fail(ErrorCode::corrupt_data, file.error().message, "checkpoint");
  const auto model = file->metadata().find(model_key);
  if (model == file->metadata().end() || model->second != model_.digest())
    return fail(ErrorCode::conflict,
                "the files of the diffusion model have changed since the edit began: what it has painted so far does "
                "not go with what they would paint; submit it again",
                "checkpoint");
  if (file->tensors().empty()) return model_.adapt({});
  return guarded("checkpoint", [&]() -> Result<void> {
    auto layers =
        Adapter::fresh(weights::tensors_of(model_.configs().unet), targets, options_.rank, options_.rank, 0).layers();
    AdamW::Moments moments;
    std::size_t expected = 0;
    for (auto& [layer, pair] : layers)
      for (const auto& [half, values] : {std::pair{".down", &pair.down}, {".up", &pair.up}})
        for (const char* part : {"", ".mean", ".square"}) {
          const std::string name = layer + half + part;
          const weights::StoredTensor* stored = file->find(name);
          if (stored == nullptr || stored->shape != values->shape) return of_another(name);
          weights::FloatTensor read{values->shape, std::vector<float>(values->values.size())};
          if (auto done = weights::read_floats(*stored, "checkpoint:" + name, read.values); !done) return done;
          ++expected;
          if (*part == 0)
            *values = std::move(read);
          else
            (part == std::string_view(".mean") ? moments.mean : moments.square).push_back(std::move(read));
        }
    if (file->tensors().size() != expected) return of_another("it has other layers, too");
    const auto steps = file->metadata().find(steps_key);
    if (steps == file->metadata().end()) return of_another(steps_key);
    const std::string& text = steps->second;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), moments.steps);
    if (error != std::errc() || end != text.data() + text.size() || moments.steps < 0) return of_another(steps_key);
    auto learned = std::make_unique<Learned>(Adapter(layers), options_);
    learned->optimiser.restore(moments);
    if (auto adapted = model_.adapt({learned->adapter.layers(), {}}); !adapted) return adapted;
    learned_ = std::move(learned);
    return {};
  });
}

}  // namespace engine::diffusion
