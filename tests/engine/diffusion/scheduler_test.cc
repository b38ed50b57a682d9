#include "engine/diffusion/scheduler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace engine::diffusion {
namespace {

constexpr std::array<float, 4> picture = {0.5f, -1.25f, 2.0f, 0.0f}, noise = {0.3f, 1.0f, -0.7f, -1.6f};

const std::vector<Sampler> all_samplers = {Sampler::ddim, Sampler::pndm, Sampler::dpmpp2m, Sampler::lcm};

/// From the picture with noise, given a network that always sees exactly that noise.
std::array<float, 4> ended(const SamplerOptions& options) {
  const auto scheduler = make_scheduler({}, options);
  std::array<float, 4> x = picture;
  scheduler->add_noise(x, noise, scheduler->timesteps().front());
  for (const int t : scheduler->timesteps()) {
    // What is in x now, seen from the picture; the last levels have hardly any noise left.
    const double alpha = alphas_cumprod({})[std::size_t(t)];
    std::array<float, 4> seen{};
    for (std::size_t i = 0; i < x.size(); ++i)
      seen[i] = float((double(x[i]) - std::sqrt(alpha) * double(picture[i])) / std::sqrt(1 - alpha));
    scheduler->step(x, seen, noise);
  }
  return x;
}

TEST(Scheduler, APerfectNetworkLeadsBackToThePicture) {
  for (const Sampler sampler : all_samplers)
    for (const double strength : {0.4, 1.0}) {
      const auto x = ended({.sampler = sampler, .steps = 20, .strength = strength});
      // DDIM and PNDM end at the first level of training, at which 3 % of noise are left.
      const double tolerance = sampler == Sampler::ddim || sampler == Sampler::pndm ? 0.06 : 1e-3;
      for (std::size_t i = 0; i < x.size(); ++i)
        EXPECT_NEAR(x[i], picture[i], tolerance) << name_of(sampler) << " at strength " << strength;
    }
}

TEST(Scheduler, TimestepsFallAndStayWithinTraining) {
  for (const Sampler sampler : all_samplers)
    for (const Spacing spacing : {Spacing::leading, Spacing::linspace, Spacing::trailing})
      for (const int steps : {1, 2, 3, 7, 50, 499, 500}) {
        const auto scheduler = make_scheduler({}, {.sampler = sampler, .steps = steps, .spacing = spacing});
        const auto& timesteps = scheduler->timesteps();
        ASSERT_FALSE(timesteps.empty());
        EXPECT_LT(timesteps.front(), 1000);
        EXPECT_GE(timesteps.back(), 0);
        EXPECT_TRUE(std::is_sorted(timesteps.rbegin(), timesteps.rend()));
      }
}

TEST(Scheduler, StepsThatBeginBeyondTrainingAreRefusedAndAllOthersStayFinite) {
  for (const int offset : {0, 1, 2, 20, 999})
    for (const Sampler sampler : all_samplers)
      for (const Spacing spacing : {Spacing::leading, Spacing::linspace, Spacing::trailing})
        for (const int steps : {1, 2, 49, 50, 499, 500})
          for (const double strength : {0.5, 0.98, 1.0})
            for (const bool karras : {false, true}) {
              const weights::NoiseConfig config{.steps_offset = offset};
              const SamplerOptions options{.sampler = sampler,
                                           .steps = steps,
                                           .strength = strength,
                                           .spacing = spacing,
                                           .karras_sigmas = karras,
                                           .eta = 0.5};
              const auto valid = validate(options, config);
              if (!valid) {
                EXPECT_EQ(valid.error().where, "steps_offset");
                EXPECT_EQ(spacing, Spacing::leading);
                EXPECT_GT(offset, 1) << "what checkpoints have";
                continue;
              }
              const auto scheduler = make_scheduler(config, options);
              std::array<float, 4> x = picture;
              for (std::size_t call = 0; call < scheduler->timesteps().size(); ++call) {
                ASSERT_LT(scheduler->timesteps()[call], 1000);
                scheduler->step(x, noise, noise);
              }
              for (const float value : x)
                ASSERT_TRUE(std::isfinite(value)) << name_of(sampler) << " offset " << offset << " steps " << steps;
            }
}

TEST(Scheduler, AnOffsetIsRefusedFromTheStepThatNoNoiseIsKnownFor) {
  const auto accepted = [](Sampler sampler, int steps, int offset) {
    return validate({.sampler = sampler, .steps = steps}, {.steps_offset = offset}).has_value();
  };
  for (const Sampler sampler : {Sampler::ddim, Sampler::pndm}) {
    EXPECT_TRUE(accepted(sampler, 50, 19)) << "49 * 20 + 19 is the last";
    EXPECT_FALSE(accepted(sampler, 50, 20));
    EXPECT_FALSE(accepted(sampler, 500, 2));
    EXPECT_TRUE(accepted(sampler, 1, 999));
  }
  EXPECT_TRUE(accepted(Sampler::dpmpp2m, 50, 49)) << "50 * 19 + 49";
  EXPECT_FALSE(accepted(Sampler::dpmpp2m, 50, 50));
  EXPECT_TRUE(accepted(Sampler::lcm, 4, 999)) << "it takes its own";
}

TEST(Scheduler, EndsWithoutNoiseWhereTheCheckpointSaysSo) {
  // The last call of one step, from time step 0: to the picture itself, or back to where it was.
  const std::array<float, 1> seen = {0.5f}, none = {};
  const double alpha = alphas_cumprod({})[0];
  for (const Sampler sampler : {Sampler::ddim, Sampler::pndm})
    for (const bool without : {false, true}) {
      const auto scheduler =
          make_scheduler({.steps_offset = 0, .ends_without_noise = without}, {.sampler = sampler, .steps = 1});
      std::array<float, 1> x = {0.7f};
      scheduler->step(x, seen, none);
      EXPECT_NEAR(double(x[0]), without ? (0.7 - std::sqrt(1 - alpha) * 0.5) / std::sqrt(alpha) : 0.7, 1e-6);
    }
}

TEST(Scheduler, ConsistencyTakesItsStepsAmongThoseItWasDistilledTo) {
  EXPECT_EQ(make_scheduler({}, {.sampler = Sampler::lcm, .steps = 4})->timesteps(),
            (std::vector<int>{999, 759, 499, 259}));
  EXPECT_EQ(make_scheduler({}, {.sampler = Sampler::lcm, .steps = 4, .strength = 0.5})->timesteps(),
            (std::vector<int>{499, 379, 259, 139}));
  EXPECT_EQ(make_scheduler({}, {.sampler = Sampler::lcm, .steps = 4, .strength = 0.04})->timesteps().size(), 2u);
}

TEST(Scheduler, ConsistencyAddsNoiseBetweenCallsAndNoneAtTheEnd) {
  // A network that sees no noise: the picture is x / sqrt(alpha), and what comes of it is known.
  const auto scheduler = make_scheduler({}, {.sampler = Sampler::lcm, .steps = 2});
  ASSERT_EQ(scheduler->timesteps(), (std::vector<int>{999, 499}));
  const std::array<float, 1> none = {0}, fresh = {2};
  std::array<float, 1> x = {0.1f};
  const auto alphas = alphas_cumprod({});
  scheduler->step(x, none, fresh);
  const double first = 0.1 / std::sqrt(alphas[999]) * std::sqrt(alphas[499]) + 2 * std::sqrt(1 - alphas[499]);
  EXPECT_NEAR(double(x[0]), first, 1e-5);
  scheduler->step(x, none, fresh);
  EXPECT_NEAR(double(x[0]), first / std::sqrt(alphas[499]), 1e-5);
}

TEST(Scheduler, LittleStrengthLeavesNoStep) {
  for (const Sampler sampler : all_samplers)
    EXPECT_TRUE(make_scheduler({}, {.sampler = sampler, .steps = 10, .strength = 0.01})->timesteps().empty());
}

TEST(Scheduler, OptionsAreChecked) {
  const weights::NoiseConfig config;
  EXPECT_TRUE(validate({}, config));
  EXPECT_EQ(validate({.steps = 0}, config).error().where, "steps");
  EXPECT_EQ(validate({.steps = 501}, config).error().where, "steps");
  EXPECT_EQ(validate({.strength = 1.5}, config).error().where, "strength");
  EXPECT_EQ(validate({.strength = std::nan("")}, config).error().where, "strength");
  EXPECT_EQ(validate({.eta = -1}, config).error().where, "eta");
  EXPECT_EQ(validate({.distilled_steps = 0}, config).error().where, "distilled_steps");
}

}  // namespace
}  // namespace engine::diffusion
