#include "engine/select/natural_border.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <iterator>
#include <limits>
#include <numeric>

#include "engine/core/median.h"

namespace engine::select {
namespace {

// How much better a level far from one half has to be: by this, times the square of its log odds. Chosen on the
// captured cases mug, turn, plant and rod, where 0.1 to 1 give about the same, and on the pot of the demo scene, where
// with 0.1 one click too many ends in a selection of the whole table.
constexpr double halfway = 0.3;

// No border counts for less than so many edges within a surface: a few Gaussians of a capture hang together so loosely
// with the rest that they would be things of their own. Chosen on a trained capture of a doll; 3 to 8 make no
// difference to the captured cases, and 20 is too much (turn: recall -12, plant: precision -31).
constexpr double least_border = 8.0;

// Two borders that enclose less than this factor more or fewer nodes are one, a little better here than there. On the
// demo scene's ball 1.15 leaves one border per stripe.
constexpr double apart = 1.15;

constexpr double infinity = std::numeric_limits<double>::infinity();

// Of the usual spacing, and the most of it, that a node counts for: one whose neighbours are all at its place would
// have no border at all, and be a thing of its own; one far off would be more than all the rest.
constexpr double least_spacing = 0.01, most_spacing = 100.0;

/// A graph as borders see it.
struct Terrain {
  const neighbours::NeighbourGraph& graph;
  std::span<const float> weight;
  std::vector<double> root;  ///< [n] Of a node's spacing by the usual one; an edge is as wide as its ends' product.

  /// What an edge adds to a border across it.
  [[nodiscard]] double border(std::uint32_t node, std::uint32_t edge) const {
    return double(weight[edge]) * root[node] * root[graph.to[edge]];
  }
  /// What it adds to what a piece holds.
  [[nodiscard]] double volume(std::uint32_t node, std::uint32_t edge) const {
    return border(node, edge) * root[node] * root[graph.to[edge]];
  }
  /// How much of a surface a node is; 1 where nodes count alike.
  [[nodiscard]] double area(std::uint32_t node) const {
    const double spacing = root[node] * root[node];
    return spacing * spacing;
  }
};

Terrain terrain_of(const neighbours::NeighbourGraph& graph, std::span<const float> weight, bool by_size) {
  Terrain out{graph, weight, std::vector<double>(graph.size(), 1.0)};
  const double usual = by_size && graph.size() > 0 ? double(median(graph.spacing)) : 0.0;
  if (!(usual > 0)) return out;  // most are at one place
  for (std::size_t node = 0; node < graph.size(); ++node)
    out.root[node] = std::sqrt(std::clamp(double(graph.spacing[node]) / usual, least_spacing, most_spacing));
  return out;
}

/// What leaves a piece by the root of what it holds, or of all else if that is less: for a piece of a surface, the same
/// at any size if its border is as good as elsewhere on the surface.
double ratio_of(double leaving, double lesser) {
  return lesser > 0 ? (least_border + std::max(leaving, 0.0)) / std::sqrt(lesser) : 0.0;
}

/// Pieces of a graph whose nodes come one by one, and what the borders of those that clicks are on cost.
class GrowingPieces {
 public:
  ///   clicked  nodes; one that is clicked twice counts twice
  GrowingPieces(const Terrain& terrain, std::span<const std::uint32_t> clicked)
      : terrain_(terrain), pieces_(terrain.graph.size()), is_in_(terrain.graph.size(), 0), of_(terrain.graph.size()) {
    for (std::uint32_t node = 0; node < terrain.graph.size(); ++node) all_ += volume_of(node);
    for (const std::uint32_t node : clicked) ++of_[node].clicks;
    clicks_to_come_ = clicked.size();
  }

  void take(std::uint32_t node) {
    is_in_[node] = 1;
    ++taken_;
    Piece joined = of_[node];
    if (joined.clicks) ++pieces_clicked_;
    clicks_to_come_ -= joined.clicks;
    const neighbours::NeighbourGraph& graph = terrain_.graph;
    joined.volume = volume_of(node);
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
      joined.leaving += terrain_.border(node, edge);
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const std::uint32_t other = graph.to[edge];
      if (is_in_[other] == 0) continue;
      if (const std::uint32_t piece = pieces_.of(other); piece != pieces_.of(node)) {
        sum_ -= border_ratio(of_[piece]);
        if (of_[piece].clicks && joined.clicks) --pieces_clicked_;
        joined.leaving += of_[piece].leaving, joined.volume += of_[piece].volume, joined.clicks += of_[piece].clicks;
        pieces_.join(node, piece);
      }
      joined.leaving -= 2 * terrain_.border(node, edge);
    }
    of_[pieces_.of(node)] = joined;
    sum_ += border_ratio(joined);
  }

  /// The sum of the border ratios of the pieces that clicks are on, each as often as it was clicked, times the number
  /// of these pieces: who clicks on a thing twice means one thing. Infinite before all clicks are taken.
  [[nodiscard]] double cost() const {
    return clicks_to_come_ > 0 ? infinity : double(pieces_clicked_) * std::max(sum_, 0.0);
  }

 private:
  struct Piece {
    double leaving = 0;  ///< Terrain::border() of the edges that leave it.
    double volume = 0;   ///< Terrain::volume() of all edges, both ways.
    std::size_t clicks = 0;
  };
  [[nodiscard]] double volume_of(std::uint32_t node) const {
    double sum = 0;
    for (std::uint32_t edge = terrain_.graph.begin[node]; edge < terrain_.graph.begin[node + 1]; ++edge)
      sum += terrain_.volume(node, edge);
    return sum;
  }
  [[nodiscard]] double border_ratio(const Piece& piece) const {
    if (piece.clicks == 0) return 0;
    // All there is is a thing that stands alone.
    const double lesser = taken_ == is_in_.size() ? piece.volume : std::min(piece.volume, all_ - piece.volume);
    return double(piece.clicks) * ratio_of(piece.leaving, lesser);
  }

  const Terrain& terrain_;
  neighbours::Pieces pieces_;
  std::vector<std::uint8_t> is_in_;
  std::vector<Piece> of_;  ///< By the node that neighbours::Pieces names a piece by; before, a node's clicks.
  std::size_t taken_ = 0, clicks_to_come_ = 0, pieces_clicked_ = 0;
  double all_ = 0, sum_ = 0;
};

/// [n + 1] After so many nodes of the order, what the borders of the pieces that clicks are on cost.
std::vector<double> border_costs(const Terrain& terrain, std::span<const std::uint32_t> order,
                                 std::span<const std::uint32_t> clicked) {
  std::vector<double> out(order.size() + 1, clicked.empty() ? 0.0 : infinity);
  if (clicked.empty()) return out;
  GrowingPieces pieces(terrain, clicked);
  for (std::size_t i = 0; i < order.size(); ++i) {
    pieces.take(order[i]);
    out[i + 1] = pieces.cost();
  }
  return out;
}

double squared_log_odds(double level) {
  constexpr double margin = 1e-4;  // beyond, levels are as good as 0 or 1
  const double inner = std::clamp(level, margin, 1 - margin);
  const double log_odds = std::log(inner / (1 - inner));
  return log_odds * log_odds;
}

/// Nodes from those that are given for the inside, by potential, to those that are given for the outside.
std::vector<std::uint32_t> by_potential(std::span<const double> potential, std::span<const Given> given) {
  std::vector<std::uint32_t> order(potential.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](std::uint32_t node) {
    return given[node] == Given::no ? potential[node] : given[node] == Given::inside ? 2.0 : -1.0;
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const double first = key(a), second = key(b);
    return first != second ? first > second : a < b;
  });
  return order;
}

/// [n + 1] By what the cost of a border counts, after so many nodes of the order: BorderChoice::smallness.
std::vector<double> preferences_for_small(const Terrain& terrain, std::span<const std::uint32_t> order,
                                          double smallness) {
  std::vector<double> out(order.size() + 1, smallness > 0 ? 0.0 : 1.0);
  if (!(smallness > 0)) return out;
  for (std::size_t i = 0; i < order.size(); ++i) out[i + 1] = out[i] + terrain.area(order[i]);
  const double all = out.back();
  for (double& area : out) area = std::pow(area / all, smallness);
  return out;
}

/// A place where the order of nodes may be divided.
struct Level {
  std::size_t taken;  ///< Nodes before it.
  double cost;        ///< Of the border there.
};

std::size_t weakest(std::span<const Level> levels) {
  const auto least =
      std::min_element(levels.begin(), levels.end(), [](const Level& a, const Level& b) { return a.cost < b.cost; });
  return std::size_t(least - levels.begin());
}

/// Ascending, those that cost less than each that encloses up to a factor of `apart` more or fewer nodes; of levels
/// that cost the same the first. The weakest of all is one of them.
std::vector<std::size_t> weaker_than_others(std::span<const Level> levels) {
  std::vector<std::size_t> out;
  std::deque<std::size_t> least;  // of the levels looked at so far and not too far below: costs ascend
  std::size_t next = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double size = double(levels[i].taken);
    for (; next < levels.size() && double(levels[next].taken) <= apart * size; ++next) {
      while (!least.empty() && levels[least.back()].cost > levels[next].cost) least.pop_back();
      least.push_back(next);
    }
    while (double(levels[least.front()].taken) * apart < size) least.pop_front();
    if (least.front() == i) out.push_back(i);
  }
  return out;
}

/// [nodes] 1 for those that are given for the inside.
std::vector<std::uint8_t> marked_inside(std::span<const Given> given) {
  std::vector<std::uint8_t> out(given.size());
  std::ranges::transform(given, out.begin(), [](Given side) { return std::uint8_t(side == Given::inside); });
  return out;
}

/// The border of all that can be reached, where there is no other.
NaturalBorder around_all(std::span<const double> potential, std::span<const Given> given, const BorderChoice& choice) {
  NaturalBorder out{std::vector<std::uint8_t>(potential.size())};
  std::ranges::transform(potential, out.inside.begin(), [](double reached) { return std::uint8_t(reached > 0); });
  if (!choice.beyond) return out;
  const bool is_beyond = std::ranges::count(out.inside, std::uint8_t{1}) > std::ranges::count(given, Given::inside);
  out.less = is_beyond && choice.wider > 0, out.more = is_beyond && choice.wider == 0;
  out.wider = out.less ? 1 : 0;
  if (choice.wider == 0) out.inside = marked_inside(given);
  return out;
}

}  // namespace

NaturalBorder natural_border(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                             std::span<const double> potential, std::span<const Given> given,
                             const ClickedNodes& clicked, const BorderChoice& choice) {
  // Without an end outside, walks end inside from wherever there is a way: what potentials differ by is the solver's.
  const bool can_end_outside = choice.leaks || std::ranges::find(given, Given::outside) != given.end();
  if (!can_end_outside) return around_all(potential, given, choice);
  const std::size_t n = graph.size();
  const std::vector<std::uint32_t> order = by_potential(potential, given);
  const std::vector<std::uint32_t> backwards(order.rbegin(), order.rend());
  const Terrain terrain = terrain_of(graph, weight, choice.whole || choice.beyond);
  const std::vector<double> inside = border_costs(terrain, order, clicked.inside);
  const std::vector<double> outside = border_costs(terrain, backwards, clicked.outside);
  const std::vector<double> small = preferences_for_small(terrain, order, choice.smallness);
  const double preference = choice.leaks || !clicked.outside.empty() ? halfway : 0.0;
  std::vector<Level> levels;
  for (std::size_t taken = 1; taken <= n && given[order[taken - 1]] != Given::outside; ++taken) {
    const double last = potential[order[taken - 1]], next = taken < n ? potential[order[taken]] : 0.0;
    if (last == next || (taken == n && !choice.leaks)) continue;  // both or neither; or nobody knows of an outside
    const double cost =
        (inside[taken] + outside[n - taken]) * (1 + preference * squared_log_odds(0.5 * (last + next))) * small[taken];
    if (cost < infinity) levels.push_back({taken, cost});
  }
  if (levels.empty()) return around_all(potential, given, choice);
  NaturalBorder out{std::vector<std::uint8_t>(n, 0)};
  std::size_t chosen = weakest(levels);
  const std::vector<std::size_t> borders = weaker_than_others(levels);
  if (choice.beyond) {
    const double given_inside = double(std::count(given.begin(), given.end(), Given::inside));
    const auto first = std::find_if(borders.begin(), borders.end(), [&](std::size_t level) {
      return double(levels[level].taken) > apart * given_inside;
    });
    const auto wanted = std::min<std::ptrdiff_t>(choice.wider, borders.end() - first);
    out.wider = int(wanted);
    out.more = wanted < borders.end() - first;
    out.less = wanted > 0;
    if (wanted == 0) {
      out.inside = marked_inside(given);
      return out;
    }
    chosen = first[wanted - 1];
  } else {
    std::size_t at = std::size_t(std::find(borders.begin(), borders.end(), chosen) - borders.begin());
    if (choice.whole)
      for (std::size_t i = at + 1; i < borders.size(); ++i)
        if (levels[borders[i]].cost <= nearly_as_weak * levels[chosen].cost) at = i;
    const auto wanted = std::clamp(std::ptrdiff_t(at) + choice.wider, std::ptrdiff_t{0}, std::ssize(borders) - 1);
    out.wider = int(wanted - std::ptrdiff_t(at));
    out.more = wanted + 1 < std::ssize(borders);
    out.less = wanted > 0;
    chosen = borders[std::size_t(wanted)];
  }
  for (std::size_t i = 0; i < levels[chosen].taken; ++i) out.inside[order[i]] = 1;
  return out;
}

double border_ratio(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                    std::span<const std::uint8_t> inside) {
  const Terrain terrain = terrain_of(graph, weight, true);
  double leaving = 0, volume = 0, all = 0;
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const double held = terrain.volume(node, edge);
      all += held;
      if (inside[node] == 0) continue;
      volume += held;
      if (inside[graph.to[edge]] == 0) leaving += terrain.border(node, edge);
    }
  // All there is is a thing that stands alone, as above.
  return ratio_of(leaving, volume < all ? std::min(volume, all - volume) : volume);
}

double area_of(const neighbours::NeighbourGraph& graph, std::span<const std::uint8_t> inside) {
  const Terrain terrain = terrain_of(graph, {}, true);
  double area = 0;
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    if (inside[node] != 0) area += terrain.area(node);
  return area;
}

}  // namespace engine::select
