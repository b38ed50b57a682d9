// Trains a tiny latent diffusion model from nothing on pictures of made-up rooms, so that the corrector `sd` can be
// tried where no weights are to be had. What it writes is a folder as `--model-dir` has it:
//
//   OMP_NUM_THREADS=1 build/release/bench/tiny_diffusion --out models --minutes 60
//   OMP_NUM_THREADS=1 build/release/bench/repaint_quality --model models/stable-diffusion
//   build/release/splatdrag bench-edit --model-dir models --corrector none --corrector sd --out out
//
// The rooms it learns from hold things of engine/procedural in arrangements of their own; neither the demo scene nor a
// case of bench-edit is among them. All share materials, shapes and the way they are rendered: what was learned here
// knows nothing of other pictures.
#include <ATen/Parallel.h>
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bench/or_exit.h"
#include "engine/core/rng.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/pretraining.h"
#include "engine/diffusion/repainter.h"
#include "engine/evaluate/measure.h"
#include "engine/evaluate/studio.h"
#include "engine/procedural/demo_scene.h"
#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"
#include "engine/procedural/surfels.h"
#include "engine/scene/image.h"
#include "engine/weights/networks.h"

namespace {

namespace diffusion = engine::diffusion;
namespace evaluate = engine::evaluate;
namespace procedural = engine::procedural;
namespace scene = engine::scene;
namespace weights = engine::weights;
using bench::or_exit;
using engine::Rng;
using engine::Vec3;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string out;
  double minutes = 60;
  double autoencoder_share = 0.3;  // of the minutes
  int autoencoder_steps = 0, unet_steps = 0;
  int rooms = 20, views = 10;
  int batch = 4, side = 64;
  double save_minutes = 3;
  std::uint64_t seed = 1;
};

Vec3 any_colour(Rng& rng) {
  const auto level = [&] { return 30 + int(rng.below(211)); };
  const int red = level(), green = level(), blue = level();  // one after the other: arguments have no order
  return procedural::srgb(red, green, blue);
}

/// A thing on the table, or hanging over it.
std::vector<procedural::Object> any_thing(Rng& rng, std::uint64_t seed) {
  // What is drawn has a name or stands in braces, which have an order, as the arguments of a function do not.
  const float x = rng.uniform(-1.5f, 1.5f), y = rng.below(4) == 0 ? -rng.uniform(0, 0.6f) : 0.0f,
              z = rng.uniform(-0.85f, 0.85f);
  const procedural::Placement place{{x, y, z}, rng.uniform(0, 6.28f)};
  switch (rng.below(8)) {
    case 0: {
      const float radius = rng.uniform(0.14f, 0.32f);
      const Vec3 one = any_colour(rng), other = any_colour(rng);
      return {procedural::make_ball(place, radius, one, other)};
    }
    case 1:
      return {procedural::make_mug(place)};
    case 2:
      return {procedural::make_apple(place, rng.uniform(0.12f, 0.2f))};
    case 3: {
      const float width = rng.uniform(0.5f, 1.0f), height = rng.uniform(0.08f, 0.2f), depth = rng.uniform(0.4f, 0.7f);
      return {procedural::make_book(place, {width, height, depth}, any_colour(rng))};
    }
    case 4: {
      procedural::Plant plant = procedural::make_plant(place, 12 + int(rng.below(24)), seed);
      return {procedural::make_pot(place), std::move(plant.object)};
    }
    case 5: {
      std::vector<procedural::Object> rings;
      const Vec3 one = any_colour(rng), other = any_colour(rng);
      const float radius = rng.uniform(0.07f, 0.16f), height = rng.uniform(0.06f, 0.14f);
      const int count = 3 + int(rng.below(6));
      for (int k = 0; k < count; ++k) {
        procedural::Placement at = place;
        at.position.y -= float(k) * height;
        rings.push_back({"ring",
                         at,
                         {procedural::lathe({{radius, 0}, {radius, height}, {0, height}},
                                            procedural::plain(k % 2 == 0 ? one : other, 0.1f), 2.0f, 40)}});
      }
      return rings;
    }
    default: {
      const Vec3 size{rng.uniform(0.15f, 0.6f), rng.uniform(0.12f, 0.5f), rng.uniform(0.15f, 0.6f)};
      const procedural::Material material =
          rng.below(3) == 0 ? procedural::plain(any_colour(rng), 0.1f) : procedural::cloth_cover(any_colour(rng));
      return {{"crate", place, procedural::box({0, 0, 0}, size, material, 2)}};
    }
  }
}

/// Pictures of a room that nobody else has.
std::vector<scene::Image> pictures_of_room(const Options& options, int room) {
  Rng rng(options.seed, 1000 + std::uint64_t(room));
  const std::uint64_t seed = options.seed * 1000 + std::uint64_t(room);
  std::vector<procedural::Object> objects{procedural::make_room(-1.5f), procedural::make_table({}, {3.7f, 1.5f, 2.1f})};
  for (std::uint32_t prints = rng.below(3); prints > 0; --prints) {
    const float x = rng.uniform(-1.3f, 1.3f), y = -rng.uniform(0.7f, 1.7f);
    const float width = rng.uniform(0.8f, 1.6f), height = rng.uniform(0.6f, 1.1f);
    objects.push_back(procedural::make_framed_print({{x, y, 1.4f}, 0}, width, height));
  }
  for (int things = 5 + int(rng.below(5)); things > 0; --things)
    for (procedural::Object& object : any_thing(rng, seed)) objects.push_back(std::move(object));
  const procedural::Light light =
      room % 2 == 0 ? evaluate::studio_light() : procedural::make_still_life(0).light;  // even, or sun by a window
  const auto cameras = procedural::make_arc_cameras(options.views, 240, 180);
  const procedural::Surfels surfels = procedural::make_surfels(objects, light, cameras, 40'000, seed);
  std::vector<scene::Image> pictures;
  for (const scene::Camera& camera : cameras) pictures.push_back(evaluate::picture(surfels.cloud, camera));
  return pictures;
}

/// A square of a picture, magnified by more than two or made smaller by as much, mirrored half the time.
scene::Image any_crop(const std::vector<scene::Image>& pictures, int side, Rng& rng) {
  const scene::Image& picture = pictures[rng.below(std::uint32_t(pictures.size()))];
  const int most = std::min({picture.width, picture.height, side * 8 / 3}), least = std::min(side * 3 / 8, most);
  const int size = int(std::lround(least * std::pow(double(most) / least, double(rng.uniform()))));
  const int x = int(rng.below(std::uint32_t(picture.width - size + 1))),
            y = int(rng.below(std::uint32_t(picture.height - size + 1)));
  scene::Image crop = diffusion::resized(scene::cut_out(picture, {x, y, x + size, y + size}), side, side);
  if (rng.below(2) == 0)
    for (auto row = crop.data.begin(); row != crop.data.end(); row += side) std::reverse(row, row + side);
  return crop;
}

std::vector<scene::Image> any_crops(const std::vector<scene::Image>& pictures, int count, int side, Rng rng) {
  std::vector<scene::Image> crops;
  for (int k = 0; k < count; ++k) crops.push_back(any_crop(pictures, side, rng));
  return crops;
}

/// Networks that learn something in an hour on one thread. Two pixels a latent: with four, what the autoencoder
/// loses of a picture is more than most tears take from it.
weights::Configs tiny_configs(const Options& options) {
  weights::Configs configs = weights::stable_diffusion_1();
  configs.unet.channels = {32, 64, 96};
  configs.unet.heads = {2, 4, 4};
  configs.unet.down_attends = {false, false, true};
  configs.unet.up_attends = {true, false, false};
  configs.unet.layers_per_block = 1;
  configs.unet.context_width = 32;
  configs.unet.norm_groups = 8;
  configs.autoencoder.channels = {16, 32};
  configs.autoencoder.layers_per_block = 1;
  configs.autoencoder.norm_groups = 8;
  configs.autoencoder.scaling_factor = 1;  // until it is measured
  // Edits show the networks pictures twice as long as what they learn from: what shrinks on its way to them is lost,
  // and convolutions do not mind the size.
  configs.unet.sample_side = 2 * options.side / configs.autoencoder.pixels_per_latent();
  configs.text_encoder.width = 32;
  configs.text_encoder.feed_forward_width = 64;
  configs.text_encoder.layers = 2;
  configs.text_encoder.heads = 2;
  configs.text_encoder.vocabulary = 514;  // bytes, the same at the end of a word, and two marks
  return configs;
}

/// How far a phase of the training is, 0 to 1, by its steps or by the clock.
class Pace {
 public:
  Pace(int steps, double minutes) : steps_(steps), seconds_(60 * minutes), begin_(Clock::now()) {}
  [[nodiscard]] double part(int step) const {
    if (steps_ > 0) return std::min(1.0, double(step) / steps_);
    return std::min(1.0, std::chrono::duration<double>(Clock::now() - begin_).count() / seconds_);
  }

 private:
  int steps_;
  double seconds_;
  Clock::time_point begin_;
};

/// Up to `most` over the first steps, and down to a fiftieth of it along half a cosine.
double learning_rate(double most, int step, double part) {
  constexpr double warm_up = 50;
  return most * std::min(1.0, (step + 1) / warm_up) * (0.02 + 0.98 * 0.5 * (1 + std::cos(3.14159265358979 * part)));
}

double mean_square(const scene::Image& a, const scene::Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) sum += std::pow(double(a.data[i]) - double(b.data[i]), 2);
  return sum / double(a.data.size());
}

class Training {
 public:
  explicit Training(const Options& options)
      : options_(options),
        model_(or_exit(diffusion::Pretraining::begin(tiny_configs(options),
                                                     {.prompt = diffusion::default_prompt, .seed = options.seed}))) {
    for (int room = 0; room < options.rooms; ++room) {
      for (scene::Image& picture : pictures_of_room(options, room)) pictures_.push_back(std::move(picture));
      say("room %d of %d\n", room + 1, options.rooms);
    }
    const auto demo = procedural::make_demo_scene({.gaussians = 40'000, .views = 6, .width = 240, .height = 180});
    std::vector<scene::Image> views;
    for (const scene::Camera& camera : demo.cameras) views.push_back(evaluate::picture(demo.cloud, camera));
    unseen_ = any_crops(views, 24, options.side, Rng(options.seed, 5));
  }

  void run() {
    const double share = options_.autoencoder_share;
    phase("autoencoder", Pace(options_.autoencoder_steps, share * options_.minutes), [&](int step, double part) {
      const auto loss = or_exit(model_.autoencoder_step(crops(2, step, part), learning_rate(2e-3, step, part)));
      if (!reports()) return;
      double error = 0;
      for (const scene::Image& crop : unseen_)
        error += mean_square(or_exit(model_.through_autoencoder(crop)), crop) / double(unseen_.size());
      say("autoencoder %6d, %5.1f %%: absolute %.4f, divergence %.2f; unseen %.2f dB\n", step, 100 * part,
          loss.absolute, loss.divergence, -10 * std::log10(error));
    });
    say("scaling factor %.5f\n", or_exit(model_.scale_latents(any_crops(pictures_, 128, options_.side, Rng(3)))));
    phase("unet", Pace(options_.unet_steps, (1 - share) * options_.minutes), [&](int step, double part) {
      const double loss = or_exit(model_.unet_step(crops(4, step, part), learning_rate(1e-3, step, part)));
      mean_ = step == 0 ? loss : 0.98 * mean_ + 0.02 * loss;
      if (!reports()) return;
      say("unet %6d, %5.1f %%: loss %.4f; unseen %.4f\n", step, 100 * part, mean_,
          or_exit(model_.unet_loss(unseen_, 0)));
    });
  }

 private:
  template <class... Numbers>
  void say(const char* format, Numbers... numbers) const {
    std::printf("%6.1f min  ", std::chrono::duration<double>(Clock::now() - begin_).count() / 60);
    std::printf(format, numbers...);
    std::fflush(stdout);
  }
  /// The first seven tenths of a phase see twice as many crops of half the side, in half the time: most of what is to
  /// be learned is small.
  [[nodiscard]] std::vector<scene::Image> crops(std::uint64_t stream, int step, double part) const {
    const int smaller = part < 0.7 ? 2 : 1;
    return any_crops(pictures_, options_.batch * smaller, options_.side / smaller,
                     Rng(options_.seed + stream, (std::uint64_t{1} << 32) + std::uint64_t(step)));
  }
  bool reports() {
    if (Clock::now() - reported_ < std::chrono::minutes(1)) return false;
    reported_ = Clock::now();
    return true;
  }
  void phase(const char* name, const Pace& pace, const std::function<void(int step, double part)>& step) {
    auto saved = Clock::now();
    int taken = 0;
    for (double part = 0; (part = pace.part(taken)) < 1; ++taken) {
      step(taken, part);
      if (std::chrono::duration<double>(Clock::now() - saved).count() < 60 * options_.save_minutes) continue;
      save();
      saved = Clock::now();
    }
    save();
    say("%s: %d steps\n", name, taken);
  }
  void save() const { or_exit(model_.write(std::filesystem::path(options_.out) / "stable-diffusion")); }

  Options options_;
  Clock::time_point begin_ = Clock::now(), reported_ = begin_;
  diffusion::Pretraining model_;
  std::vector<scene::Image> pictures_, unseen_;
  double mean_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  int threads = 1;
  CLI::App program("Trains a tiny latent diffusion model on pictures of made-up rooms.");
  program.add_option("--out", options.out, "Folder of models, as --model-dir names it")->required();
  program.add_option("--minutes", options.minutes, "How long, beside the making of the rooms")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program.add_option("--autoencoder-share", options.autoencoder_share, "Of those, for the autoencoder")
      ->check(CLI::Range(0.01, 0.99))
      ->capture_default_str();
  program
      .add_option("--autoencoder-steps", options.autoencoder_steps,
                  "In place of minutes: same steps, seed and --threads, same bytes")
      ->check(CLI::NonNegativeNumber);
  program.add_option("--unet-steps", options.unet_steps, "In place of minutes")->check(CLI::NonNegativeNumber);
  program.add_option("--rooms", options.rooms, "To learn from")->check(CLI::PositiveNumber)->capture_default_str();
  program.add_option("--views", options.views, "Of each room")->check(CLI::PositiveNumber)->capture_default_str();
  program.add_option("--batch", options.batch, "Pictures of a step; twice as many as long as they are small")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program.add_option("--side", options.side, "Pixels along a side of a picture, a multiple of 16")
      ->check(CLI::Range(16, 512))
      ->check(CLI::Validator(
          [](std::string& text) { return std::stoi(text) % 16 == 0 ? std::string() : "expected a multiple of 16"; },
          "MULTIPLE OF 16"))
      ->capture_default_str();
  program.add_option("--save-minutes", options.save_minutes, "Between two writings of the checkpoint")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program
      .add_option("--seed", options.seed,
                  "Of all that is left to chance; the same one gives the same bytes with the same --threads")
      ->capture_default_str();
  program.add_option("--threads", threads, "Of libtorch")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(program, argc, argv);
  at::set_num_threads(threads);
  // What a step allocates comes back at the next: given back to the system in between, it would be cleared each time,
  // a fifth of all time.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 2'000'000'000);
  Training(options).run();
}
