// Which places of a scene belong to what an edit is to move: the truth that selections are held against.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/soa.h"
#include "engine/core/vec.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// Farther than this from every true surface nothing belongs to a thing: a floater. World units. Trained Gaussians
/// stand off the surface that they show: weighted by opacity times area, half of them by up to 0.02 and nine in ten by
/// up to 0.08 (cases mug, clutter and lid, within a unit of the thing).
constexpr double belongs_within = 0.1;

/// A predicate on positions in a scene before the edit: a place moves if the true surface next to it does.
class MovingPart {
 public:
  /// An empty scene, in which nothing moves.
  MovingPart() : MovingPart({}, {}) {}
  ///   before  the true scene
  ///   part    rows of it that move
  ///   within  see belongs_within, world units: another scene has another unit
  MovingPart(const scene::GaussianCloud& before, std::span<const std::uint32_t> part, double within = belongs_within);

  /// [N] 1 for each place that moves. The same for any number of threads.
  [[nodiscard]] std::vector<std::uint8_t> holds(const Array3& places) const;
  [[nodiscard]] bool holds(DVec3 place) const;

 private:
  neighbours::PointIndex surface_;
  std::vector<std::uint8_t> moves_;  ///< By point of surface_.
  double within_ = belongs_within;
};

/// How much of a picture each Gaussian can fill: its opacity times the area of its two longer axes (pi sigma_1 sigma_2,
/// world units squared).
[[nodiscard]] std::vector<double> opacities_times_area(const scene::GaussianCloud& cloud);

/// How much of the pictures each Gaussian fills: the sum of its blending weights, pixels.
[[nodiscard]] std::vector<double> shown_areas(const scene::GaussianCloud& cloud,
                                              std::span<const scene::Camera> cameras);

/// How well chosen rows match those that move. 0 to 1.
struct Match {
  double recall = 0;     ///< Of what moves, the part that was chosen; 1 where nothing moves.
  double precision = 0;  ///< Of what was chosen, the part that moves; 1 where nothing was chosen.
};
///   rows    ascending
///   counts  [cloud.size()] what each row counts, 0 or more
[[nodiscard]] Match match(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                          const MovingPart& part, std::span<const double> counts);

}  // namespace engine::captures
