// Where a thing ends: the border across which hardly anything is joined.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/random_walk.h"

namespace engine::select {

/// Nodes that were clicked on, one per click.
struct ClickedNodes {
  std::vector<std::uint32_t> inside, outside;
};

/// So much may the border of the whole cost, by the weakest one's. From a click on the demo scene's ball, the whole
/// ball costs 1.01 to 1.26 of its cheapest stripes. With 2 a click on the mug takes all that is around it.
constexpr double nearly_as_weak = 1.5;

/// Which of the natural borders is meant.
struct BorderChoice {
  /// Of the borders that are nearly as weak as the weakest, the farthest out: of a ball with stripes the ball, where a
  /// stripe ends as sharply as it does.
  bool whole = false;
  int wider = 0;  ///< So many borders farther out than that; below 0: farther in.
  /// Counted from what is given for the inside, of which there is some: 0 is just that, and 1 the first border that
  /// encloses somewhat more. `whole` has no meaning then, nor has `wider` below 0.
  bool beyond = false;
  /// The walk leaked: its potentials say what is outside without a click there.
  bool leaks = false;
  /// 0 or more: costs count times what a level encloses, as a share of all, to this power. Whoever clicks here and
  /// there on a thing would, on a larger one, have clicked elsewhere as well.
  double smallness = 0;
};

/// A border, and what is within.
struct NaturalBorder {
  std::vector<std::uint8_t> inside;  ///< [nodes] 1: inside.
  int wider = 0;                     ///< As chosen; nearer to 0 where there are fewer borders on that side.
  bool more = false;                 ///< There is one farther out than this.
  bool less = false;                 ///< There is one farther in; with `beyond`, what is given counts as one.
};

/// Divides the graph at a level of the potentials: nodes at or above it are inside. Of all levels the one where the
/// pieces that the clicks are on, inside and outside, are joined to the rest most weakly: on either side, the sum, over
/// the clicks, of a piece's border ratio, times the number of these pieces. The border ratio is the weight of the edges
/// that leave a piece, and a few more, by the root of that of all its nodes' edges or of all others', whichever is
/// less. On a surface, a border grows as the root of what it encloses: so neither large pieces are preferred nor small
/// ones, as they are by conductance, which divides by the weight itself. For the whole, and beyond, nodes count by
/// their size: an edge by its width, the geometric mean of its ends' spacings, for a border, and by the square of it
/// for what is enclosed, as on a surface: a wall's few large Gaussians are much, and their long border is no short one.
/// Where there are clicks on both sides, or the walk leaked, levels near one half are preferred a little: it decides
/// where nothing else does; smaller ones, as much as is asked for. Where nothing is given for the outside and the walk
/// did not leak, all that can be reached is inside. Farther out and in there are other borders: levels that are joined
/// more weakly than any that enclose somewhat more or less.
///   weight     [edges] 0 or more, the same both ways
///   potential  [nodes] of random_walk()
///   given      [nodes]; clicked nodes are given for their side
/// Source: sweeps over level sets, Andersen, Chung and Lang 2006, "Local graph partitioning using PageRank vectors";
/// that examples speak for the smallest set that holds them, the more of them the more, Tenenbaum and Griffiths 2001,
/// "Generalization, similarity, and Bayesian inference" (the size principle; theirs is the power of their number); the
/// ratio, and that outside pieces count alike, are ours.
[[nodiscard]] NaturalBorder natural_border(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                                           std::span<const double> potential, std::span<const Given> given,
                                           const ClickedNodes& clicked, const BorderChoice& choice = {});

/// The border ratio of these nodes, which count by their size: what their borders cost as a whole. 0 for none.
///   weight  [edges] 0 or more, the same both ways
///   inside  [nodes] 1: inside
[[nodiscard]] double border_ratio(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                                  std::span<const std::uint8_t> inside);

/// How much of a surface these nodes are: each counts as the square of its spacing by the usual one.
///   inside  [nodes] 1: inside
[[nodiscard]] double area_of(const neighbours::NeighbourGraph& graph, std::span<const std::uint8_t> inside);

}  // namespace engine::select
