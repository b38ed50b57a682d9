// What Stable Diffusion costs at the size of 1.5, and LPIPS: seconds and memory of each network's call, and of a step
// of training.
//
//   build/release/bench/diffusion_cost [side [what]]     512 pixels unless told otherwise; what has `what` in its name
//
// Memory is what a call takes beside what was there before it: the peak is begun anew for each (Linux alone). The
// longest block is the longest that a cancel waits, processor time. OMP_NUM_THREADS says how many threads.
//
// No weights are needed: the checkpoint is a hole in a file, as long as the real one, and its tensors are zeros. It is
// made in the folder for temporary files and removed at the end.
#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/full.h>
#include <ATen/ops/randn.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/or_exit.h"
#include "engine/core/rng.h"
#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/lpips.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/training.h"
#include "engine/diffusion/unet.h"
#include "engine/evaluate/memory_peak.h"
#include "engine/scene/image.h"
#include "engine/weights/lpips_files.h"
#include "engine/weights/original_names.h"

namespace {

namespace diffusion = engine::diffusion;
namespace weights = engine::weights;
using at::Tensor;
using bench::or_exit;

/// A file whose tensors are all zeros, and take no room on the disk. It is removed at once, and stays mapped.
weights::TensorFile hole_of(const std::vector<weights::TensorSpec>& specs) {
  std::string header;
  std::uint64_t offset = 0;
  for (const weights::TensorSpec& spec : specs) {
    std::uint64_t bytes = sizeof(float);
    for (const std::int64_t size : spec.shape) bytes *= std::uint64_t(size);
    header += (header.empty() ? "{\"" : ",\"") + spec.name + R"(":{"dtype":"F32","shape":)" +
              weights::text_of(spec.shape) + ",\"data_offsets\":[" + std::to_string(offset) + "," +
              std::to_string(offset + bytes) + "]}";
    offset += bytes;
  }
  header += "}";
  header.resize((header.size() + 7) / 8 * 8, ' ');
  const std::uint64_t size = header.size();
  const auto path =
      std::filesystem::temp_directory_path() / ("splatdrag-hole-" + std::to_string(::getpid()) + ".safetensors");
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(&size), sizeof size) << header;
  std::filesystem::resize_file(path, sizeof size + size + offset);
  auto file = weights::TensorFile::open(path);
  std::filesystem::remove(path);
  return or_exit(std::move(file));
}

/// A checkpoint in one file.
weights::Checkpoint hollow_checkpoint(const weights::Configs& configs) {
  std::vector<weights::TensorSpec> specs;
  for (const auto network : {weights::Network::unet, weights::Network::autoencoder, weights::Network::text_encoder})
    for (const weights::TensorSpec& spec : weights::tensors_of(configs, network))
      specs.push_back({weights::original_place(configs, network, spec.name, false).name, spec.shape});
  return or_exit(weights::Checkpoint::of_file(hole_of(specs), configs));
}

std::unique_ptr<diffusion::Lpips> hollow_lpips() {
  std::vector<weights::TensorSpec> vgg16, linear;
  for (const weights::VggConvolution& convolution : weights::vgg_convolutions) {
    vgg16.push_back(weights::vgg_weight(convolution));
    vgg16.push_back(weights::vgg_bias(convolution));
    if (convolution.ends_depth) linear.push_back(weights::lpips_weight(linear.size(), convolution.out));
  }
  return or_exit(diffusion::Lpips::create({hole_of(vgg16), hole_of(linear)}));
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) { return double(time.tv_sec) + 1e-6 * double(time.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::string asked_for;  ///< Of what is measured; empty: all of it.

/// The longest time between two blocks of a network, or between a block and either end of what is measured.
class LongestBlock {
 public:
  void begin() { longest_ = 0, since_ = processor_seconds(); }
  void note() {
    const double now = processor_seconds();
    longest_ = std::max(longest_, now - since_);
    since_ = now;
  }
  [[nodiscard]] double seconds() const { return longest_; }

 private:
  double longest_ = 0, since_ = 0;
} longest_block;

void measure(const std::string& what, const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  if (what.find(asked_for) == std::string::npos) return;
  engine::evaluate::MemoryPeak memory;
  const auto begin = Clock::now();
  const double processor_begin = processor_seconds();
  longest_block.begin();
  work();
  longest_block.note();
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  memory.note();
  std::printf("%-40s %8.2f s, %8.2f s of processors, %6.2f s the longest block; %6.2f GB\n", what.c_str(), seconds,
              processor_seconds() - processor_begin, longest_block.seconds(), double(memory.bytes()) / 1e9);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int side = argc > 1 ? std::atoi(argv[1]) : 512;
  if (side < 64 || side % 64 != 0)
    return std::fprintf(stderr, "usage: diffusion_cost [side, a multiple of 64 [what]]\n"), 2;
  const std::string what = argc > 2 ? argv[2] : "";
  const weights::Configs configs = weights::stable_diffusion_1();
  const weights::Checkpoint checkpoint = hollow_checkpoint(configs);
  diffusion::Model unet, autoencoder, text_encoder;
  measure("load and check (zeros)", [&] {
    unet.parameters = or_exit(diffusion::Parameters::load(checkpoint, weights::Network::unet));
    autoencoder.parameters = or_exit(diffusion::Parameters::load(checkpoint, weights::Network::autoencoder));
    text_encoder.parameters = or_exit(diffusion::Parameters::load(checkpoint, weights::Network::text_encoder));
  });
  for (diffusion::Model* model : {&unet, &autoencoder}) model->before_block = [] { longest_block.note(); };
  asked_for = what;
  measure("digest (zeros)", [&] { (void)or_exit(checkpoint.digest()); });
  const Tensor picture = at::randn({1, 3, side, side}), latents = at::randn({1, 4, side / 8, side / 8});
  const Tensor context = at::randn({2, 77, 768});
  const auto times = [](std::int64_t batch) { return at::full({batch}, 500, at::kLong); };
  {
    const at::NoGradGuard no_gradients;
    measure("text encoder, one prompt", [&] {
      (void)diffusion::encode_text(text_encoder, configs.text_encoder, at::full({1, 77}, 7, at::kLong));
    });
    measure("autoencoder, encode", [&] { (void)diffusion::encode_moments(autoencoder, configs.autoencoder, picture); });
    measure("autoencoder, decode", [&] { (void)diffusion::decode_latents(autoencoder, configs.autoencoder, latents); });
    for (const std::int64_t batch : {1, 2}) {
      const Tensor many = at::randn({batch, 4, side / 8, side / 8});
      for (int i = 0; i < 2; ++i)
        measure(batch == 1 ? "UNet, a call without guidance" : "UNet, a call with guidance", [&] {
          (void)diffusion::predict_noise(unet, configs.unet, many, times(batch), context.narrow(0, 0, batch));
        });
    }
  }
  const auto adapter = diffusion::Adapter::fresh(weights::tensors_of(configs.unet), {"to_q", "to_v"}, 8, 32, 1);
  unet.adapters = {adapter};
  std::vector<Tensor> trained;
  adapter.collect(trained);
  diffusion::AdamW optimiser(trained, {});
  const Tensor noise = at::randn(latents.sizes()), at_times = times(1), prompt = context.narrow(0, 0, 1);
  for (const bool recomputes : {true, false}) {
    unet.recomputes = recomputes;
    measure(recomputes ? "training step, batch 1, rank 8" : "training step that keeps everything", [&] {
      (void)or_exit(diffusion::training_step(unet, configs, {&latents, &noise, &at_times, &prompt}, optimiser));
    });
  }
  const auto lpips = hollow_lpips();
  lpips->ask([]() -> engine::Result<void> { return longest_block.note(), engine::Result<void>{}; });
  engine::scene::Image one(side, side, 3), other = one, gradient;
  engine::Rng rng(1);
  for (engine::scene::Image* image : {&one, &other})
    for (float& value : image->data) value = rng.uniform();
  for (int i = 0; i < 2; ++i)
    measure("LPIPS and its gradient", [&] { (void)or_exit(lpips->evaluate(one, other, gradient)); });
}
