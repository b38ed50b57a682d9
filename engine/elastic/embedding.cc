#include "engine/elastic/embedding.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <unordered_map>
#include <utility>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/neighbours/point_index.h"

namespace engine::elastic {
namespace {

using neighbours::NeighbourGraph;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t grain = 4'096;  // points of a parallel task: a choice
// A piece of fewer points, or of less than this share of all, has no nodes of its own: noise of a capture.
constexpr std::size_t least_points = 24;
constexpr double least_share = 0.002;
// How far a node has a say, in distances at which every point has a node. The next nodes are one to two of them away.
constexpr double reach = 1.7;
// Of an edge's weight: joins what touches at a single pair of points, and what does not touch at all.
constexpr double least_weight = 0.02;

/// Do the ends of an edge hang together? What merely has no nearer neighbours does not. Times the closer spacing of the
/// two: where dense and sparse parts of a surface meet, edges are up to about this long.
bool holds(const NeighbourGraph& joined, std::uint32_t i, std::uint32_t edge) {
  constexpr float longest = 4;
  return joined.length[edge] <= longest * std::min(joined.spacing[i], joined.spacing[joined.to[edge]]);
}

DVec3 at(std::span<const float> points, std::uint32_t i) {
  return {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
}

/// A connection between two pieces that do not hang together.
struct Link {
  std::uint32_t a, b;
};

/// The points in pieces that have nodes, and what joins the pieces to each other.
struct Parts {
  std::vector<std::uint8_t> counts;  ///< [N] 1: its piece has nodes.
  std::vector<Link> links;           ///< Between pieces with nodes: all of them hang together so.
  std::vector<Link> followers;       ///< From each other point (a) to the nearest one that counts (b).
};

std::vector<float> gathered(std::span<const float> points, std::span<const std::uint32_t> which) {
  std::vector<float> out;
  out.reserve(3 * which.size());
  for (const std::uint32_t i : which) out.insert(out.end(), points.begin() + 3 * i, points.begin() + 3 * i + 3);
  return out;
}

/// The nearest of some points.
class Nearest {
 public:
  Nearest(std::span<const float> points, std::vector<std::uint32_t> among)
      : points_(points), among_(std::move(among)), index_(gathered(points, among_), 3) {}

  /// From each of `from`, and the squared distance.
  [[nodiscard]] std::vector<std::pair<Link, float>> links_from(std::span<const std::uint32_t> from) const {
    const auto found = index_.nearest(gathered(points_, from), 1);
    std::vector<std::pair<Link, float>> out;
    for (std::size_t k = 0; k < from.size(); ++k)
      out.push_back({{from[k], among_[found[k].index]}, found[k].squared_distance});
    return out;
  }

 private:
  std::span<const float> points_;
  std::vector<std::uint32_t> among_;
  neighbours::PointIndex index_;
};

Parts find_parts(std::span<const float> points, const NeighbourGraph& joined) {
  const std::size_t n = joined.size();
  neighbours::Pieces pieces(n);
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t edge = joined.begin[i]; edge < joined.begin[i + 1]; ++edge)
      if (holds(joined, i, edge)) pieces.join(i, joined.to[edge]);
  const std::vector<std::uint32_t> sizes = pieces.sizes();
  const std::uint32_t largest = *std::max_element(sizes.begin(), sizes.end());
  const auto least = std::min(std::size_t(largest), std::max(least_points, std::size_t(least_share * double(n))));
  std::vector<std::uint32_t> named;  // pieces with nodes, the largest first
  for (std::uint32_t i = 0; i < n; ++i)
    if (sizes[i] >= least) named.push_back(i);
  std::stable_sort(named.begin(), named.end(), [&](std::uint32_t a, std::uint32_t b) { return sizes[a] > sizes[b]; });

  Parts parts{std::vector<std::uint8_t>(n, 0), {}, {}};
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> members;
  std::vector<std::uint32_t> strays;
  for (std::uint32_t i = 0; i < n; ++i) {
    parts.counts[i] = sizes[pieces.of(i)] >= least;
    if (parts.counts[i])
      members[pieces.of(i)].push_back(i);
    else
      strays.push_back(i);
  }
  // A piece is joined to the nearest of the larger ones; of very many, to the nearest of the largest, as each of them
  // would take an index of its own.
  constexpr std::size_t most_indices = 16;
  std::vector<std::uint32_t> together = members[named.front()];
  std::optional<Nearest> nearest;
  for (std::size_t k = 1; k < named.size(); ++k) {
    const std::vector<std::uint32_t>& piece = members[named[k]];
    if (k <= most_indices) nearest.emplace(points, together);
    const auto links = nearest->links_from(piece);
    parts.links.push_back(std::min_element(links.begin(), links.end(), [](const auto& one, const auto& other) {
                            return one.second < other.second;
                          })->first);
    together.insert(together.end(), piece.begin(), piece.end());
  }
  if (!strays.empty())
    for (const auto& [link, distance] : Nearest(points, together).links_from(strays)) parts.followers.push_back(link);
  return parts;
}

/// What Dijkstra's queue holds: nearest first, of equally near ones the lower index.
using Reached = std::pair<double, std::uint32_t>;
using Queue = std::priority_queue<Reached, std::vector<Reached>, std::greater<>>;

/// Goes on along the body from what is in the queue, nearest first (Dijkstra 1959).
///   is_known  (point, distance): it is in the queue with a shorter way, too
///   go_to     (point, distance): a way there; queues it if it is the shortest so far
template <class IsKnown, class GoTo>
void walk(const NeighbourGraph& joined, Queue& queue, IsKnown&& is_known, GoTo&& go_to) {
  while (!queue.empty()) {
    const auto [distance, i] = queue.top();
    queue.pop();
    if (is_known(i, distance)) continue;
    for (std::uint32_t edge = joined.begin[i]; edge < joined.begin[i + 1]; ++edge)
      if (holds(joined, i, edge)) go_to(joined.to[edge], distance + double(joined.length[edge]));
  }
}

/// Distances along the body from the nodes chosen so far, and whose they are.
class Cells {
 public:
  Cells(const NeighbourGraph& joined, const Parts& parts)
      : joined_(joined), parts_(parts), distance_(joined.size(), infinity), cell_(joined.size(), 0) {}

  void add_node(std::uint32_t point) {
    const auto node = std::uint32_t(nodes_.size());
    nodes_.push_back(point);
    const auto reach_for = [&](std::uint32_t i, double distance) {
      if (!(distance < distance_[i])) return;
      distance_[i] = distance, cell_[i] = node;
      queue_.push({distance, i});
    };
    reach_for(point, 0);
    walk(
        joined_, queue_, [&](std::uint32_t i, double distance) { return distance > distance_[i]; }, reach_for);
  }
  /// The point farthest from every node, the lowest of equally far ones; infinitely far if no node is on its piece.
  [[nodiscard]] Reached farthest() const {
    Reached best{-1, 0};
    for (std::uint32_t i = 0; i < distance_.size(); ++i)
      if (parts_.counts[i] && distance_[i] > best.first) best = {distance_[i], i};
    return best;
  }
  [[nodiscard]] const std::vector<std::uint32_t>& nodes() const { return nodes_; }
  [[nodiscard]] std::vector<std::uint32_t>& cell() { return cell_; }

 private:
  const NeighbourGraph& joined_;
  const Parts& parts_;
  std::vector<double> distance_;
  std::vector<std::uint32_t> cell_, nodes_;
  Queue queue_;
};

/// Pairs of nodes, lower first, and how many pairs of points join their cells; 0 for a link.
std::vector<std::pair<Link, double>> contacts_of(const NeighbourGraph& joined, const Parts& parts,
                                                 std::span<const std::uint32_t> cell) {
  std::vector<std::uint64_t> pairs;
  const auto key = [&](std::uint32_t a, std::uint32_t b) {
    return std::uint64_t(std::min(a, b)) << 32 | std::max(a, b);
  };
  for (std::uint32_t i = 0; i < joined.size(); ++i) {
    if (!parts.counts[i]) continue;
    for (std::uint32_t edge = joined.begin[i]; edge < joined.begin[i + 1]; ++edge)
      if (i < joined.to[edge] && holds(joined, i, edge) && cell[i] != cell[joined.to[edge]])
        pairs.push_back(key(cell[i], cell[joined.to[edge]]));
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<std::uint64_t> linked;
  for (const Link& link : parts.links) linked.push_back(key(cell[link.a], cell[link.b]));
  std::sort(linked.begin(), linked.end());
  linked.erase(std::unique(linked.begin(), linked.end()), linked.end());

  std::vector<std::pair<Link, double>> out;
  const auto add = [&](std::uint64_t pair, double count) {
    out.push_back({{std::uint32_t(pair >> 32), std::uint32_t(pair)}, count});
  };
  for (std::size_t first = 0, last = 0; first < pairs.size(); first = last) {
    while (last < pairs.size() && pairs[last] == pairs[first]) ++last;
    add(pairs[first], double(last - first));
  }
  for (const std::uint64_t pair : linked)
    if (!std::binary_search(pairs.begin(), pairs.end(), pair)) add(pair, 0);
  return out;
}

Graph graph_of(std::span<const float> points, std::span<const std::uint32_t> nodes,
               std::span<const std::pair<Link, double>> contacts) {
  Graph graph;
  for (const std::uint32_t point : nodes) graph.rest.push_back(at(points, point));
  // As broad as most contacts are is as much as a contact counts.
  std::vector<double> counts;
  for (const auto& [pair, count] : contacts)
    if (count > 0) counts.push_back(count);
  const double usual = counts.empty() ? 1 : median(std::move(counts));
  struct Edge {
    std::uint32_t from, to;
    double weight;
  };
  std::vector<Edge> edges;
  for (const auto& [pair, count] : contacts) {
    const double weight = std::clamp(count / usual, least_weight, 1.0);
    edges.push_back({pair.a, pair.b, weight}), edges.push_back({pair.b, pair.a, weight});
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& one, const Edge& other) {
    return std::pair(one.from, one.to) < std::pair(other.from, other.to);
  });
  graph.begin.assign(nodes.size() + 1, 0);
  for (const Edge& edge : edges) {
    ++graph.begin[edge.from + 1];
    graph.to.push_back(edge.to), graph.weight.push_back(edge.weight);
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) graph.begin[i + 1] += graph.begin[i];
  return graph;
}

double mean_length(const Graph& graph) {
  double sum = 0;
  for (std::uint32_t i = 0; i < graph.size(); ++i)
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge)
      sum += glm::distance(graph.rest[i], graph.rest[graph.to[edge]]);
  return graph.to.empty() ? 0 : sum / double(graph.to.size());
}

/// The node itself, those joined to it, and those joined to these, ascending.
std::vector<std::uint32_t> two_rings(const Graph& graph, std::uint32_t node) {
  std::vector<std::uint32_t> out{node};
  for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
    const std::uint32_t near = graph.to[edge];
    out.push_back(near);
    out.insert(out.end(), graph.to.begin() + graph.begin[near], graph.to.begin() + graph.begin[near + 1]);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

/// Which nodes each point follows, and how much.
///   spacing  every point that hangs together has a node this near; 0: each is one
void let_points_follow(std::span<const float> points, double spacing, Embedding& out) {
  const std::size_t n = out.cell.size();
  std::vector<std::vector<std::uint32_t>> rings(out.graph.size());
  for (std::uint32_t node = 0; node < rings.size(); ++node) rings[node] = two_rings(out.graph, node);
  struct Follows {
    std::vector<std::uint32_t> node;
    std::vector<float> weight;
    std::vector<std::uint32_t> count;
  };
  std::vector<Follows> parts(chunk_count(n, grain));
  parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
    Follows& part = parts[begin / grain];
    std::vector<std::pair<std::uint32_t, double>> found;
    for (std::size_t i = begin; i < end; ++i) {
      const DVec3 point = at(points, std::uint32_t(i));
      // A point may be nearer along the body to a node than in a straight line to any other; and what merely goes
      // along, far off, has its node nevertheless.
      const double own = glm::distance(point, out.graph.rest[out.cell[i]]);
      const double farthest = reach * std::max(spacing, own / 1.5);
      double sum = 0;
      found.clear();
      for (const std::uint32_t node : rings[out.cell[i]]) {
        const double distance = glm::distance(point, out.graph.rest[node]);
        const double share = node == out.cell[i] ? own / std::max(farthest, 1e-300) : distance / farthest;
        if (!(share < 1)) continue;  // also NaN: nothing but a point's own node, where it is one itself
        const double weight = (1 - share * share) * (1 - share * share);
        if (weight < 1e-6) continue;  // nobody would see it
        found.push_back({node, weight});
        sum += weight;
      }
      part.count.push_back(std::uint32_t(found.size()));
      for (const auto& [node, weight] : found) part.node.push_back(node), part.weight.push_back(float(weight / sum));
    }
  });
  out.begin.assign(1, 0);
  for (const Follows& part : parts) {
    for (const std::uint32_t count : part.count) out.begin.push_back(out.begin.back() + count);
    out.node.insert(out.node.end(), part.node.begin(), part.node.end());
    out.weight.insert(out.weight.end(), part.weight.begin(), part.weight.end());
  }
}

}  // namespace

Embedding embed(std::span<const float> points, const neighbours::NeighbourGraph& joined,
                std::span<const std::uint32_t> seeds, const EmbeddingOptions& options) {
  assert(joined.size() > 0 && points.size() == 3 * joined.size() && options.nodes > 0);
  const Parts parts = find_parts(points, joined);
  std::vector<std::uint32_t> counting(joined.size());  // itself, or the point that a stray one goes along with
  for (std::uint32_t i = 0; i < counting.size(); ++i) counting[i] = i;
  for (const Link& link : parts.followers) counting[link.a] = link.b;

  Cells cells(joined, parts);
  for (const std::uint32_t seed : seeds) {
    const std::uint32_t point = counting[seed];
    if (cells.nodes().size() < options.nodes && std::ranges::find(cells.nodes(), point) == cells.nodes().end())
      cells.add_node(point);
  }
  Reached farthest = cells.farthest();
  // A piece without any node would follow none, so that each has one, even where that makes more nodes than asked for.
  while (farthest.first > 0 && (cells.nodes().size() < options.nodes || farthest.first == infinity)) {
    cells.add_node(farthest.second);
    farthest = cells.farthest();
  }
  Embedding out;
  out.point_of = cells.nodes();
  for (const Link& link : parts.followers) cells.cell()[link.a] = cells.cell()[link.b];
  out.graph = graph_of(points, out.point_of, contacts_of(joined, parts, cells.cell()));
  out.cell = std::move(cells.cell());
  out.spacing = mean_length(out.graph);
  let_points_follow(points, farthest.first, out);
  return out;
}

std::vector<Near> points_within(const neighbours::NeighbourGraph& joined, std::uint32_t point, double distance) {
  std::unordered_map<std::uint32_t, double> nearest;
  std::vector<Near> out;
  Queue queue;
  const auto reach_for = [&](std::uint32_t i, double there) {
    if (there > distance) return;
    const auto [known, is_new] = nearest.try_emplace(i, there);
    if (!is_new && !(there < known->second)) return;
    known->second = there;
    queue.push({there, i});
  };
  const auto settle = [&](std::uint32_t i, double so_far) {
    const bool is_known = so_far > nearest[i];
    if (!is_known) out.push_back({i, so_far});
    return is_known;
  };
  reach_for(point, 0);
  walk(joined, queue, settle, reach_for);
  return out;
}

std::vector<double> distances_to(const NeighbourGraph& joined, std::span<const std::uint32_t> points) {
  std::vector<double> nearest(joined.size(), infinity);
  Queue queue;
  const auto reach_for = [&](std::uint32_t i, double there) {
    if (there < nearest[i]) nearest[i] = there, queue.push({there, i});
  };
  for (const std::uint32_t point : points) reach_for(point, 0);
  walk(
      joined, queue, [&](std::uint32_t i, double so_far) { return so_far > nearest[i]; }, reach_for);
  return nearest;
}

std::vector<double> distances_to(const Graph& graph, std::span<const std::uint32_t> nodes) {
  std::vector<double> nearest(graph.size(), infinity);
  Queue queue;
  for (const std::uint32_t node : nodes) nearest[node] = 0, queue.push({0, node});
  while (!queue.empty()) {
    const auto [so_far, i] = queue.top();
    queue.pop();
    if (so_far > nearest[i]) continue;
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge) {
      const std::uint32_t j = graph.to[edge];
      const double there = so_far + glm::distance(graph.rest[i], graph.rest[j]);
      if (there < nearest[j]) nearest[j] = there, queue.push({there, j});
    }
  }
  return nearest;
}

}  // namespace engine::elastic
