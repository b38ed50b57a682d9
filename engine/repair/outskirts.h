// Which rows belong to what a part shows, other than those that were selected.
//
// A trainer explains the outline of a thing by Gaussians that nobody sees whole: large ones of its colour behind it,
// which show through it and around its rim, and ones of the thing itself that are buried in what it stands on or hangs
// before. When the thing goes, the former stay as its outline in the air; the latter come out, and are a haze around
// it. And what is around its outline has got colours that make up for the outline's blur.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::repair {

/// Cameras that are looked through at most, and pixels of the longer side of their pictures: choices.
constexpr std::size_t outskirts_cameras = 48;
constexpr int outskirts_side = 320;

/// Rows by what pictures show of them. All ascending, none twice.
struct Outskirts {
  /// Not of the part: what is seen of them is seen mostly on the part, from behind, and they have its colour.
  std::vector<std::uint32_t> backing;
  /// Of the part: none of the pictures shows half of them, as they lie in what stays or behind it; without that they
  /// show beside the part.
  std::vector<std::uint32_t> buried;
  /// Neither of the part nor before it: rows seen through its blurred outline, but for those with a standard
  /// deviation of more than 0.6 of its diagonal; and those seen clear of it.
  std::vector<std::uint32_t> through, clear;
};

/// Looks at a part from an even choice of the cameras: two forward passes and two sums of weights for each. Nothing
/// where none shows it; no backing nor buried rows where they are so little that nobody would see them.
///   part     rows, ascending
///   cameras  best those that show some of the part: what the others show is not asked
///   looked   called after each camera with the part that is done, 0 to 1; its error ends it
[[nodiscard]] Result<Outskirts> outskirts_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                                             std::span<const scene::Camera> cameras,
                                             const std::function<Result<void>(double)>& looked);

}  // namespace engine::repair
