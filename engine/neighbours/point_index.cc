#include "engine/neighbours/point_index.h"

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "engine/core/parallel.h"

namespace engine::neighbours {
namespace {

using Tree = flann::KDTreeSingleIndex<flann::L2_Simple<float>>;

constexpr std::size_t queries_per_chunk = 64;  // of a parallel task: a choice

/// The nearest points found so far. FLANN's own sets keep whichever of two equally far points the tree visits first.
class Nearest final : public flann::ResultSet<float> {
 public:
  explicit Nearest(std::span<Neighbour> into) : into_(into) {}

  [[nodiscard]] bool full() const override { return found_ == into_.size(); }
  /// The tree looks at points nearer than this: just beyond the last one kept, so that its equals are looked at.
  [[nodiscard]] float worstDist() const override {
    return full() ? std::nextafter(into_.back().squared_distance, infinity) : infinity;
  }
  void addPoint(float squared_distance, std::size_t index) override {
    const Neighbour point{std::uint32_t(index), squared_distance};
    if (full() && !nearer(point, into_.back())) return;
    if (!full()) ++found_;
    const auto last = into_.begin() + std::ptrdiff_t(found_) - 1;
    const auto place = std::upper_bound(into_.begin(), last, point, nearer);
    std::move_backward(place, last, last + 1);
    *place = point;
  }

 private:
  static constexpr float infinity = std::numeric_limits<float>::infinity();
  static bool nearer(const Neighbour& a, const Neighbour& b) {
    return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance : a.index < b.index;
  }
  std::span<Neighbour> into_;
  std::size_t found_ = 0;
};

/// Whether a point lies within a distance. One is enough.
class AnyWithin final : public flann::ResultSet<float> {
 public:
  explicit AnyWithin(float radius) : worst_(std::nextafter(radius * radius, std::numeric_limits<float>::infinity())) {}

  [[nodiscard]] bool found() const { return worst_ == 0; }
  [[nodiscard]] bool full() const override { return true; }  // the tree never has to look farther than worstDist()
  [[nodiscard]] float worstDist() const override { return worst_; }
  void addPoint(float squared_distance, std::size_t) override {
    if (squared_distance < worst_) worst_ = 0;
  }

 private:
  float worst_;
};

}  // namespace

struct PointIndex::Impl {
  std::size_t size, dimensions;
  std::optional<Tree> tree;  ///< Without points there is none: FLANN reads the first one.
};

PointIndex::PointIndex(std::span<const float> points, std::size_t dimensions)
    : impl_(std::make_unique<Impl>(Impl{points.size() / dimensions, dimensions, {}})) {
  assert(dimensions > 0 && points.size() % dimensions == 0);
  if (impl_->size == 0) return;
  // FLANN's matrices are not const; it only reads, and copies the points into the order of its leaves.
  const flann::Matrix<float> matrix(const_cast<float*>(points.data()), impl_->size, dimensions);
  impl_->tree.emplace(matrix);
  impl_->tree->buildIndex();
}

PointIndex::~PointIndex() = default;
PointIndex::PointIndex(PointIndex&&) noexcept = default;
PointIndex& PointIndex::operator=(PointIndex&&) noexcept = default;

std::size_t PointIndex::size() const { return impl_->size; }

std::vector<Neighbour> PointIndex::nearest(std::span<const float> queries, std::size_t k) const {
  assert(queries.size() % impl_->dimensions == 0);
  const std::size_t kept = std::min(k, impl_->size), count = queries.size() / impl_->dimensions;
  std::vector<Neighbour> found(count * kept);
  if (kept == 0) return found;
  parallel_for(count, queries_per_chunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t q = begin; q < end; ++q) {
      Nearest result(std::span<Neighbour>(found).subspan(q * kept, kept));
      impl_->tree->findNeighbors(result, queries.data() + q * impl_->dimensions, flann::SearchParams());
    }
  });
  return found;
}

std::vector<std::uint8_t> PointIndex::has_within(std::span<const float> queries, std::span<const float> radii) const {
  assert(queries.size() == radii.size() * impl_->dimensions);
  std::vector<std::uint8_t> has(radii.size(), 0);
  if (impl_->size == 0) return has;
  parallel_for(radii.size(), queries_per_chunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t q = begin; q < end; ++q) {
      AnyWithin result(radii[q]);
      impl_->tree->findNeighbors(result, queries.data() + q * impl_->dimensions, flann::SearchParams());
      has[q] = result.found();
    }
  });
  return has;
}

}  // namespace engine::neighbours
