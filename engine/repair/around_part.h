// What pictures show around a part, without it: points on the surfaces that it stands on, or next to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::repair {

/// Points in units of the part: places are relative to the middle of its box, and the diagonal of that box, its extent,
/// is 1. So they are near 0 and 1 wherever a scene lies, and however large it is.
struct AroundPart {
  DVec3 middle{0.0};                            ///< World units.
  double extent = 0;                            ///< World units; 0: there are no points.
  std::vector<float> place;                     ///< [n][3]
  std::vector<Vec3> color;                      ///< [n] The mean of the pixels that show it, display-referred.
  std::vector<float> weight;                    ///< [n] Above 0, at most 1: the more pixels, the more.
  std::vector<Vec3> normal;                     ///< [n] Unit, of either sign.
  std::vector<float> distance;                  ///< [n] To the nearest row of the part.
  std::optional<neighbours::PointIndex> index;  ///< Of the places, where there are any.

  [[nodiscard]] std::size_t size() const { return color.size(); }
  [[nodiscard]] Vec3 at(std::size_t i) const { return {place[3 * i], place[3 * i + 1], place[3 * i + 2]}; }
  /// A point of the world in these units; no farther than 1e9 from 0, so that squares fit a float.
  [[nodiscard]] Vec3 place_of(DVec3 point) const;
  /// [points][3]
  [[nodiscard]] std::vector<float> places_of(std::span<const DVec3> points) const;
};

/// Points are so far from each other, and up to so far from the part. Units of its extent.
constexpr float spacing_around = 1.0f / 24;
constexpr float reach_around = 1.5f;

/// Cameras that are asked at most, an even choice: they show the same places again and again.
constexpr std::size_t cameras_around = 24;
/// Pixels of a picture's longer side at most: finer ones show the same points more often.
constexpr int side_around = 512;

/// One forward pass per camera that is asked. Nothing where the part has no extent.
///   part     rows of the scene, ascending
///   cameras  pictures have the size that theirs have, and no more than side_around pixels on the longer side
///   looked   called with the part that is done, after each camera; its error ends it
[[nodiscard]] Result<AroundPart> look_around(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                                             std::span<const scene::Camera> cameras,
                                             const std::function<Result<void>(double)>& looked);

}  // namespace engine::repair
