// What a diffusion model makes of torn pictures whose whole is known: nearer to it, or farther?
//
//   build/release/bench/repaint_quality --model models/stable-diffusion
//
// Four things happen to the demo scene, which no model of tiny_diffusion was trained on:
//  - riddled: of its table, ball, books, apples and plant some Gaussians are lost (--lost), and the others shrink to a
//    third, so that it is full of small gaps, like what was stretched;
//  - strewn: of all things but walls and floor one Gaussian of three lies about within a few hand's breadths;
//  - frayed: of the small things two of five are lost, the others moved and stretched;
//  - carried: its ball was dragged; where it stood there is a hole, and its old shadow, as no camera has seen beneath.
// Pictures of the scene at a third of the cameras are repainted as an edit does it; with --tuning after an adapter has
// learned from pictures of what was there before, at the other cameras. Judged within the masks, against the true
// picture: the torn picture as it is; what the autoencoder makes of it, without noise and without a step, and of the
// true picture, which is what is lost at any rate; and what is repainted, by strength.
#include <ATen/Parallel.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bench/or_exit.h"
#include "engine/core/rng.h"
#include "engine/correct/repainter.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/repainter.h"
#include "engine/diffusion/stable_diffusion.h"
#include "engine/evaluate/measure.h"
#include "engine/io/image_file.h"
#include "engine/mask/mask.h"
#include "engine/procedural/demo_scene.h"
#include "engine/scene/image.h"
#include "engine/weights/networks.h"

namespace {

namespace correct = engine::correct;
namespace diffusion = engine::diffusion;
namespace evaluate = engine::evaluate;
namespace procedural = engine::procedural;
namespace scene = engine::scene;
using bench::or_exit;
using engine::DVec3;
using engine::Rng;

struct Options {
  std::string model, pictures;
  int views = 6, width = 160, height = 120;
  int threads = 1;
  double lost = 0.6, learning_rate = 1e-4;
  int sampling_steps = 20, repeats = 1;
  std::vector<int> tuning{0};
  std::vector<double> strengths{0.1, 0.2, 0.3, 0.5}, guidances{1};
};

/// A tear: what was there before, what is torn, and what it should be.
struct Tear {
  std::string name;
  scene::GaussianCloud before, torn, truth;
  std::vector<scene::Camera> cameras;
};

/// The demo scene, of which nothing is torn yet.
Tear whole(const char* name, const procedural::DemoScene& demo) {
  return {name, demo.cloud, demo.cloud, demo.cloud, demo.cameras};
}

bool is_of(const procedural::DemoScene& demo, std::size_t row, std::initializer_list<const char*> names) {
  return std::ranges::count(names, demo.object_names[demo.object[row]]) > 0;
}

procedural::DemoOptions demo_options(const Options& options) {
  return {.gaussians = 40'000, .views = options.views, .width = options.width, .height = options.height};
}

bool is_small_thing(const procedural::DemoScene& demo, std::size_t row) {
  return is_of(demo, row, {"ball", "book", "plant", "apple"});
}

Tear frayed(const Options& options) {
  const procedural::DemoScene demo = procedural::make_demo_scene(demo_options(options));
  Tear tear = whole("frayed", demo);
  scene::GaussianCloud& torn = tear.torn;
  for (std::size_t row = 0; row < torn.size(); ++row) {
    if (!is_small_thing(demo, row)) continue;
    Rng rng(1, row);
    if (rng.uniform() < 0.4f) torn.opacity_logit[row] = -20;
    for (auto* axis : {&torn.mean.x, &torn.mean.y, &torn.mean.z}) (*axis)[row] += 0.02f * rng.normal();
    for (auto* axis : {&torn.log_scale.x, &torn.log_scale.y, &torn.log_scale.z}) (*axis)[row] += 0.5f * rng.normal();
  }
  return tear;
}

Tear riddled(const Options& options) {
  const procedural::DemoScene demo = procedural::make_demo_scene(demo_options(options));
  Tear tear = whole("riddled", demo);
  scene::GaussianCloud& torn = tear.torn;
  for (std::size_t row = 0; row < torn.size(); ++row) {
    if (!is_small_thing(demo, row) && !is_of(demo, row, {"table"})) continue;
    if (Rng(2, row).uniform() < float(options.lost)) torn.opacity_logit[row] = -20;
    for (auto* axis : {&torn.log_scale.x, &torn.log_scale.y, &torn.log_scale.z}) (*axis)[row] -= std::log(3.0f);
  }
  return tear;
}

Tear strewn(const Options& options) {
  const procedural::DemoScene demo = procedural::make_demo_scene(demo_options(options));
  Tear tear = whole("strewn", demo);
  scene::GaussianCloud& torn = tear.torn;
  for (std::size_t row = 0; row < torn.size(); ++row) {
    Rng rng(3, row);
    if (is_of(demo, row, {"room"}) || rng.uniform() >= 0.33f) continue;
    for (auto* axis : {&torn.mean.x, &torn.mean.y, &torn.mean.z}) (*axis)[row] += 0.25f * rng.normal();
  }
  return tear;
}

Tear carried(const Options& options) {
  procedural::DemoOptions moved = demo_options(options);
  const procedural::DemoScene demo = procedural::make_demo_scene(moved);
  moved.ball_shift = DVec3(0.8, 0, -0.08);
  Tear tear = whole("carried", demo);
  tear.truth = procedural::make_demo_scene(moved).cloud;
  for (std::size_t row = 0; row < tear.torn.size(); ++row) {
    if (!is_of(demo, row, {"ball"})) continue;
    tear.torn.mean.x[row] += float(moved.ball_shift.x);
    tear.torn.mean.y[row] += float(moved.ball_shift.y);
    tear.torn.mean.z[row] += float(moved.ball_shift.z);
  }
  return tear;
}

/// Pixels that are visibly wrong, and what is next to them.
scene::Mask mask_of(const scene::Image& torn, const scene::Image& truth) {
  constexpr float visible = 8 / 255.0f;
  scene::Mask mask(torn.width, torn.height);
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < torn.pixels(); ++i)
      if (std::abs(torn.plane(c)[i] - truth.plane(c)[i]) > visible) mask.data[i] = 1;
  return engine::mask::dilate(mask, 2);
}

struct Judged {
  scene::Image truth;
  correct::RepaintTask task;
};

void print(const std::string& tear, const std::string& what, std::span<const Judged> views,
           std::span<const scene::Image> pictures) {
  evaluate::RegionQualitySum sum;
  for (std::size_t v = 0; v < views.size(); ++v) {
    scene::Image shown = views[v].task.picture;  // outside the mask it stays
    for (int c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < shown.pixels(); ++i)
        if (views[v].task.mask.data[i] != 0) shown.plane(c)[i] = pictures[v].plane(c)[i];
    sum.add(shown, views[v].truth, views[v].task.mask);
  }
  const evaluate::RegionQuality quality = sum.quality();
  std::printf("| %s | %s | %.2f | %.4f |\n", tear.c_str(), what.c_str(), quality.psnr_db, quality.ssim);
  std::fflush(stdout);
}

/// The picture as the autoencoder gives it back, cut out around the mask and scaled as for repainting.
scene::Image through_autoencoder(const diffusion::StableDiffusion& model, const scene::Image& picture,
                                 const scene::Mask& mask) {
  const diffusion::Crop crop =
      diffusion::crop_around(scene::bounding_box(mask), picture.width, picture.height,
                             engine::weights::picture_side(model.configs()), model.side_multiple());
  const scene::Image shown = diffusion::resized(scene::cut_out(picture, crop.part), crop.width, crop.height);
  scene::Image back = picture;
  scene::paste(diffusion::resized(or_exit(model.through_autoencoder(shown)), crop.part.width(), crop.part.height()),
               crop.part, back);
  return back;
}

void judge(const Options& options, const diffusion::StableDiffusion& model, const Tear& tear) {
  std::vector<correct::HistoryPicture> history;
  std::vector<Judged> views;
  std::vector<correct::RepaintTask> tasks;
  std::vector<scene::Image> untouched;
  for (std::size_t v = 0; v < tear.cameras.size(); ++v) {
    const scene::Image torn = evaluate::picture(tear.torn, tear.cameras[v]),
                       truth = evaluate::picture(tear.truth, tear.cameras[v]);
    const scene::Mask mask = mask_of(torn, truth);
    if (mask.area() == 0) continue;
    if (v % 3 != 2) {
      history.push_back({.view = v,
                         .picture = correct::as_bytes(evaluate::picture(tear.before, tear.cameras[v])),
                         .box = scene::bounding_box(mask)});
      continue;
    }
    views.push_back({truth, {torn, mask}});
    tasks.push_back(views.back().task);
    untouched.push_back(torn);
  }
  if (views.empty()) {
    std::fprintf(stderr, "error: no picture that is to be repainted shows what is %s (--views)\n", tear.name.c_str());
    std::exit(1);
  }
  print(tear.name, "as it is", views, untouched);
  std::vector<scene::Image> of_torn, of_whole;
  for (const Judged& view : views) {
    of_torn.push_back(through_autoencoder(model, view.task.picture, view.task.mask));
    of_whole.push_back(through_autoencoder(model, view.truth, view.task.mask));
  }
  print(tear.name, "autoencoder", views, of_torn);
  print(tear.name, "autoencoder, of the true picture", views, of_whole);
  const auto advance = [](double) { return engine::Result<void>{}; };
  for (const double guidance : options.guidances) {
    const auto repainter = or_exit(diffusion::StableDiffusionRepainter::create(
        model, {.guidance = guidance,
                .sampling = {diffusion::Sampler::dpmpp2m, options.sampling_steps},
                .learning_rate = options.learning_rate,
                .threads = options.threads}));
    int learned = 0;
    for (const int steps : options.tuning) {
      or_exit(repainter->fine_tune(history, steps - learned, 7 + std::uint64_t(learned), advance));
      learned = steps;
      for (const double strength : options.strengths) {
        std::vector<scene::Image> painted(tasks.size(), scene::Image(options.width, options.height, 3));
        for (int k = 0; k < options.repeats; ++k) {
          const auto once = or_exit(repainter->repaint(tasks, strength, 1 + 1'000'000 * std::uint64_t(k), advance));
          for (std::size_t v = 0; v < once.size(); ++v)
            for (std::size_t i = 0; i < once[v].data.size(); ++i)
              painted[v].data[i] += once[v].data[i] / float(options.repeats);
        }
        std::array<char, 96> what{};
        std::snprintf(what.data(), what.size(), "sd, strength %.2f, guidance %.1f, %d steps of tuning", strength,
                      guidance, steps);
        print(tear.name, what.data(), views, painted);
        if (options.pictures.empty()) continue;
        std::array<char, 96> name{};
        std::snprintf(name.data(), name.size(), "%s_g%.1f_t%d_s%.2f.png", tear.name.c_str(), guidance, steps, strength);
        scene::Image panel(3 * options.width, options.height, 3);
        int x = 0;
        for (const scene::Image& part : {tasks.front().picture, painted.front(), views.front().truth}) {
          scene::paste(part, {x, 0, x + options.width, options.height}, panel);
          x += options.width;
        }
        or_exit(engine::io::write_image(std::filesystem::path(options.pictures) / name.data(), panel));
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App program("What a diffusion model makes of torn pictures.");
  program.add_option("--model", options.model, "A checkpoint")->required()->check(CLI::ExistingPath);
  program.add_option("--pictures", options.pictures, "Folder for pictures: torn, repainted, true")
      ->check(CLI::ExistingDirectory);
  program.add_option("--views", options.views, "Of which a third is repainted")
      ->check(CLI::Range(3, 1000))
      ->capture_default_str();
  program.add_option("--width", options.width, "Pixels")->check(CLI::Range(16, 1024))->capture_default_str();
  program.add_option("--height", options.height, "Pixels")->check(CLI::Range(16, 1024))->capture_default_str();
  program.add_option("--lost", options.lost, "Share of Gaussians that a riddled scene has not")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  program.add_option("--learning-rate", options.learning_rate, "Of the tuning")
      ->check(CLI::Range(1e-9, 1.0))
      ->capture_default_str();
  program.add_option("--sampling-steps", options.sampling_steps, "At strength 1")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  program
      .add_option("--repeats", options.repeats,
                  "Each picture is the mean of as many, each of its own noise: what an "
                  "edit's optimisation makes of views that differ")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  program.add_option("--tuning", options.tuning, "Steps of the adapter, ascending")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  program.add_option("--strength", options.strengths)->check(CLI::Range(0.0, 1.0))->capture_default_str();
  program.add_option("--guidance", options.guidances)->check(CLI::Range(1.0, 100.0))->capture_default_str();
  program.add_option("--threads", options.threads, "Of libtorch")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(program, argc, argv);
  if (!std::ranges::is_sorted(options.tuning)) {
    std::fprintf(stderr, "error: expected steps that ascend (--tuning)\n");
    return 1;
  }
  at::set_num_threads(options.threads);
  const diffusion::StableDiffusion model = or_exit(diffusion::StableDiffusion::open(options.model));
  std::printf("| tear | what | PSNR in the mask, dB | SSIM |\n| --- | --- | ---: | ---: |\n");
  for (const Tear& tear : {riddled(options), strewn(options), frayed(options), carried(options)})
    judge(options, model, tear);
}
