#include "engine/deform/body.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/core/svd.h"
#include "engine/deform/path.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"

namespace engine::deform {
namespace {

constexpr std::size_t grain = 1024;           // rows of a parallel task
constexpr std::size_t neighbours_joined = 8;  // the next ring of a surface
// Share of the body's size up to which its rim counts as near to a handle, and goes with it.
constexpr double near_handle = 0.25;
// Of the body's size: what moves less stands still, to the bit.
constexpr double still = 1e-7;
// What the singular values of a map may differ from 1 by: nobody sees a Gaussian that much larger.
constexpr double unstretched = 0.02;
// A way is cut into stops at every 30 degrees, and at every half of the body's size: from one to the next, a body knows
// which way it turns.
constexpr double stop_angle = std::numbers::pi / 6, stop_way = 0.5;
constexpr double most_stops = 24;

/// Where a node goes, with what is around it.
struct NodeMotion {
  DVec3 rest{0.0}, shift{0.0};
  DMat3 map{1.0};
  bool moves = false;
};

std::vector<NodeMotion> motions_of(const elastic::Graph& graph, const elastic::Pose& pose, double least) {
  const std::vector<DMat3> maps = elastic::linear_maps(graph, pose);
  std::vector<NodeMotion> out(graph.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const DVec3 shift = pose.position[i] - graph.rest[i];
    double bends = 0;
    for (int column = 0; column < 3; ++column) {
      DVec3 off = maps[i][column];
      off[column] -= 1;
      bends = std::max(bends, glm::length(off));
    }
    out[i].rest = graph.rest[i];
    if (glm::length(shift) < least && bends < still) continue;
    out[i] = {graph.rest[i], shift, maps[i], true};
  }
  return out;
}

double smoothstep(double t) { return t * t * (3 - 2 * t); }

/// Is the map a rotation, but for what nobody sees?
bool only_turns(const DMat3& map, const DQuat& turn) {
  const DMat3 stretch = glm::transpose(glm::mat3_cast(turn)) * map;
  double off = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) off = std::max(off, std::abs(stretch[column][row] - (column == row ? 1 : 0)));
  return off < unstretched;
}

}  // namespace

Body::Body(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, std::span<const Drag> drags,
           std::span<const std::uint8_t> held)
    : rows_(rows.begin(), rows.end()), drags_(drags.begin(), drags.end()), held_(held.begin(), held.end()) {
  assert(!rows.empty() && held.size() == rows.size());
  for (const std::uint32_t row : rows_) means_.push_back(cloud.mean.get(row));
  DVec3 low(cloud.mean.get(rows[0])), high(low);
  for (const std::uint32_t row : rows_) {
    const DVec3 mean(cloud.mean.get(row));
    low = glm::min(low, mean), high = glm::max(high, mean);
  }
  origin_ = 0.5 * (low + high);
  size_ = std::max({high.x - low.x, high.y - low.y, high.z - low.z});

  const std::vector<float> points = neighbours::points_of(cloud.mean, rows_, origin_);
  const neighbours::PointIndex index(points, 3);
  const neighbours::NeighbourGraph joined =
      neighbours::join_nearest(points, index, neighbours_joined, /*bridged=*/false);
  std::vector<std::uint32_t> nearest;  // row (of these) to each handle
  for (const Drag& drag : drags)
    nearest.push_back(index.nearest(neighbours::point_of(drag.source, origin_), 1)[0].index);
  embedding_ = elastic::embed(points, joined, nearest);

  grip(joined, nearest, drags);
  hold(joined, nearest, drags, held);
  solver_ = std::make_unique<elastic::Solver>(embedding_.graph, grips_);
}

bool Body::is_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, std::span<const Drag> drags,
                 std::span<const std::uint8_t> held) const {
  const auto is_same_drag = [](const Drag& a, const Drag& b) {
    return a.source == b.source && a.anchor == b.anchor && a.grip == b.grip;
  };
  if (!std::ranges::equal(rows, rows_) || !std::ranges::equal(held, held_) ||
      !std::ranges::equal(drags, drags_, is_same_drag))
    return false;
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (cloud.mean.get(rows[k]) != means_.get(k)) return false;
  return true;
}

void Body::grip(const neighbours::NeighbourGraph& joined, std::span<const std::uint32_t> nearest,
                std::span<const Drag> drags) {
  const std::size_t nodes = embedding_.graph.size();
  std::vector<std::uint32_t> node_at(rows_.size(), std::uint32_t(nodes));  // node that sits on a row
  for (std::uint32_t node = 0; node < nodes; ++node) node_at[embedding_.point_of[node]] = node;
  // Each node goes with the handle nearest to it along the body; the one under a handle is its own.
  std::vector<std::tuple<double, std::size_t, std::uint32_t>> reached;
  for (std::size_t d = 0; d < drags.size(); ++d) {
    reached.emplace_back(-1, d, embedding_.cell[nearest[d]]);
    for (const auto& [row, distance] : elastic::points_within(joined, nearest[d], drags[d].grip))
      if (node_at[row] < nodes) reached.emplace_back(distance, d, node_at[row]);
  }
  std::sort(reached.begin(), reached.end());
  gripped_.assign(nodes, 0);
  std::vector<std::vector<std::uint32_t>> nodes_of(drags.size());
  for (const auto& [distance, d, node] : reached)
    if (!std::exchange(gripped_[node], std::uint8_t{1})) nodes_of[d].push_back(node);
  for (std::size_t d = 0; d < drags.size(); ++d) {
    if (nodes_of[d].empty()) continue;  // its node is another handle's: two in one place
    if (!drags[d].anchor) add_grip(std::move(nodes_of[d]), drags[d].source - origin_, int(d));
    // Of an anchor each node for itself: a body may turn about a single point, as on a hinge.
    for (const std::uint32_t node : drags[d].anchor ? nodes_of[d] : std::vector<std::uint32_t>())
      add_grip({node}, embedding_.graph.rest[node], int(d));
  }
}

void Body::hold(const neighbours::NeighbourGraph& joined, std::span<const std::uint32_t> nearest,
                std::span<const Drag> drags, std::span<const std::uint8_t> held) {
  if (std::ranges::find(held, 1) == held.end()) return;
  std::vector<std::uint8_t> released(rows_.size(), 0);
  for (std::size_t d = 0; d < drags.size(); ++d)
    if (!drags[d].anchor)
      for (const auto& [row, distance] :
           elastic::points_within(joined, nearest[d], std::max(drags[d].grip, near_handle * size_)))
        released[row] = 1;
  std::vector<std::uint32_t> rim;
  for (std::uint32_t k = 0; k < rows_.size(); ++k)
    if (held[k] && !released[k]) rim.push_back(k);
  if (rim.empty()) return;
  for (const double distance : elastic::distances_to(joined, rim))
    freedom_.push_back(distance < embedding_.spacing ? float(smoothstep(distance / embedding_.spacing))
                                                     : float(distance > 0));
  for (const std::uint32_t k : rim)
    if (const std::uint32_t node = embedding_.cell[k]; !std::exchange(gripped_[node], std::uint8_t{1}))
      add_grip({node}, embedding_.graph.rest[node], -1);
}

void Body::add_grip(std::vector<std::uint32_t> nodes, DVec3 source, int drag) {
  grips_.push_back({std::move(nodes), source});
  drag_of_grip_.push_back(drag);
}

std::vector<std::vector<elastic::GripPose>> Body::way_of(std::span<const Drag> drags) const {
  const Path path(drags);
  double longest = 0;
  for (const Drag& drag : drags)
    if (!drag.anchor) longest = std::max(longest, glm::distance(drag.source, drag.target));
  double stops = std::ceil(path.farthest_turn() / stop_angle);
  if (size_ > 0) stops = std::max(stops, std::ceil(longest / (stop_way * size_)));
  stops = std::clamp(stops, 1.0, most_stops);
  std::vector<std::vector<elastic::GripPose>> way;
  for (int stop = 1; stop <= int(stops); ++stop) {
    const double part = double(stop) / stops;
    std::vector<elastic::GripPose>& poses = way.emplace_back();
    for (std::size_t k = 0; k < grips_.size(); ++k) {
      const int d = drag_of_grip_[k];
      if (d < 0)
        poses.push_back({grips_[k].source, DQuat(1, 0, 0, 0), 1});
      else if (const auto drag = std::size_t(d); drags[drag].anchor)
        poses.push_back({grips_[k].source, std::nullopt, 1});
      else
        poses.push_back({path.position(drag, part) - origin_, path.turn(drag, part), path.scale(drag, part)});
    }
  }
  return way;
}

Deformation Body::follow(const scene::GaussianCloud& cloud, std::span<const Drag> drags) const {
  return carry(cloud, solver_->solve(way_of(drags)));
}

Deformation Body::draw_out(const scene::GaussianCloud& cloud, std::span<const Drag> drags, DVec3 pull) const {
  const elastic::Graph& graph = embedding_.graph;
  const DVec3 along = glm::normalize(pull);
  double level = std::numeric_limits<double>::infinity();
  for (const Drag& drag : drags)
    if (!drag.anchor) level = std::min(level, glm::dot(drag.source - origin_, along));
  std::vector<std::uint32_t> staying, going;
  for (std::size_t k = 0; k < grips_.size(); ++k) {
    const bool stays = drag_of_grip_[k] < 0 || drags[std::size_t(drag_of_grip_[k])].anchor;
    std::vector<std::uint32_t>& nodes = stays ? staying : going;
    nodes.insert(nodes.end(), grips_[k].nodes.begin(), grips_[k].nodes.end());
  }
  for (std::uint32_t i = 0; i < graph.size(); ++i)
    if (!gripped_[i] && glm::dot(graph.rest[i], along) >= level) going.push_back(i);
  const std::vector<double> behind = elastic::distances_to(graph, staying), ahead = elastic::distances_to(graph, going);
  elastic::Pose pose{graph.rest, std::vector<DQuat>(graph.size(), DQuat(1, 0, 0, 0)),
                     std::vector<double>(graph.size(), 1.0)};
  for (std::size_t i = 0; i < graph.size(); ++i) {
    // Nothing stays, or two nodes in one place: it goes, or it stays, whole.
    const double way = behind[i] + ahead[i];
    const double share = staying.empty() ? 1 : way > 0 ? behind[i] / way : 0;
    pose.position[i] += share * pull;
  }
  return carry(cloud, pose);
}

Deformation Body::carry(const scene::GaussianCloud& cloud, const elastic::Pose& pose) const {
  const std::vector<NodeMotion> nodes = motions_of(embedding_.graph, pose, still * size_);
  Deformation out = at_rest(cloud, rows_);
  parallel_for(rows_.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const Vec3 old_mean = out.mean.get(k);
      const Quat old_rotation = out.rotation.get(k);
      const DVec3 point = DVec3(old_mean) - origin_;
      DVec3 shift(0.0);
      DMat3 map(0.0);
      double sum = 0;
      bool moves = false;
      for (std::uint32_t at = embedding_.begin[k]; at < embedding_.begin[k + 1]; ++at) {
        const NodeMotion& node = nodes[embedding_.node[at]];
        const double weight = double(embedding_.weight[at]);
        const DVec3 arm = point - node.rest;
        shift += weight * (node.shift + (node.map * arm - arm));
        map += weight * node.map;
        sum += weight;
        moves = moves || node.moves;
      }
      if (!moves) continue;
      map /= sum;
      const double freedom = freedom_.empty() ? 1 : double(freedom_[k]);
      if (freedom == 0) continue;
      map = DMat3(1.0) + freedom * (map - DMat3(1.0));
      const Vec3 mean(DVec3(old_mean) + freedom / sum * shift);
      out.mean.set(k, mean);
      out.map[k] = map;
      out.turn[k] = nearest_rotation(map);
      out.stretches[k] = !only_turns(map, out.turn[k]);
      const Quat rotation(out.turn[k] * DQuat(old_rotation));
      out.rotation.set(k, rotation);
      out.moves[k] = mean != old_mean || rotation != old_rotation || out.stretches[k];
    }
  });
  return out;
}

}  // namespace engine::deform
