// For each patch of a picture, the most alike patch of other pictures, found approximately.
// Source: Barnes et al. 2009, "PatchMatch: a randomized correspondence algorithm for structural image editing",
// sections 3.1 and 3.2. A pass here reads one field and writes another, so that pixels may go in any order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/image.h"

namespace engine::correct {

constexpr int patch_radius = 3;  ///< Patches are squares of 7 x 7 pixels.
constexpr int patch_side = 2 * patch_radius + 1;

/// A colour picture, with room at the end for a vector that reads beyond a row.
struct Planes {
  static constexpr std::size_t spare = 8;

  int width = 0, height = 0;
  std::vector<float> data;  ///< [3][height][width], then `spare` more

  Planes() = default;
  explicit Planes(const scene::Image& image);
  Planes(int w, int h) : width(w), height(h), data(3 * std::size_t(w) * std::size_t(h) + spare, 0.0f) {}
  [[nodiscard]] std::size_t pixels() const { return std::size_t(width) * std::size_t(height); }
  [[nodiscard]] std::size_t index(int x, int y) const { return std::size_t(y) * std::size_t(width) + std::size_t(x); }
};

/// A picture to take patches from.
struct PatchSource {
  Planes picture;
  scene::Mask centre_allowed;          ///< Where the middle of a patch may be: wholly inside, no pixel of it excluded.
  std::vector<std::uint32_t> centres;  ///< Those places, as indices, ascending.
};
///   allowed  pixels that may be taken
[[nodiscard]] PatchSource patch_source(const scene::Image& picture, const scene::Mask& allowed);

struct Place {
  std::int16_t x = 0, y = 0;
};

/// A patch of a source.
struct Match {
  std::uint32_t source = 0;
  Place centre;
  float distance = 0;  ///< Weighted mean of squared differences, colour units squared, times 3.
};

/// The patches that are looked up, and where.
struct PatchQuery {
  const Planes* target = nullptr;
  std::span<const float> weight;          ///< [height][width] (+ Planes::spare) of the target: what a pixel counts.
  std::span<const Place> centres;         ///< Of target patches, all wholly inside.
  std::span<const std::uint32_t> number;  ///< [height][width] which of `centres` is at a pixel; nothing: no_centre.
  std::span<const PatchSource> sources;   ///< At least one has an allowed centre.
};
constexpr std::uint32_t no_centre = ~std::uint32_t{0};

/// Any patches at all: a field to begin with.
[[nodiscard]] std::vector<Match> random_field(const PatchQuery& query, std::uint64_t seed);

/// What was found at one scale.
struct Field {
  int width = 0;                      ///< Of the target.
  std::vector<std::uint32_t> number;  ///< As in PatchQuery.
  std::vector<Match> matches;         ///< [centres]
};

/// A field to begin with at twice the scale of `coarse`: what was found there, and any patches where that says nothing.
///   coarse  of the same sources, each halved
[[nodiscard]] std::vector<Match> doubled_field(const PatchQuery& query, const Field& coarse, std::uint64_t seed);

/// One pass over the field: distances are measured anew, then each patch looks at what its neighbours `step` pixels
/// away have found, around its own match, and at one random patch.
///   matches, out  [centres]
///   seed          of this pass
///   bytes         the same for any number of threads
void improve(const PatchQuery& query, std::span<const Match> matches, int step, std::uint64_t seed,
             std::span<Match> out);

}  // namespace engine::correct
