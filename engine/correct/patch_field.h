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

/// Pixels. Patches are squares of 7 x 7 pixels: a choice; other sizes were not measured.
constexpr int patch_radius = 3;
constexpr int patch_side = 2 * patch_radius + 1;  ///< Pixels.

/// A colour picture, with room at the end for a vector that reads beyond a row.
struct Planes {
  static constexpr std::size_t spare = 8;  ///< Floats: a vector of 8 begins at the last pixel at most.

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
  scene::Mask centre_allowed;          ///< Pixels around which a whole patch is inside and allowed.
  std::vector<std::uint32_t> centres;  ///< Indices of the pixels of `centre_allowed` that are set, ascending.
};
/// A picture made ready to take patches from.
///   picture  [3]
///   allowed  [height][width] pixels that a patch may hold
[[nodiscard]] PatchSource patch_source(const scene::Image& picture, const scene::Mask& allowed);

/// A position in a picture, in pixels from its upper left corner.
struct Pixel {
  std::int16_t x = 0, y = 0;
};

/// A patch of a source.
struct PatchMatch {
  std::uint32_t source = 0;
  Pixel centre;
  float distance = 0;  ///< Weighted mean of squared differences, colour units squared, times 3.
};

/// The patches that are looked up, and where.
struct PatchQuery {
  const Planes* target = nullptr;
  std::span<const float> weight;   ///< [height][width], then Planes::spare more: weight of each pixel of the target.
  std::span<const Pixel> centres;  ///< Middles of the target's patches; each patch is wholly inside.
  std::span<const std::uint32_t> number;  ///< [height][width] index into `centres` of the pixel, or no_centre.
  std::span<const PatchSource> sources;   ///< At least one has an allowed centre.
};
constexpr std::uint32_t no_centre = ~std::uint32_t{0};

/// A field to begin with: patches drawn at random, each allowed centre as likely as any other.
[[nodiscard]] std::vector<PatchMatch> random_field(const PatchQuery& query, std::uint64_t seed);

/// The patches that were found at one scale.
struct PatchField {
  int width = 0;                      ///< Pixels of a row of the target.
  std::vector<std::uint32_t> number;  ///< As in PatchQuery.
  std::vector<PatchMatch> matches;    ///< [centres]
};

/// A field to begin with at twice the scale of `coarse`: the patches found there, and random ones where it has none.
///   coarse  a field over the same sources at half their size
[[nodiscard]] std::vector<PatchMatch> double_size_field(const PatchQuery& query, const PatchField& coarse,
                                                        std::uint64_t seed);

/// One pass over the field: distances are measured anew, then each patch is compared with what its neighbours `step`
/// pixels away have found, with three patches around its own match, and with one random patch.
///   matches, out  [centres]
///   seed          differs from pass to pass
/// Same bytes for any number of threads.
void improve(const PatchQuery& query, std::span<const PatchMatch> matches, int step, std::uint64_t seed,
             std::span<PatchMatch> out);

}  // namespace engine::correct
