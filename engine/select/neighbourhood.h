// Growing: from a few points on a thing to all of its rows, up to its natural border.
// Source: Boykov and Jolly 2001, "Interactive graph cuts", for the cut; Price, Morse and Cohen 2010, "Geodesic graph
// cut for interactive image segmentation", for the distances that say how likely a row is to belong to either side;
// Boykov and Kolmogorov 2004 for the algorithm. On Gaussians in place of pixels, the terms are ours.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/neighbour_graph.h"
#include "engine/select/operation.h"

namespace engine::select {

/// What growing looks at. A function of the scene, of inside[0] and, by steps, of the distances of the other points, so
/// that while a user clicks on, it mostly stays as it is.
struct Surroundings {
  DVec3 middle{0.0};  ///< inside[0]
  double reach = 0;   ///< World units: rows at most so far from the middle.
  bool operator==(const Surroundings&) const = default;
};

/// Rows: the nearest to the middle count. A second's work on one core; three on a surface without any border.
constexpr std::size_t max_neighbourhood = 250'000;

/// The surroundings of an operation. Without a reach: four times as far as the farthest inside point, or the nearest
/// outside one if that is farther, rounded up to a power of the square root of 2; for a point alone, a quarter of the
/// distance within which half of the scene's rows lie.
/// Precondition: validate() holds, and the scene has a row.
[[nodiscard]] Surroundings surroundings_of(const Array3& mean, const Grow& grow);

/// The rows around a point, joined to their neighbours by edges that are the weaker the more likely a border runs
/// between the two. Immutable, and independent of the cloud once made.
class Neighbourhood {
 public:
  /// Half a second for 250,000 rows on one core (bench/select_bench).
  Neighbourhood(const scene::GaussianCloud& cloud, const Surroundings& surroundings);

  [[nodiscard]] const Surroundings& surroundings() const { return surroundings_; }
  [[nodiscard]] std::span<const std::uint32_t> rows() const { return rows_; }  ///< Ascending.
  /// Had the reach to be cut short, so as not to look at more than max_neighbourhood rows?
  [[nodiscard]] bool is_cut_short() const { return is_cut_short_; }

  /// The rows of the thing: those on the side of the inside points of the cut through the weakest edges. What hangs
  /// together with none of the points is outside. Outside points beyond the reach count for nothing; without any, what
  /// lies at the reach is taken for outside, unless all else speaks against it.
  ///   grow     with this object's surroundings
  ///   returns  rows of the cloud, ascending
  ///   errors   unprocessable, `where` = "inside[1]": no row within reach, the point is beyond it, or all rows around
  ///   the
  ///            inside points are nearer to outside ones
  [[nodiscard]] Result<std::vector<std::uint32_t>> cut(const Grow& grow) const;

 private:
  /// Nodes that are given: those nearest to the points.
  struct Seeds {
    std::vector<std::uint32_t> inside, outside;
  };
  [[nodiscard]] Result<Seeds> seeds_of(const Grow& grow) const;
  [[nodiscard]] std::vector<std::uint32_t> far_nodes() const;

  Surroundings surroundings_;
  bool is_cut_short_ = false;
  std::vector<std::uint32_t> rows_;
  double farthest_ = 0;           ///< Of the rows, from the middle, if the reach was cut short; else the reach.
  std::vector<float> points_;     ///< [rows][3] relative to the middle.
  neighbours::PointIndex index_;  ///< Of these.
  NeighbourGraph graph_;
  std::vector<float> similarity_;  ///< [edges] 1: the same surface goes on; 0: a border.
};

}  // namespace engine::select
