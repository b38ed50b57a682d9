// Nearest points, exactly: for first sizes of Gaussians, for places of new ones, for patches of pictures.
// Source: FLANN's single k-d tree (Muja and Lowe 2009), which does not approximate. The only room that knows FLANN.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace engine::neighbours {

/// A point that a query has found.
struct Neighbour {
  std::uint32_t index = 0;     ///< Of the point, as given.
  float squared_distance = 0;  ///< Euclidean, units of the points squared.
  bool operator==(const Neighbour&) const = default;
};

/// Points of any dimension. Built once, never changed; may be asked by several threads at once.
class PointIndex {
 public:
  /// Copies the points. Their order decides ties, and nothing else.
  ///   points      [n][dimensions], finite; n below 2^31
  ///   dimensions  1 or more. Pays up to about 16: beyond, a search looks at most of the points.
  PointIndex(std::span<const float> points, std::size_t dimensions);
  ~PointIndex();
  PointIndex(PointIndex&&) noexcept;
  PointIndex& operator=(PointIndex&&) noexcept;

  [[nodiscard]] std::size_t size() const;

  /// The k nearest points to each query, nearest first; of equally far ones the lower index first, and last to go.
  ///   queries  [q][dimensions], finite
  ///   returns  [q][min(k, size())]. The same for any number of threads.
  [[nodiscard]] std::vector<Neighbour> nearest(std::span<const float> queries, std::size_t k) const;

  /// Is there a point within this distance of each query? Where all are far off that is known at once, while the
  /// nearest of them takes a search among equally far ones.
  ///   queries  [q][dimensions], finite
  ///   radii    [q] 0 or more
  ///   returns  [q] 0 or 1. The same for any number of threads.
  [[nodiscard]] std::vector<std::uint8_t> has_within(std::span<const float> queries,
                                                     std::span<const float> radii) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine::neighbours
