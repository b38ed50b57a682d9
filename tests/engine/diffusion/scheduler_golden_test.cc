#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "engine/diffusion/scheduler.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace engine::diffusion {
namespace {

/// Samplers by the reference's names.
SamplerOptions options_of(const std::string& name, int steps, double strength) {
  SamplerOptions options{.sampler = Sampler::dpmpp2m, .steps = steps, .strength = strength};
  if (name == "ddim") options.sampler = Sampler::ddim;
  if (name == "pndm") options.sampler = Sampler::pndm;
  if (name == "dpmpp2m_linspace") options.spacing = Spacing::linspace;
  if (name == "dpmpp2m_trailing_karras") options.spacing = Spacing::trailing, options.karras_sigmas = true;
  return options;
}

const std::vector<std::string> all_names = {"ddim", "pndm", "dpmpp2m_linspace", "dpmpp2m_leading",
                                            "dpmpp2m_trailing_karras"};

/// "N20_s0.5"
std::string run_named(int steps, double strength) {
  std::string text = std::to_string(strength);
  while (text.ends_with("0") && !text.ends_with(".0")) text.pop_back();
  return "N" + std::to_string(steps) + "_s" + text;
}

class SchedulerGolden : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_SHARED(support::golden_dir() / "schedulers.safetensors");
    file.emplace(support::golden_dir() / "schedulers.safetensors");
  }

  /// All latents of a run, one call after the other.
  std::vector<double> run(const SamplerOptions& options) const {
    const auto scheduler = make_scheduler({}, options);
    std::vector<float> x = file->at("step.x_init").floats();
    const std::vector<float> eps = file->at("step.eps").floats(), noise = file->at("step.variance_noise").floats();
    std::vector<double> all;
    for (std::size_t i = 0; i < scheduler->timesteps().size(); ++i) {
      const auto part = [&](const std::vector<float>& of) { return std::span(of).subspan(i * x.size(), x.size()); };
      scheduler->step(x, part(eps), options.eta > 0 ? part(noise) : std::span<const float>());
      all.insert(all.end(), x.begin(), x.end());
    }
    return all;
  }

  void expect_run(const SamplerOptions& options, const std::string& name) const {
    const std::vector<double> all = run(options), &expected = file->at(name).values;
    ASSERT_EQ(all.size(), expected.size()) << name;
    double most = 0;
    for (const double value : expected) most = std::max(most, std::abs(value));
    for (std::size_t i = 0; i < all.size(); ++i)
      ASSERT_NEAR(all[i], expected[i], 2e-5 * most) << name << ", number " << i;
  }

  std::optional<support::TensorFile> file;
};

TEST_F(SchedulerGolden, NoiseIsAddedAsInTraining) {
  const std::vector<double> alphas = alphas_cumprod({}), &expected = file->at("alphas_cumprod").values;
  ASSERT_EQ(alphas.size(), expected.size());
  for (std::size_t t = 0; t < alphas.size(); ++t) ASSERT_NEAR(alphas[t], expected[t], 1e-6) << t;
  const auto scheduler = make_scheduler({}, {});
  for (const int t : {0, 1, 21, 261, 500, 741, 981, 999}) {
    std::vector<float> x = file->at("add_noise.x0").floats();
    scheduler->add_noise(x, file->at("add_noise.noise").floats(), t);
    const auto& noisy = file->at("add_noise.t" + std::to_string(t)).values;
    for (std::size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(double(x[i]), noisy[i], 1e-5) << t;
  }
}

TEST_F(SchedulerGolden, TimestepsAreTheReferences) {
  const auto json = nlohmann::json::parse(support::read_file(support::golden_dir() / "schedulers.json"));
  for (const std::string& name : all_names)
    for (const int steps : {10, 20, 50}) {
      EXPECT_EQ(make_scheduler({}, options_of(name, steps, 1))->timesteps(),
                json[name]["timesteps"][std::to_string(steps)].get<std::vector<int>>())
          << name << " " << steps;
      for (const double strength : {0.3, 0.5, 0.75, 1.0})
        EXPECT_EQ(make_scheduler({}, options_of(name, steps, strength))->timesteps(),
                  json[name]["img2img"][run_named(steps, strength)]["timesteps"].get<std::vector<int>>())
            << name << " " << run_named(steps, strength);
    }
}

TEST_F(SchedulerGolden, StepsAreTheReferences) {
  for (const std::string& name : all_names)
    for (const auto& [steps, strength] : {std::pair(10, 1.0), std::pair(20, 0.5), std::pair(50, 0.75)}) {
      SamplerOptions options = options_of(name, steps, strength);
      const std::string run = name + "." + run_named(steps, strength);
      if (name != "ddim") {
        expect_run(options, run);
        continue;
      }
      expect_run(options, run + ".eta0.0");
      options.eta = 1;
      expect_run(options, run + ".eta1.0");
    }
}

}  // namespace
}  // namespace engine::diffusion
