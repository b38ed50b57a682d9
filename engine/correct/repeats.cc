#include "engine/correct/repeats.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/pyramid.h"
#include "engine/scene/window_sums.h"

namespace engine::correct {
namespace {

// Two pixels differ by chance by twice the variance of the picture (squared, in the mean). A shift is a repetition if
// the surroundings differ from themselves under it by this part of that at most, and so does what is around a pixel
// that it foretells. Noise of a capture is in both pixels. With 0.15 to 0.35 the captured cases differ by 0.4 dB at
// most, with stripes that a trainer has blurred found at 0.35; without this bound wood is shifted into wood, 0.6 dB
// worse than filled by patches (docs/adr/0056-what-repeats-goes-on.md).
constexpr double alike = 0.35;
// Of that, in coarser pictures, where a shift is off by half a pixel.
constexpr double alike_coarsely = 2;
// Shifts whose differences are greater than the least by this part of it still have a say: they average noise.
constexpr double nearly_as_alike = 0.15;
// Squared colour units, summed over channels: below half an 8-bit step of each nothing is better than anything else.
constexpr double rounding = 1e-5;
// Side of a square of the hole's size, pixels. In a hole of 11 (the old case `speck`) surroundings so small as the hole
// are alike by chance: 2.6 dB worse than patches.
constexpr double least_hole = 16;
// Shifts are looked for in a picture of at most this side, pixels, and made exact in finer ones.
constexpr int coarse_side = 96;
// Pixels of that picture: shorter shifts find a pixel like its neighbour, which is no repetition.
constexpr int least_shift = 2;
// Longest shift that is looked for, in parts of the picture's side, and so much of the surroundings must meet known
// pixels under it.
constexpr double reach = 0.6, least_met = 0.5;
constexpr std::size_t most_shifts = 80;  // a bound on time and memory
// Surroundings count by a bell curve of their distance from the hole, so wide in parts of the hole's side.
constexpr double near_hole = 0.5;
// Half sides of the windows around a pixel, in parts of the hole's side: each has the same say, so near differences
// have more. Choices.
constexpr std::array window_parts{0.13, 0.26, 0.52};
constexpr int least_window_px = 3;

/// From a pixel to the one that looks like it.
struct Shift {
  int x = 0, y = 0;  ///< Pixels.
};

/// A shift and how much surroundings differ from themselves under it, in the order of their worth: of equally good ones
/// the shortest first.
using Candidate = std::tuple<double, int, int, int>;  ///< Difference, squared length, y, x.
Candidate candidate(double difference, Shift shift) {
  return {difference, shift.x * shift.x + shift.y * shift.y, shift.y, shift.x};
}

/// What is around a hole, at one size.
struct Surroundings {
  scene::Image picture;  ///< [3]
  scene::Mask known;
  scene::Image nearness;  ///< [1] How much a pixel counts.
};

double side_of(const scene::Mask& hole) { return std::sqrt(double(hole.area())); }

scene::Image nearness_to(const scene::Mask& hole) {
  scene::Mask outside = hole;
  for (std::uint8_t& flag : outside.data) flag = flag == 0;
  const std::vector<int> distance = depth_within(outside);
  scene::Image near(hole.width, hole.height, 1);
  const double width = near_hole * side_of(hole);
  for (std::size_t i = 0; i < distance.size(); ++i) {
    const double t = double(distance[i]) / width;
    near.data[i] = float(std::exp(-0.5 * t * t));
  }
  return near;
}

Surroundings half_size(const Surroundings& fine) {
  scene::Image confidence(fine.known.width, fine.known.height, 1);
  for (std::size_t i = 0; i < confidence.data.size(); ++i) confidence.data[i] = float(fine.known.data[i]);
  const scene::Image all(confidence.width, confidence.height, 1, 1.0f);
  MaskedPicture half = correct::half_size(MaskedPicture{fine.picture, std::move(confidence)});
  Surroundings coarse{std::move(half.picture), scene::Mask(half.confidence.width, half.confidence.height),
                      correct::half_size(MaskedPicture{fine.nearness, all}).picture};
  for (std::size_t i = 0; i < coarse.known.data.size(); ++i) coarse.known.data[i] = half.confidence.data[i] >= 0.5f;
  return coarse;
}

float squared_difference(const scene::Image& picture, std::size_t a, std::size_t b) {
  float sum = 0;
  for (int c = 0; c < 3; ++c) {
    const float off = picture.plane(c)[a] - picture.plane(c)[b];
    sum += off * off;
  }
  return sum;
}

/// Pixels that a shift takes to known ones.
class Shifted {
 public:
  Shifted(const scene::Mask& known, Shift shift)
      : known_(known), shift_(shift), step_(std::ptrdiff_t(shift.y) * known.width + shift.x) {}

  [[nodiscard]] bool is_known(int x, int y) const {
    const int u = x + shift_.x, v = y + shift_.y;
    return u >= 0 && u < known_.width && v >= 0 && v < known_.height && known_.at(u, v) != 0;
  }
  /// Where it takes the pixel of this index.
  [[nodiscard]] std::size_t of(std::size_t pixel) const { return std::size_t(std::ptrdiff_t(pixel) + step_); }

 private:
  const scene::Mask& known_;
  Shift shift_;
  std::ptrdiff_t step_;
};

/// Compares surroundings with themselves.
class Comparison {
 public:
  explicit Comparison(const Surroundings& at) : at_(at) {
    constexpr float least = 0.01f;  // what counts for less says nothing
    for (int y = 0; y < at.known.height; ++y)
      for (int x = 0; x < at.known.width; ++x)
        if (at.known.at(x, y) != 0 && at.nearness.at(x, y) > least) {
          pixels_.emplace_back(x, y);
          all_ += double(at.nearness.at(x, y));
        }
  }

  /// The mean; infinite where too little meets anything known.
  [[nodiscard]] double difference(Shift shift) const {
    const Shifted shifted(at_.known, shift);
    double sum = 0, weights = 0;
    for (const auto& [x, y] : pixels_) {
      if (!shifted.is_known(x, y)) continue;
      const std::size_t here = std::size_t(y) * std::size_t(at_.known.width) + std::size_t(x);
      const double weight = double(at_.nearness.data[here]);
      sum += weight * double(squared_difference(at_.picture, here, shifted.of(here)));
      weights += weight;
    }
    return weights > least_met * all_ ? sum / weights : std::numeric_limits<double>::infinity();
  }

  /// What two pixels of the surroundings differ by if chance has it: twice their variance, summed over channels.
  [[nodiscard]] double by_chance() const {
    double out = 0;
    for (int c = 0; c < 3; ++c) {
      double sum = 0, squares = 0;
      for (const auto& [x, y] : pixels_) {
        const double weight = double(at_.nearness.at(x, y)), color = double(at_.picture.at(x, y, c));
        sum += weight * color, squares += weight * color * color;
      }
      if (all_ > 0) out += 2 * (squares / all_ - sum / all_ * (sum / all_));
    }
    return out;
  }

 private:
  const Surroundings& at_;
  std::vector<std::pair<int, int>> pixels_;
  double all_ = 0;  ///< Sum of their nearness.
};

/// Of all shifts those that are better than those beside them, the best first.
std::vector<Candidate> best_of_all(const Surroundings& at) {
  const Comparison comparison(at);
  const int most = int(reach * std::min(at.picture.width, at.picture.height)), side = 2 * most + 1;
  std::vector<double> table(std::size_t(side) * std::size_t(side));
  const auto value = [&](int x, int y) -> double& {
    return table[std::size_t(y) * std::size_t(side) + std::size_t(x)];
  };
  parallel_for(std::size_t(side), 1, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < side; ++x) value(x, y) = comparison.difference({x - most, y - most});
  });
  const auto is_least = [&](int x, int y) {
    for (int v = y - 1; v <= y + 1; ++v)
      for (int u = x - 1; u <= x + 1; ++u)
        if (value(u, v) < value(x, y)) return false;
    return true;
  };
  std::vector<Candidate> found;
  for (int y = 1; y + 1 < side; ++y)
    for (int x = 1; x + 1 < side; ++x)
      if (std::hypot(x - most, y - most) >= least_shift && std::isfinite(value(x, y)) && is_least(x, y))
        found.push_back(candidate(value(x, y), {x - most, y - most}));
  std::sort(found.begin(), found.end());
  found.resize(std::min(found.size(), most_shifts));
  return found;
}

/// The same shifts in a picture of twice the size, the best first.
std::vector<Candidate> refined(const Surroundings& at, std::span<const Candidate> coarse) {
  const Comparison comparison(at);
  std::vector<Candidate> out(coarse.size());
  parallel_for(coarse.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const int y = std::get<2>(coarse[k]), x = std::get<3>(coarse[k]);
      out[k] = candidate(std::numeric_limits<double>::infinity(), {});
      for (int v = 2 * y - 1; v <= 2 * y + 1; ++v)
        for (int u = 2 * x - 1; u <= 2 * x + 1; ++u)
          out[k] = std::min(out[k], candidate(comparison.difference({u, v}), {u, v}));
    }
  });
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

/// Shifts under which the surroundings differ by no more than this.
std::vector<Shift> repetitions(const Surroundings& whole, double most) {
  std::vector<Surroundings> sizes{whole};
  while (std::max(sizes.back().picture.width, sizes.back().picture.height) > coarse_side)
    sizes.push_back(half_size(sizes.back()));
  std::vector<Candidate> found = best_of_all(sizes.back());
  const auto keep_alike = [&](double limit) {
    std::erase_if(found, [&](const Candidate& candidate) { return !(std::get<0>(candidate) <= limit); });
  };
  for (std::size_t s = sizes.size() - 1; s-- > 0;) {
    keep_alike(alike_coarsely * most);
    found = refined(sizes[s], found);
  }
  keep_alike(most);
  std::vector<Shift> out;
  for (const auto& [difference, length, y, x] : found) out.push_back({x, y});
  return out;
}

/// Mean differences around pixels under a shift; infinite where it leads to nothing known, or nothing is around.
void differences_around(const Surroundings& at, Shift shift, std::span<const std::uint32_t> pixels,
                        std::span<const int> radii, std::span<float> out) {
  const Shifted shifted(at.known, shift);
  const int width = at.known.width, height = at.known.height;
  scene::WindowSums differences(width, height), met(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const std::size_t here = std::size_t(y) * std::size_t(width) + std::size_t(x);
      const bool meets = at.known.data[here] != 0 && shifted.is_known(x, y);
      met.add(x, y, meets ? 1 : 0);
      differences.add(x, y, meets ? double(squared_difference(at.picture, here, shifted.of(here))) : 0);
    }
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const int x = int(pixels[i]) % width, y = int(pixels[i]) / width;
    out[i] = std::numeric_limits<float>::infinity();
    if (!shifted.is_known(x, y)) continue;
    double sum = 0, share = 0;
    for (const int radius : radii) {
      const double area = double(2 * radius + 1) * double(2 * radius + 1);
      sum += differences.around(x, y, radius) / area, share += met.around(x, y, radius) / area;
    }
    constexpr double least_share = 1e-3;  // of the windows, that less says nothing: a choice
    if (share > least_share) out[i] = float(std::max(sum, 0.0) / share);  // sums of windows are differences, and round
  }
}

}  // namespace

scene::Mask continue_repeats(scene::Image& picture, const scene::Mask& known, const scene::Mask& hole) {
  assert(picture.channels == 3 && picture.width == known.width && picture.height == known.height);
  assert(hole.width == known.width && hole.height == known.height);
  scene::Mask foretold(hole.width, hole.height);
  std::vector<std::uint32_t> wanted;
  for (std::size_t i = 0; i < hole.data.size(); ++i)
    if (hole.data[i] != 0 && known.data[i] == 0) wanted.push_back(std::uint32_t(i));
  const double side = side_of(hole);
  if (wanted.empty() || side < least_hole) return foretold;

  const Surroundings whole{picture, known, nearness_to(hole)};
  const double by_chance = Comparison(whole).by_chance();
  if (by_chance < rounding) return foretold;  // of one colour: nothing is alike more than anything else
  const double most = alike * by_chance;
  const std::vector<Shift> shifts = repetitions(whole, most);
  std::array<int, window_parts.size()> radii{};
  for (std::size_t r = 0; r < radii.size(); ++r)
    radii[r] = std::max(least_window_px, int(std::lround(window_parts[r] * side)));
  const std::size_t count = wanted.size();
  std::vector<float> around(shifts.size() * count);  // [shifts][wanted]
  parallel_for(shifts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      differences_around(whole, shifts[k], wanted, radii, std::span(around).subspan(k * count, count));
  });

  constexpr std::size_t pixels_per_task = 256;
  parallel_for(count, pixels_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < shifts.size(); ++k) least = std::min(least, double(around[k * count + i]));
      if (!(least <= most)) continue;
      double color[3] = {}, weights = 0;
      for (std::size_t k = 0; k < shifts.size(); ++k) {
        const double difference = double(around[k * count + i]);
        if (!std::isfinite(difference)) continue;
        const double weight = std::exp((least - difference) / (2 * std::max(nearly_as_alike * least, rounding)));
        const std::size_t from = Shifted(known, shifts[k]).of(wanted[i]);
        for (int c = 0; c < 3; ++c) color[c] += weight * double(whole.picture.plane(c)[from]);
        weights += weight;
      }
      for (int c = 0; c < 3; ++c) picture.plane(c)[wanted[i]] = float(color[c] / weights);
      foretold.data[wanted[i]] = 1;
    }
  });
  return foretold;
}

}  // namespace engine::correct
