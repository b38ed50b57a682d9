#include "engine/select/neighbourhood.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <sstream>
#include <string>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/select/minimum_cut.h"
#include "engine/select/similarity.h"

namespace engine::select {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr std::size_t grain = 16'384;  // rows of a parallel task: a choice

constexpr std::size_t neighbours_joined = 8;  // a surface's row has about six around it
constexpr std::size_t rows_clicked = 4;       // nearest to a point: it lies on all of them

// The rest was chosen on the ball, the mug, the books and the apple on them in the demo scene, of 60,000 and 150,000
// Gaussians and with noise on all of their values, with two clicks on the thing and four around it.
constexpr double reach_by_points = 4.0;  // times the distance of the points
constexpr double reach_by_scene = 0.25;  // of the distance within which half of the rows lie
constexpr double far_border = 0.9;       // of the reach: from here on, rows are taken for outside if no point says so
// Crossing a border counts as much as so many times the distance between inside and outside points.
constexpr float crossing = 0.3f;
// A row that is so much nearer to one side's points, of both distances together, is that side's for certain.
constexpr float certain = 0.1f;
// How much the distances to both sides' points count against the border: all rows along a line from one to the other
// are worth so many edges in all. With less, the cut through a surface without a border closes around one of the
// points; with more, it does not follow a border that runs far from halfway.
constexpr float leaning = 1.0f;
constexpr double capacity_unit = 1 << 16;  // of a whole edge: the cut is computed in whole numbers

std::vector<double> squared_distances(const Array3& mean, DVec3 from) {
  std::vector<double> out(mean.size());
  parallel_for(mean.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const DVec3 offset = DVec3(mean.get(row)) - from;
      out[row] = glm::dot(offset, offset);
    }
  });
  return out;
}

double distance(DVec3 a, DVec3 b) { return glm::length(a - b); }

/// How far an inside point is from the nearest outside one, on average.
double distance_between(const Grow& grow) {
  double sum = 0;
  for (const DVec3 inside : grow.inside) {
    double least = std::numeric_limits<double>::infinity();
    for (const DVec3 outside : grow.outside) least = std::min(least, distance(inside, outside));
    sum += least;
  }
  return sum / double(grow.inside.size());
}

std::string text(double number) {
  std::ostringstream out;
  out << number;
  return out.str();
}

/// The shortest way from any of `from` to each node, where an edge is as long as `cost` says. Infinite where there is
/// none.
std::vector<float> shortest_ways(const NeighbourGraph& graph, std::span<const float> cost,
                                 std::span<const std::uint32_t> from) {
  using Reached = std::pair<float, std::uint32_t>;
  std::vector<float> way(graph.size(), infinity);
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  for (const std::uint32_t node : from)
    if (way[node] != 0) way[node] = 0, open.emplace(0.0f, node);
  while (!open.empty()) {
    const auto [so_far, node] = open.top();
    open.pop();
    if (so_far > way[node]) continue;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const float there = so_far + cost[edge];
      if (!(there < way[graph.to[edge]])) continue;
      way[graph.to[edge]] = there;
      open.emplace(there, graph.to[edge]);
    }
  }
  return way;
}

/// How a node is drawn to either side before the cut, by the ways to both sides' points: see minimum_cut().
///   spacing  of the node, by the distance between the points
///   is_soft  no point says what is outside
std::int32_t pull_of(float to_inside, float to_outside, float spacing, bool is_soft) {
  if (to_inside == infinity) return certainly_outside;
  if (to_outside == infinity || !(to_inside + to_outside > 0)) return certainly_inside;
  const float share = to_outside / (to_inside + to_outside);
  if (share >= 1 - certain) return certainly_inside;
  if (share <= (is_soft ? 0 : certain)) return certainly_outside;
  return std::int32_t(std::lround(std::min(leaning * spacing, 1.0f) * (2 * share - 1) * float(capacity_unit)));
}

}  // namespace

Surroundings surroundings_of(const Array3& mean, const Grow& grow) {
  const DVec3 middle = grow.inside[0];
  if (grow.reach) return {middle, *grow.reach};
  double farthest = 0, nearest = std::numeric_limits<double>::infinity();
  for (const DVec3 point : grow.inside) farthest = std::max(farthest, distance(middle, point));
  for (const DVec3 point : grow.outside) nearest = std::min(nearest, distance(middle, point));
  if (std::isfinite(nearest)) farthest = std::max(farthest, nearest);
  if (farthest > 0) {
    // By steps, so that the next click rarely asks for other surroundings.
    const double steps = std::ceil(2 * std::log2(reach_by_points * farthest));
    return {middle, std::exp2(steps / 2)};
  }
  std::vector<double> squared = squared_distances(mean, middle);
  const auto half = squared.begin() + std::ptrdiff_t(squared.size() / 2);
  std::nth_element(squared.begin(), half, squared.end());
  // Rows at the very same place as the point: anything above nothing holds them.
  return {middle, std::max(reach_by_scene * std::sqrt(*half), 1e-30)};
}

Neighbourhood::Neighbourhood(const scene::GaussianCloud& cloud, const Surroundings& surroundings)
    : surroundings_(surroundings), farthest_(surroundings.reach), index_({}, 3) {
  const std::vector<double> squared = squared_distances(cloud.mean, surroundings.middle);
  const double limit = surroundings.reach * surroundings.reach;
  for (std::size_t row = 0; row < squared.size(); ++row)
    if (squared[row] <= limit) rows_.push_back(std::uint32_t(row));
  if (rows_.size() > max_neighbourhood) {
    is_cut_short_ = true;
    const auto nearer = [&](std::uint32_t a, std::uint32_t b) {
      return squared[a] != squared[b] ? squared[a] < squared[b] : a < b;
    };
    std::nth_element(rows_.begin(), rows_.begin() + max_neighbourhood, rows_.end(), nearer);
    farthest_ = std::sqrt(squared[rows_[max_neighbourhood]]);
    rows_.resize(max_neighbourhood);
    std::sort(rows_.begin(), rows_.end());
  }
  points_ = points_of(cloud.mean, rows_, surroundings.middle);
  index_ = neighbours::PointIndex(points_, 3);
  graph_ = join_nearest(points_, index_, neighbours_joined);
  similarity_ = similarity_of_edges(cloud, rows_, graph_);
}

Result<Neighbourhood::Seeds> Neighbourhood::seeds_of(const Grow& grow) const {
  if (rows_.empty())
    return fail(ErrorCode::unprocessable, "no Gaussian within " + text(surroundings_.reach) + " of the first point",
                "inside[0]");
  struct Claim {
    float squared_distance;
    bool is_outside;  // of equally near points the inside one wins
    auto operator<=>(const Claim&) const = default;
  };
  std::map<std::uint32_t, Claim> claims;
  const auto claim = [&](DVec3 point, bool is_outside) {
    for (const neighbours::Neighbour& node : index_.nearest(point_of(point, surroundings_.middle), rows_clicked)) {
      const Claim one{node.squared_distance, is_outside};
      const auto [at, is_new] = claims.emplace(node.index, one);
      if (!is_new) at->second = std::min(at->second, one);
    }
  };
  for (std::size_t i = 0; i < grow.inside.size(); ++i) {
    if (const double away = distance(grow.inside[i], surroundings_.middle); away > farthest_)
      return fail(ErrorCode::unprocessable,
                  "the point lies " + text(away) + " from the first one, beyond the reach of " + text(farthest_) +
                      ": grow from it in an operation of its own" + (is_cut_short_ ? "" : ", or raise the reach"),
                  "inside[" + std::to_string(i) + "]");
    claim(grow.inside[i], false);
  }
  for (const DVec3 point : grow.outside)
    if (distance(point, surroundings_.middle) <= farthest_) claim(point, true);
  Seeds seeds;
  for (const auto& [node, one] : claims) (one.is_outside ? seeds.outside : seeds.inside).push_back(node);
  if (seeds.inside.empty())
    return fail(ErrorCode::unprocessable, "all Gaussians around the inside points are nearer to outside ones",
                "inside[0]");
  return seeds;
}

std::vector<std::uint32_t> Neighbourhood::far_nodes() const {
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t node = 0; node < rows_.size(); ++node) {
    const float* at = points_.data() + 3 * node;
    if (glm::length(DVec3(at[0], at[1], at[2])) >= far_border * farthest_) nodes.push_back(node);
  }
  return nodes;
}

Result<std::vector<std::uint32_t>> Neighbourhood::cut(const Grow& grow) const {
  auto seeds = seeds_of(grow);
  if (!seeds) return propagate(seeds);
  const bool is_soft = seeds->outside.empty();
  if (is_soft) seeds->outside = far_nodes();
  // Bounded, so that quotients of floats are numbers.
  const double between = std::clamp(is_soft ? farthest_ : distance_between(grow), 1e-30, 1e30);
  std::vector<float> cost(graph_.to.size());
  for (std::size_t edge = 0; edge < cost.size(); ++edge) {
    const float border = 1 - similarity_[edge];
    cost[edge] = graph_.length[edge] + crossing * float(between) * border * border;
  }
  std::array<std::vector<float>, 2> ways;
  parallel_for(2, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t side = begin; side < end; ++side)
      ways[side] = shortest_ways(graph_, cost, side == 0 ? seeds->inside : seeds->outside);
  });
  std::vector<std::int32_t> pull(rows_.size()), capacity(similarity_.size());
  for (std::size_t edge = 0; edge < capacity.size(); ++edge)
    capacity[edge] = std::int32_t(std::lround(double(similarity_[edge]) * capacity_unit));
  for (std::size_t node = 0; node < pull.size(); ++node)
    pull[node] = pull_of(ways[0][node], ways[1][node], graph_.spacing[node] / float(between), is_soft);
  const std::vector<std::uint8_t> inside = minimum_cut(graph_, capacity, pull);
  std::vector<std::uint32_t> rows;
  for (std::size_t node = 0; node < inside.size(); ++node)
    if (inside[node] != 0) rows.push_back(rows_[node]);
  return rows;
}

}  // namespace engine::select
