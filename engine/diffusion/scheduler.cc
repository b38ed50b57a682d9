#include "engine/diffusion/scheduler.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

namespace engine::diffusion {
namespace {

using weights::NoiseConfig;

/// To the nearest whole number, halves to the even one, as the field's tables were made.
int rounded(double value) { return int(std::nearbyint(value)); }

/// `steps` time steps, the noisiest first. leading: equidistant from 0 on, moved by the offset; trailing: to the last.
std::vector<int> spread(const NoiseConfig& noise, Spacing spacing, int steps) {
  const int all = noise.training_steps;
  std::vector<int> timesteps;
  for (int i = steps - 1; i >= 0; --i) switch (spacing) {
      case Spacing::leading:
        timesteps.push_back(i * (all / steps) + noise.steps_offset);
        break;
      case Spacing::linspace:
        timesteps.push_back(steps == 1 ? 0 : rounded(double(all - 1) * i / (steps - 1)));
        break;
      case Spacing::trailing:
        timesteps.push_back(rounded(double(all) * (i + 1) / steps) - 1);
        break;
    }
  return timesteps;
}

class Ddim final : public Scheduler {
 public:
  Ddim(const NoiseConfig& noise, const SamplerOptions& options)
      : Scheduler(noise, options), stride_(noise.training_steps / options.steps), eta_(options.eta) {
    keep(spread(noise, options.spacing, options.steps), options);
  }
  [[nodiscard]] bool takes_noise() const override { return eta_ > 0; }

 private:
  void advance(std::span<float> x, std::span<const float> predicted, std::span<const float> noise) override {
    const int t = timesteps_[call_];
    const double now = alpha(t), next = alpha(t - stride_);
    const double sigma = eta_ * std::sqrt((1 - next) / (1 - now) * (1 - now / next));
    const double direction = std::sqrt(std::max(0.0, 1 - next - sigma * sigma));
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double eps = double(predicted[i]);
      const double picture = (double(x[i]) - std::sqrt(1 - now) * eps) / std::sqrt(now);
      const double fresh = takes_noise() ? sigma * double(noise[i]) : 0;
      x[i] = float(std::sqrt(next) * picture + direction * eps + fresh);
    }
  }

  int stride_;
  double eta_;
};

/// Linear multistep; what it has too few predictions for at the beginning it makes up by taking the first step twice.
class Pndm final : public Scheduler {
 public:
  Pndm(const NoiseConfig& noise, const SamplerOptions& options)
      : Scheduler(noise, options), stride_(noise.training_steps / options.steps) {
    std::vector<int> all = spread(noise, options.spacing, options.steps);
    if (all.size() > 1) all.insert(all.begin() + 1, all[1]);
    keep(std::move(all), options);
  }

 private:
  void advance(std::span<float> x, std::span<const float> predicted, std::span<const float>) override {
    const int t = timesteps_[call_];
    // The second call is the first step again, with the mean of both predictions. It is so, too, where strength left
    // out the beginning of the list, in which the step stands twice: the published way, whose results are compared
    // with.
    // One stride back from it is a time step of training: the list of the call before, with or without its beginning,
    // has every time step but its first at least a stride below the last of training.
    const bool again = call_ == 1;
    std::vector<double> mixed(predicted.begin(), predicted.end());
    if (again) {
      for (std::size_t i = 0; i < x.size(); ++i) mixed[i] = 0.5 * (mixed[i] + double(past_.back()[i]));
      std::ranges::copy(first_, x.begin());
    } else {
      if (call_ == 0) first_.assign(x.begin(), x.end());
      past_.emplace_back(predicted.begin(), predicted.end());
      if (past_.size() > 4) past_.erase(past_.begin());
      mix(mixed);
    }
    const double now = alpha(again ? t + stride_ : t), next = alpha(again ? t : t - stride_);
    const double of_x = std::sqrt(next / now);
    const double of_noise = (next - now) / (now * std::sqrt(1 - next) + std::sqrt(now * (1 - now) * next));
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = float(of_x * double(x[i]) - of_noise * mixed[i]);
  }

  /// Adams and Bashforth's weights, the newest prediction first.
  void mix(std::vector<double>& mixed) const {
    static constexpr std::array<std::array<double, 4>, 4> weights = {{{1, 0, 0, 0},
                                                                      {1.5, -0.5, 0, 0},
                                                                      {23.0 / 12, -16.0 / 12, 5.0 / 12, 0},
                                                                      {55.0 / 24, -59.0 / 24, 37.0 / 24, -9.0 / 24}}};
    const auto& of = weights[past_.size() - 1];
    for (std::size_t i = 0; i < mixed.size(); ++i) {
      mixed[i] = 0;
      for (std::size_t back = 0; back < past_.size(); ++back)
        mixed[i] += of[back] * double(past_[past_.size() - 1 - back][i]);
    }
  }

  int stride_;
  std::vector<std::vector<float>> past_;  ///< Predictions, the newest last.
  std::vector<float> first_;              ///< Latents before the first step.
};

class DpmSolver final : public Scheduler {
 public:
  DpmSolver(const NoiseConfig& noise, const SamplerOptions& options)
      : Scheduler(noise, options), steps_(std::size_t(options.steps)) {
    std::vector<int> all;
    if (options.karras_sigmas)
      all = by_karras(options.steps);
    else
      all = by_spacing(noise, options);
    sigmas_.push_back(0);  // the last step ends without noise
    keep(std::move(all), options);
  }

 private:
  [[nodiscard]] double sigma_at(int timestep) const { return std::sqrt((1 - alpha(timestep)) / alpha(timestep)); }

  /// This solver's own lists: none of them has the time step without noise, to which its last step leads.
  std::vector<int> by_spacing(const NoiseConfig& noise, const SamplerOptions& options) {
    const int all = noise.training_steps, steps = options.steps;
    std::vector<int> timesteps;
    for (int i = steps; i >= 1; --i) switch (options.spacing) {
        case Spacing::leading:
          timesteps.push_back(i * (all / (steps + 1)) + noise.steps_offset);
          break;
        case Spacing::linspace:
          timesteps.push_back(rounded(double(all - 1) * i / steps));
          break;
        case Spacing::trailing:
          timesteps.push_back(rounded(double(all) * i / steps) - 1);
          break;
      }
    for (const int t : timesteps) sigmas_.push_back(sigma_at(t));
    return timesteps;
  }

  /// Levels equidistant in their seventh root, and the time steps whose levels, in logarithms, are nearest.
  std::vector<int> by_karras(int steps) {
    constexpr double rho = 7;
    const int last = int(alphas_.size()) - 1;
    const double most = std::pow(sigma_at(last), 1 / rho), least = std::pow(sigma_at(0), 1 / rho);
    std::vector<int> timesteps;
    for (int i = 0; i < steps; ++i) {
      const double ramp = steps == 1 ? 0 : double(i) / (steps - 1);
      sigmas_.push_back(std::pow(most + ramp * (least - most), rho));
      timesteps.push_back(rounded(time_of(sigmas_.back())));
    }
    return timesteps;
  }

  [[nodiscard]] double time_of(double sigma) const {
    const int last = int(alphas_.size()) - 1;
    int low = 0;
    while (low + 2 <= last && sigma_at(low + 1) <= sigma) ++low;
    const double from = std::log(sigma_at(low)), to = std::log(sigma_at(low + 1));
    return low + std::clamp((std::log(sigma) - from) / (to - from), 0.0, 1.0);
  }

  /// Of a level sigma = noise / picture, both scaled to unit variance.
  struct Level {
    double picture, noise;
    [[nodiscard]] double log_ratio() const { return std::log(picture) - std::log(noise); }
  };
  static Level level_of(double sigma) {
    const double picture = 1 / std::sqrt(sigma * sigma + 1);
    return {picture, sigma * picture};
  }

  void advance(std::span<float> x, std::span<const float> predicted, std::span<const float>) override {
    const std::size_t at = skipped_ + call_;
    const Level now = level_of(sigmas_[at]), next = level_of(sigmas_[at + 1]);
    std::vector<double> picture(x.size());
    for (std::size_t i = 0; i < x.size(); ++i)
      picture[i] = (double(x[i]) - now.noise * double(predicted[i])) / now.picture;
    if (at + 1 == steps_) {  // to no noise at all: the picture as it is predicted
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = float(picture[i]);
    } else {
      const double h = next.log_ratio() - now.log_ratio(), weight = -next.picture * std::expm1(-h);
      double slope = 0;  // of second order from the second call on: half a step along the last difference
      if (!before_.empty()) slope = 0.5 * h / (now.log_ratio() - level_of(sigmas_[at - 1]).log_ratio());
      for (std::size_t i = 0; i < x.size(); ++i) {
        const double towards = slope == 0 ? picture[i] : picture[i] + slope * (picture[i] - before_[i]);
        x[i] = float(next.noise / now.noise * double(x[i]) + weight * towards);
      }
    }
    before_ = std::move(picture);
  }

  std::size_t steps_;
  std::vector<double> sigmas_;  ///< Of the whole list, and 0 at its end.
  std::vector<double> before_;  ///< The picture that the last call predicted.
};

/// Each call predicts the picture at once; what is left of the way is noise made anew.
class Consistency final : public Scheduler {
 public:
  Consistency(const NoiseConfig& noise, const SamplerOptions& options) : Scheduler(noise, options) {
    // The strength takes the beginning of the steps that the network knows; those asked for are spread over the rest.
    const int stride = noise.training_steps / options.distilled_steps;
    const int known = int(double(options.distilled_steps) * options.strength);
    const int steps = std::min(options.steps, known);
    for (int i = 0; i < steps; ++i) timesteps_.push_back((known - int(double(i) * known / steps)) * stride - 1);
  }
  [[nodiscard]] bool takes_noise() const override { return true; }

 private:
  void advance(std::span<float> x, std::span<const float> predicted, std::span<const float> noise) override {
    constexpr double data_deviation = 0.5, time_scaling = 10;
    const double time = time_scaling * timesteps_[call_], now = alpha(timesteps_[call_]);
    const double square = time * time + data_deviation * data_deviation;
    const double skip = data_deviation * data_deviation / square, out = time / std::sqrt(square);
    const bool last = call_ + 1 == timesteps_.size();
    const double next = last ? 1 : alpha(timesteps_[call_ + 1]);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double picture = (double(x[i]) - std::sqrt(1 - now) * double(predicted[i])) / std::sqrt(now);
      const double consistent = out * picture + skip * double(x[i]);
      x[i] = float(last ? consistent : std::sqrt(next) * consistent + std::sqrt(1 - next) * double(noise[i]));
    }
  }
};

/// The first time step of leading spacing, where the sampler has one.
int first_of_leading(const SamplerOptions& options, const NoiseConfig& noise) {
  const int all = noise.training_steps, steps = options.steps;
  switch (options.sampler) {
    case Sampler::ddim:
    case Sampler::pndm:
      return (steps - 1) * (all / steps) + noise.steps_offset;
    case Sampler::dpmpp2m:
      return options.karras_sigmas ? 0 : steps * (all / (steps + 1)) + noise.steps_offset;
    case Sampler::lcm:
      break;
  }
  return 0;
}

}  // namespace

Result<void> validate(const SamplerOptions& options, const NoiseConfig& noise) {
  const auto refused = [](const char* option, const std::string& expected) {
    return fail(ErrorCode::invalid_argument, "expected " + expected, option);
  };
  // With more, some spacings take one time step twice, and a solver of second order divides by the way between.
  const int most_steps = std::max(1, noise.training_steps / 2);
  if (options.steps < 1 || options.steps > most_steps) return refused("steps", "1 to " + std::to_string(most_steps));
  if (!(options.strength >= 0 && options.strength <= 1)) return refused("strength", "0 to 1");
  if (!(options.eta >= 0 && options.eta <= 1)) return refused("eta", "0 to 1");
  if (options.distilled_steps < 1 || options.distilled_steps > noise.training_steps)
    return refused("distilled_steps", "1 to " + std::to_string(noise.training_steps));
  // Beyond the last step of training there is no level of noise. Cut off there, time steps would stand twice in the
  // list.
  if (const int first = first_of_leading(options, noise);
      options.spacing == Spacing::leading && (noise.steps_offset < 0 || first >= noise.training_steps))
    return refused("steps_offset", "that " + std::to_string(options.steps) + " steps begin below time step " +
                                       std::to_string(noise.training_steps) + ", and not at " + std::to_string(first));
  return {};
}

std::vector<double> alphas_cumprod(const NoiseConfig& noise) {
  const double first = std::sqrt(noise.beta_start), last = std::sqrt(noise.beta_end);
  std::vector<double> alphas;
  double product = 1;
  for (int t = 0; t < noise.training_steps; ++t) {
    const double root = first + (last - first) * t / (noise.training_steps - 1);
    alphas.push_back(product *= 1 - root * root);
  }
  return alphas;
}

double Scheduler::alpha(int timestep) const {
  assert(timestep < int(alphas_.size()));
  if (timestep < 0) return last_alpha_;
  // A list that goes too far is a mistake of this file, and must not become a picture of what lies behind an array.
  return alphas_[std::min(std::size_t(timestep), alphas_.size() - 1)];
}

Scheduler::Scheduler(const NoiseConfig& noise, const SamplerOptions& options)
    : alphas_(alphas_cumprod(noise)), last_alpha_(noise.ends_without_noise ? 1 : alphas_.front()) {
  assert(validate(options, noise));
  (void)options;
}

void Scheduler::keep(std::vector<int> all, const SamplerOptions& options) {
  const int kept = std::min(int(double(options.steps) * options.strength), options.steps);
  skipped_ = std::size_t(options.steps - kept);
  all.erase(all.begin(), kept == 0 ? all.end() : all.begin() + std::ptrdiff_t(skipped_));
  timesteps_ = std::move(all);
}

void Scheduler::add_noise(std::span<float> latents, std::span<const float> noise, int timestep) const {
  assert(noise.size() == latents.size());
  const double of_picture = std::sqrt(alpha(timestep)), of_noise = std::sqrt(1 - alpha(timestep));
  for (std::size_t i = 0; i < latents.size(); ++i)
    latents[i] = float(of_picture * double(latents[i]) + of_noise * double(noise[i]));
}

void Scheduler::step(std::span<float> latents, std::span<const float> predicted, std::span<const float> noise) {
  assert(call_ < timesteps_.size() && predicted.size() == latents.size());
  assert(!takes_noise() || noise.size() == latents.size());
  advance(latents, predicted, noise);
  ++call_;
}

std::unique_ptr<Scheduler> make_scheduler(const NoiseConfig& noise, const SamplerOptions& options) {
  switch (options.sampler) {
    case Sampler::ddim:
      return std::make_unique<Ddim>(noise, options);
    case Sampler::pndm:
      return std::make_unique<Pndm>(noise, options);
    case Sampler::dpmpp2m:
      return std::make_unique<DpmSolver>(noise, options);
    case Sampler::lcm:
      return std::make_unique<Consistency>(noise, options);
  }
  return nullptr;
}

}  // namespace engine::diffusion
