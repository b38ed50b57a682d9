// What Stable Diffusion costs at the size of 1.5: seconds and memory of each network's call, and of a step of training.
//
//   build/release/bench/diffusion_cost [side]     512 pixels unless told otherwise
//
// OMP_NUM_THREADS says how many threads.
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

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/training.h"
#include "engine/diffusion/unet.h"
#include "engine/weights/original_names.h"

namespace {

namespace diffusion = engine::diffusion;
namespace weights = engine::weights;
using at::Tensor;

/// A checkpoint in one file whose tensors are all zeros, and take no room on the disk.
void make_hole(const std::filesystem::path& path, const weights::Configs& configs) {
  std::string header;
  std::uint64_t offset = 0;
  for (const auto network : {weights::Network::unet, weights::Network::autoencoder, weights::Network::text_encoder})
    for (const weights::TensorSpec& spec : weights::tensors_of(configs, network)) {
      std::uint64_t bytes = sizeof(float);
      for (const std::int64_t size : spec.shape) bytes *= std::uint64_t(size);
      header += (header.empty() ? "{\"" : ",\"") + weights::original_place(configs, network, spec.name, false).name +
                R"(":{"dtype":"F32","shape":)" + weights::text_of(spec.shape) + ",\"data_offsets\":[" +
                std::to_string(offset) + "," + std::to_string(offset + bytes) + "]}";
      offset += bytes;
    }
  header += "}";
  header.resize((header.size() + 7) / 8 * 8, ' ');
  const std::uint64_t size = header.size();
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(&size), sizeof size) << header;
  std::filesystem::resize_file(path, sizeof size + size + offset);
}

/// Peak of this process in GB, what is mapped of the checkpoint included.
double peak_gb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / (1 << 20);
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) { return double(time.tv_sec) + 1e-6 * double(time.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

void measure(const char* what, const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const double processor_begin = processor_seconds();
  work();
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  std::printf("%-36s %8.2f s, %8.2f s of processors; peak so far %6.2f GB\n", what, seconds,
              processor_seconds() - processor_begin, peak_gb());
  std::fflush(stdout);
}

template <class T>
T or_exit(engine::Result<T> result) {
  if (result) return std::move(*result);
  std::fprintf(stderr, "error: %s (%s)\n", result.error().message.c_str(), result.error().where.c_str());
  std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  const int side = argc > 1 ? std::atoi(argv[1]) : 512;
  if (side < 64 || side % 64 != 0) return std::fprintf(stderr, "usage: diffusion_cost [side, a multiple of 64]\n"), 2;
  const weights::Configs configs = weights::stable_diffusion_1();
  const auto path =
      std::filesystem::temp_directory_path() / ("splatdrag-hole-" + std::to_string(::getpid()) + ".safetensors");
  make_hole(path, configs);
  const auto checkpoint = weights::Checkpoint::open(path);
  std::filesystem::remove(path);  // stays mapped
  const weights::Checkpoint whole = or_exit(checkpoint);
  diffusion::Model unet, autoencoder, text_encoder;
  measure("load and check (zeros)", [&] {
    unet.parameters = or_exit(diffusion::Parameters::load(whole, weights::Network::unet));
    autoencoder.parameters = or_exit(diffusion::Parameters::load(whole, weights::Network::autoencoder));
    text_encoder.parameters = or_exit(diffusion::Parameters::load(whole, weights::Network::text_encoder));
  });
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
  unet.adapter = &adapter;
  std::vector<Tensor> trained;
  adapter.collect(trained);
  diffusion::AdamW optimiser(trained, {});
  const Tensor noise = at::randn(latents.sizes()), at_times = times(1), prompt = context.narrow(0, 0, 1);
  measure("training step, batch 1, rank 8", [&] {
    (void)or_exit(diffusion::training_step(unet, configs, {&latents, &noise, &at_times, &prompt}, optimiser));
  });
}
