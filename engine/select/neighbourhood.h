// Growing: from a few points on a thing to all of its rows, up to its natural border.
// Source: Grady 2006, "Random walks for image segmentation", for who belongs to which point; Andersen, Chung and Lang
// 2006, "Local graph partitioning using PageRank vectors", for sweeping over levels to where a piece ends by itself. On
// Gaussians in place of pixels, the terms are ours (docs/adr/0018-growing-walks-to-natural-borders.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/natural_border.h"
#include "engine/select/operation.h"
#include "engine/select/random_walk.h"

namespace engine::select {

/// What growing looks at. A function of the scene, of inside[0] and, by steps, of the distances of the other points, so
/// that while a user clicks on, it mostly stays as it is.
struct Surroundings {
  DVec3 middle{0.0};  ///< inside[0]
  double reach = 0;   ///< World units: rows at most so far from the middle.
  bool operator==(const Surroundings&) const = default;
};

/// So many of the rows within reach are nodes at most, and stand for the others. A first click then takes 0.8 s of one
/// core, and half a second more for each million rows; the next ones half as long; one that means the whole walks three
/// times. One outside walks once more where it would make more of the thing.
constexpr std::size_t max_nodes = 100'000;

/// The surroundings of an operation. Without a reach: a quarter of the distance within which half of the scene's rows
/// lie; or four times as far as the farthest inside point, or as the nearest outside one if that is farther, but not
/// four times as far as half of the rows, rounded up to a power of the square root of 2. The farther of the two. For
/// the whole, 0.8 of the distance within which half of the rows lie takes the place of a quarter of it.
/// Precondition: validate() holds, and the scene has a row.
[[nodiscard]] Surroundings surroundings_of(const Array3& mean, const Grow& grow);

/// The surroundings of rows: half as far again from their middle as nearly all of them lie, rounded up as above. None
/// without a row.
///   rows  [N] 1 for each of them
[[nodiscard]] std::optional<Surroundings> surroundings_of(const Array3& mean, std::span<const std::uint8_t> rows);

/// What grows.
struct Grown {
  std::vector<std::uint32_t> rows;  ///< Of the cloud, ascending.
  int wider = 0;      ///< Grow::wider, or nearer to 0 where there are fewer borders: NaturalBorder::wider.
  bool more = false;  ///< NaturalBorder::more, within the surroundings.
  bool less = false;  ///< NaturalBorder::less
};

/// The rows around a point, joined to their neighbours by edges that are the weaker the more likely a border runs
/// between the two. Of very many, some drawn by chance are the nodes (thinning.h), and each of the others goes where
/// the nearest node goes. Immutable.
class Neighbourhood {
 public:
  /// About 0.4 s for 100,000 rows on one core, 0.8 s for a million (bench/select_bench). Keeps 8 bytes for each row
  /// that is no node.
  Neighbourhood(const scene::GaussianCloud& cloud, const Surroundings& surroundings,
                std::size_t most_nodes = max_nodes);

  [[nodiscard]] const Surroundings& surroundings() const { return surroundings_; }
  /// How many rows are within reach.
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t nodes() const { return nodes_.size(); }

  /// The rows of the thing: those from which a random walk rather ends at the inside points, up to the natural border
  /// (natural_border.h), and its leftovers (leftovers.h) unless outside points are on more than three nodes within
  /// reach, or less than the natural border was asked for. Nodes at the reach are outside unless a point says
  /// otherwise; outside points beyond it count for nothing.
  ///   cloud    that this was made of
  ///   grow     with this object's surroundings
  ///   errors   unprocessable, `where` = "inside[1]": no row within reach, the point is beyond it, or outside points
  ///            cover all rows around the inside points more
  [[nodiscard]] Result<Grown> grow(const scene::GaussianCloud& cloud, const Grow& grow) const;

  /// The same, where rows are inside already: up to the border so many farther out than they end, counted from 1; for 0
  /// just those. All of them stay.
  ///   rows  [any] within reach, ascending, as grow() gave them for the same clicks
  [[nodiscard]] Result<Grown> grow_beyond(const scene::GaussianCloud& cloud, const Grow& grow,
                                          std::span<const std::uint32_t> rows, int farther) const;

  /// What of the rows that inside points have taken is left where outside points are on some of them: up to the natural
  /// border among these rows, without leftovers, and without `wider`, which they have gone by. Ascending; empty where
  /// no outside point is on one of them.
  ///   rows    [any] ascending, as grow() gave them for the inside points alone
  ///   errors  those of grow()
  [[nodiscard]] Result<std::vector<std::uint32_t>> left_of(const scene::GaussianCloud& cloud, const Grow& grow,
                                                           std::span<const std::uint32_t> rows) const;

  /// Of the rows within reach, ascending, those that are given for the inside, and of those that are not given the ones
  /// from which a random walk rather ends there. Where there is no way to either side, they are outside.
  ///   given     [N]
  ///   inclined  [N] 1 for rows that are inside unless six of seven walks from them end outside. Empty: none
  [[nodiscard]] std::vector<std::uint32_t> settle(std::span<const Given> given,
                                                  std::span<const std::uint8_t> inclined = {}) const;

  /// Is an outside point on one of these rows, or can nobody tell?
  ///   rows  [any] ascending
  [[nodiscard]] bool may_be_on(const scene::GaussianCloud& cloud, const Grow& grow,
                               std::span<const std::uint32_t> rows) const;

  /// How much of a surface these rows are (natural_border.h).
  ///   rows  [any] ascending; those out of reach do not count
  [[nodiscard]] double area(std::span<const std::uint32_t> rows) const;

  /// How well these rows are a thing of their own, by all that is looked at: the less the better (natural_border.h).
  ///   rows  [any] ascending; those out of reach do not count
  [[nodiscard]] double border_ratio(std::span<const std::uint32_t> rows) const;

 private:
  /// Sets size_, nodes_ and others_.
  void divide(const Array3& mean, std::size_t most_nodes);
  /// Sets node_of_other_; others that no node is near are left out.
  void join_others(const Array3& mean);
  /// What a point says of a node. Of several the least one counts: the point that the node covers most, or is nearest
  /// to; the inside one of two alike.
  struct Claim {
    double minus_cover = 0;
    float squared_distance = 0;
    Given side = Given::inside;
    auto operator<=>(const Claim&) const = default;
  };
  struct Seeds {
    std::vector<Given> given;  ///< [nodes]
    ClickedNodes clicked;      ///< The node that each point is on, where no point of the other side has it.
    std::vector<float> leak;   ///< [nodes] Of the walk, by the points alone, not by far ends; empty: none.
    double smallness = 0;      ///< BorderChoice::smallness, by the points alone.
  };
  struct FarEnds {
    std::vector<double> squared;  ///< [n] Distance of each node from the nearest of so many clicks.
    std::size_t clicks = 0;
  };
  [[nodiscard]] Result<Seeds> seeds_of(const scene::GaussianCloud& cloud, const Grow& grow) const;
  /// Claims the nodes that a point lies on; returns the one that covers it most.
  std::uint32_t claim(const scene::GaussianCloud& cloud, DVec3 point, Given side,
                      std::map<std::uint32_t, Claim>& claims) const;
  /// The clicks say how far a thing may extend, unless several outside ones do.
  void suppose_extent(Seeds& seeds) const;
  [[nodiscard]] NaturalBorder border_of(const Seeds& seeds, BorderChoice choice) const;
  /// The same by potentials of a walk that has been gone.
  [[nodiscard]] NaturalBorder border_of(const Seeds& seeds, std::span<const double> potential,
                                        BorderChoice choice) const;
  /// select::take_leftovers(), but where many outside clicks say where the thing ends.
  void take_leftovers(const Seeds& seeds, std::vector<std::uint8_t>& inside) const;
  [[nodiscard]] DVec3 place_of(std::uint32_t node) const;  ///< Relative to the middle.
  /// How likely a walk ends outside at each node: the farther it is from all clicks, by the square. Who clicks several
  /// times does so all over the thing, so that it extends about as far as the clicks do: as `n` values that are drawn
  /// evenly lie by (n - 1) / (n + 1) of the range apart. Empty where all clicks are at one place.
  [[nodiscard]] std::vector<float> leak_beyond(std::span<const std::uint32_t> clicked) const;
  /// Of the whole: grown from the clicks, and again with clicks at far ends of what was found. What is under a thing,
  /// or behind, hangs together with those rather than with what was clicked on. The largest counts that has not taken
  /// another thing.
  [[nodiscard]] NaturalBorder whole_border(const Seeds& seeds, int wider) const;
  /// Makes a node inside that is as far from all inside clicks as nearly all others one more of them: the very
  /// farthest is, on a capture, a floater or where the border leaks. Does nothing and returns false if all are clicked.
  ///   inside  [n] nodes, 1 or more
  ///   ends    of the calls before with these nodes
  bool click_far_end(std::span<const std::uint32_t> inside, Seeds& seeds, FarEnds& ends) const;
  /// [nodes] 1 for those whose row is one of these, which ascend.
  [[nodiscard]] std::vector<std::uint8_t> nodes_among(std::span<const std::uint32_t> rows) const;
  /// The rows that go with nodes that are inside, ascending.
  [[nodiscard]] std::vector<std::uint32_t> rows_of(std::span<const std::uint8_t> inside) const;
  /// Those for which test(node that they go with, row) holds, ascending.
  template <class Test>
  [[nodiscard]] std::vector<std::uint32_t> rows_where(Test&& test) const;
  /// Gives what lies at the reach to the outside.
  void take_far_nodes(std::vector<Given>& given) const;

  Surroundings surroundings_;
  std::size_t size_ = 0;
  std::vector<std::uint32_t> nodes_;                   ///< Rows, in an order in which near ones come together.
  std::vector<std::uint32_t> others_, node_of_other_;  ///< Rows likewise, and the node that each goes with.
  std::vector<float> points_;                          ///< [nodes][3] relative to the middle.
  neighbours::PointIndex index_;                       ///< Of these.
  neighbours::NeighbourGraph graph_;
  std::vector<float> weight_;  ///< [edges] 1: the same surface goes on; near 0: a border.
};

}  // namespace engine::select
