#include "engine/repair/shadow.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/neighbours/neighbour_graph.h"

namespace engine::repair {
namespace {

// Lengths are in extents of the part. Chosen on three captured cases with shadows (mug_shadow, can_shadow,
// chair_shadow), two without (pouf, can), three toys of a real capture, and things drawn beside the board of the fox.

// The surface farther away: from so far from the part on, and that near to a place in the mean.
constexpr float far_from = 0.3f, about = 0.7f;
// Standard deviations of what counts as the same surface: off its plane, and of logarithms of colours but for their
// mean, which shadows change a little as well. And the least cosine of the angle between normals.
constexpr float off_plane = 0.08f, off_hue = 0.25f, same_way = 0.7f;
// Of what is known of a place, so much must be of that surface: a plane all around is 1. A toy has too little beside it
// to tell its shades from a shadow.
constexpr float least_known = 0.06f;
constexpr std::size_t most_asked = 1500;  // points of the surface farther away: an even choice of them
// Standard deviation of the window in which a surface is as dark as the mean of its points, and how many are asked.
constexpr float window = 0.07f;
constexpr std::size_t window_points = 48;
// A shadow is darker by so many times what its surface varies by in such windows, and by so much at least; at twice
// that all of it counts. Logarithms of factors of the light.
constexpr float beyond_texture = 2.5f, least_dark = 0.05f;
// The search is repeated without what is darker by so many times that: what is left says what the surface is like.
constexpr float maybe_dark = 1.5f;
constexpr int rounds = 4;
constexpr float darkest = -1.5f;  // less light than a fifth leaves no texture to be lit
// It begins within so much of the part. From the first of these distances on it fades, to nothing at the second: what
// is dark there is the shadow of something else as well.
constexpr float touches = 0.12f, fades_from = 0.6f, fades_until = 1.0f;
// A shadow has its root at the part, and ends. Where more than the first share of what is dark lies farther away than
// where shadows begin to fade, or less than the second within where they begin, it is another thing, or its shadow: a
// dark board that a mug, a crate or a can is beside has a third to 0.8 and 0.01 to 0.09, shadows of captured cases up
// to 0.15 and from 0.19 on (ADR 60, 61).
constexpr double most_far = 0.3, least_near = 0.1;
constexpr std::size_t joined = 16;                   // neighbours that a shadow may go on to,
constexpr float joined_within = 2 * spacing_around;  // and how near they are
// A point of a scene is on a surface that is so near: trained Gaussians stand off what they show.
constexpr float on_surface = 2 * spacing_around, beside_point = 2.5f * spacing_around;
constexpr std::size_t points_between = 4;  // that light is interpolated from

// What a texture varies by before anything brighter than the mean was found.
constexpr float unknown = std::numeric_limits<float>::infinity();

float mean_of(Vec3 v) { return (v.x + v.y + v.z) / 3; }

/// The logarithm of a colour, and that but for its mean: the same in any light, about.
Vec3 shade_of(Vec3 color) {
  constexpr float black = 2e-3f;  // half a step of 255: of what is darker no factor is known
  return glm::log(glm::max(color, Vec3(black)));
}
Vec3 hue_of(Vec3 color) { return shade_of(color) - mean_of(shade_of(color)); }

/// Which dark points hang together with one beside the part, through dark ones; none where little of that is beside
/// the part, or much of it far away.
///   nearest  [n][asked] points to each
std::vector<std::uint8_t> from_the_part(const AroundPart& around, std::span<const neighbours::Neighbour> nearest,
                                        std::size_t asked, const std::vector<std::uint8_t>& dark) {
  neighbours::Pieces pieces(around.size());
  for (std::uint32_t i = 0; i < around.size(); ++i)
    for (const auto& n : nearest.subspan(i * asked, std::min(joined, asked)))
      if (dark[i] != 0 && dark[n.index] != 0 && n.squared_distance < joined_within * joined_within)
        pieces.join(i, n.index);
  std::vector<std::uint8_t> touching(around.size(), 0), out(around.size(), 0);
  for (std::uint32_t i = 0; i < around.size(); ++i)
    if (dark[i] != 0 && around.distance[i] < touches) touching[pieces.of(i)] = 1;
  std::size_t points = 0, near = 0, far = 0;
  for (std::uint32_t i = 0; i < around.size(); ++i) {
    out[i] = dark[i] != 0 && touching[pieces.of(i)] != 0;
    if (out[i] == 0) continue;
    ++points;
    if (around.distance[i] < touches) ++near;
    if (around.distance[i] > fades_from) ++far;
  }
  if (double(far) > most_far * double(points) || double(near) < least_near * double(points))
    std::ranges::fill(out, std::uint8_t{0});
  return out;
}

/// Whether what is dark is darker away from the part than beside it: its farthest third, than the rest.
///   light  [n] logarithm of what is left of it
bool darkens_outwards(const AroundPart& around, const std::vector<std::uint8_t>& dark, const std::vector<Vec3>& light) {
  std::vector<std::uint32_t> points;
  for (std::uint32_t i = 0; i < around.size(); ++i)
    if (dark[i] != 0) points.push_back(i);
  const auto farther = points.begin() + std::ptrdiff_t(points.size() - points.size() / 3);
  if (farther == points.end()) return false;
  std::ranges::nth_element(points, farther, {}, [&](std::uint32_t i) { return std::pair(around.distance[i], i); });
  const auto mean = [&](auto begin, auto end) {
    double sum = 0;
    for (auto it = begin; it != end; ++it) sum += double(mean_of(light[*it]));
    return sum / double(end - begin);
  };
  return mean(farther, points.end()) < mean(points.begin(), farther);
}

/// Finds how dark each point is: the logarithm of what is left of the light, over a window.
class Darkness {
 public:
  ///   nearest  [n][asked] points to each
  Darkness(const AroundPart& around, std::span<const neighbours::Neighbour> nearest, std::size_t asked);
  [[nodiscard]] const std::vector<Vec3>& mean() const { return mean_; }
  /// From which darkness on texture does not explain it. Above 0.
  [[nodiscard]] float threshold(std::size_t i) const { return std::max(least_dark, beyond_texture * texture_[i]); }

 private:
  /// Of an even choice of points, those that tell what the surface is like where no shadow is, and how many each is.
  [[nodiscard]] std::pair<std::vector<std::uint32_t>, float> far_points() const;
  void compare_with_far(std::span<const std::uint32_t> far, float each);
  void average(std::span<const neighbours::Neighbour> nearest, std::size_t asked);
  [[nodiscard]] float likeness(std::size_t i, std::size_t j, float deviation) const;

  const AroundPart& around_;
  std::vector<Vec3> shade_, hue_;  ///< Logarithm of the colour; but for its mean.
  std::vector<Vec3> difference_;   ///< From the surface farther away.
  std::vector<std::uint8_t> known_;
  std::vector<Vec3> mean_;
  std::vector<float> texture_;  ///< What the mean varies by where there is no shadow.
};

Darkness::Darkness(const AroundPart& around, std::span<const neighbours::Neighbour> nearest, std::size_t asked)
    : around_(around),
      difference_(around.size()),
      known_(around.size()),
      mean_(around.size(), Vec3(0.0f)),
      texture_(around.size(), unknown) {
  for (const Vec3 color : around.color) shade_.push_back(shade_of(color)), hue_.push_back(hue_of(color));
  for (int round = 0; round < rounds; ++round) {
    const auto [far, each] = far_points();
    compare_with_far(far, each);
    average(nearest, asked);
  }
}

std::pair<std::vector<std::uint32_t>, float> Darkness::far_points() const {
  std::vector<std::uint32_t> far;
  for (std::uint32_t i = 0; i < around_.size(); ++i)
    if (around_.distance[i] > far_from && mean_of(mean_[i]) > -std::max(least_dark, maybe_dark * texture_[i]))
      far.push_back(i);
  const std::size_t count = std::min(most_asked, far.size());
  if (count == 0) return {{}, 0.0f};
  std::vector<std::uint32_t> chosen;
  for (std::size_t k = 0; k < count; ++k) {
    // One of each `far.size() / count` neighbours in the list, which runs along rows of a grid.
    const std::size_t first = k * far.size() / count, last = (k + 1) * far.size() / count;
    Rng rng(0, k);
    chosen.push_back(far[first + rng.below(std::uint32_t(last - first))]);
  }
  return {std::move(chosen), float(far.size()) / float(count)};
}

/// How much of the same surface two points are, by their places: 0 to 1.
float Darkness::likeness(std::size_t i, std::size_t j, float deviation) const {
  const Vec3 apart = around_.at(j) - around_.at(i);
  if (std::abs(glm::dot(around_.normal[i], around_.normal[j])) < same_way) return 0;
  const float from_i = glm::dot(apart, around_.normal[i]) / off_plane;
  const float from_j = glm::dot(apart, around_.normal[j]) / off_plane;
  constexpr float next_to_nothing = 3;  // standard deviations: e to the -4.5
  if (std::max(std::abs(from_i), std::abs(from_j)) > next_to_nothing) return 0;
  return std::exp(-0.5f * (glm::dot(apart, apart) / (deviation * deviation) + from_i * from_i + from_j * from_j));
}

void Darkness::compare_with_far(std::span<const std::uint32_t> far, float each) {
  // A plane all around a place holds so many points, weighted as below.
  const float full = 2 * std::numbers::pi_v<float> * about * about / (spacing_around * spacing_around);
  parallel_for(around_.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float weights = 0, brighter = 0, squares = 0;
      Vec3 sum(0.0f);
      for (const std::uint32_t j : far) {
        const Vec3 off = (hue_[j] - hue_[i]) / off_hue;
        const float like = likeness(i, j, about);
        if (like == 0) continue;
        const float weight = around_.weight[j] * like * std::exp(-0.5f * glm::dot(off, off));
        weights += weight;
        sum += weight * shade_[j];
        // Shadows darken, and texture does both: what is brighter than the mean tells of texture alone.
        if (const float mean = mean_of(mean_[j]); mean > 0) brighter += weight, squares += weight * mean * mean;
      }
      known_[i] = weights * each > least_known * full;
      difference_[i] = known_[i] != 0 ? shade_[i] - sum / weights : Vec3(0.0f);
      texture_[i] = brighter > 0 ? std::sqrt(squares / brighter) : unknown;
    }
  });
}

void Darkness::average(std::span<const neighbours::Neighbour> nearest, std::size_t asked) {
  constexpr float farthest = 2.2f * window;  // a normal distribution is next to nothing beyond
  parallel_for(around_.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float weights = 0;
      Vec3 sum(0.0f);
      for (const auto& n : nearest.subspan(i * asked, asked)) {
        if (known_[n.index] == 0 || n.squared_distance > farthest * farthest) continue;
        const float weight = around_.weight[n.index] * likeness(i, n.index, window);
        weights += weight, sum += weight * difference_[n.index];
      }
      mean_[i] = weights > 0 ? sum / weights : Vec3(0.0f);
    }
  });
}

}  // namespace

Shadow::Shadow(AroundPart around) : around_(std::move(around)), light_(around_.size(), Vec3(1.0f)) {
  if (!around_.index) return;
  const std::size_t asked = std::min(window_points, around_.size());
  const auto nearest = around_.index->nearest(around_.place, asked);
  const Darkness darkness(around_, nearest, asked);
  std::vector<std::uint8_t> dark(around_.size());
  // What is dark where shadows have faded says nothing of them.
  for (std::size_t i = 0; i < around_.size(); ++i)
    dark[i] = around_.distance[i] < fades_until && mean_of(darkness.mean()[i]) < -darkness.threshold(i);
  const std::vector<std::uint8_t> cast = from_the_part(around_, nearest, asked, dark);
  if (darkens_outwards(around_, cast, darkness.mean())) return;
  for (std::size_t i = 0; i < around_.size(); ++i) {
    if (cast[i] == 0) continue;
    const Vec3 mean = darkness.mean()[i];
    const float sure = std::min(-mean_of(mean) / darkness.threshold(i) - 1, 1.0f);
    const float near = std::clamp((fades_until - around_.distance[i]) / (fades_until - fades_from), 0.0f, 1.0f);
    light_[i] = glm::exp(sure * near * glm::clamp(mean, Vec3(darkest), Vec3(0.0f)));
    if (light_[i] != Vec3(1.0f)) reach_ = std::max(reach_, glm::length(around_.at(i)) + beside_point);
  }
}

std::vector<Vec3> Shadow::light_at(std::span<const DVec3> points) const {
  std::vector<Vec3> out(points.size(), Vec3(1.0f));
  if (empty()) return out;
  const std::vector<float> places = around_.places_of(points);
  const std::size_t count = std::min(points_between, around_.size());
  const auto nearest = around_.index->nearest(places, count);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3 place(places[3 * k], places[3 * k + 1], places[3 * k + 2]);
    float weights = 0;
    Vec3 sum(0.0f);
    for (const auto& n : std::span(nearest).subspan(k * count, count)) {
      if (n.squared_distance > beside_point * beside_point) continue;
      if (std::abs(glm::dot(place - around_.at(n.index), around_.normal[n.index])) > on_surface) continue;
      constexpr float least = 1e-6f;  // at a point itself
      const float weight = 1 / (n.squared_distance + least);
      weights += weight, sum += weight * light_[n.index];
    }
    if (weights > 0) out[k] = sum / weights;
  }
  return out;
}

}  // namespace engine::repair
