#include "engine/select/neighbourhood.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/neighbours/morton.h"
#include "engine/select/leftovers.h"
#include "engine/select/natural_border.h"
#include "engine/select/random_walk.h"
#include "engine/select/similarity.h"
#include "engine/select/thinning.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 16'384;  // rows of a parallel task: a choice

constexpr std::size_t neighbours_joined = 12;  // two rings around a surface's row, but for its corners
constexpr std::size_t rows_clicked = 4;        // of those nearest to a point, the ones that cover it most
constexpr std::size_t rows_near_click = 24;    // that are looked at for that: the mean of a large disc may be far off
constexpr double reach_by_points = 4.0;        // times the distance of the points
constexpr double reach_by_scene = 0.25;        // of the distance within which half of the rows lie
constexpr double reach_of_whole = 0.8;         // of the same: room for the border around the thing, and for more
constexpr double beside_scene = 4.0;           // times that distance: farther away, there is nothing worth mention
constexpr double most_of_rows = 0.98;          // that masks name: the others may be floaters
constexpr double reach_by_rows = 1.5;          // times the distance of those from their middle
constexpr int far_ends = 2;                    // that a whole is grown from, beside the clicks
constexpr double more_by_far_ends = 1.25;  // times the rows of a whole: more is another thing, as all around the mug
constexpr double far_border = 0.9;         // of the reach: from here on, rows are taken for outside
// So likely a walk ends outside at a node as far from all clicks as the thing should be long, in weight of edges.
// Chosen on a trained capture of a doll, where with 1e-3 three clicks take the bed as well, with 1e-2 and 3e-2 ever
// less of the doll; the captured cases are alike with it and without it.
constexpr double leak_at_extent = 3e-3;
constexpr double leak_farther = 4.0;  // times that, at most: clicks side by side say little of a large thing
// For each click on a thing but the first, and at most: how much smaller things are preferred
// (BorderChoice::smallness). Chosen on 40 draws of two to nine clicks on a trained capture of a doll; half and one and
// a half times as much are about as good. One half would make of the cheapest border the shortest one, close around the
// clicks.
constexpr double smallness_per_click = 0.07, most_smallness = 0.4;
// So many clicks around a thing tell where it ends better than distances do (of the doll with two outside clicks, a
// leak gains 20 to 60 of precision, with three and more nothing; of a mug's back it loses 5 of recall then). Whoever
// clicks there more often than that has seen what is left over, and says what of it belongs to the thing.
constexpr std::size_t clicks_around = 3;
// So often a walk has to end inside for what is inclined to. Of what masks show in the shade of a thing, a wall behind
// it comes to hardly anything else than wall; the underside of a toy, between it and a sofa, comes to both (ADR 58).
constexpr double inclination = 0.15;

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

std::vector<std::uint32_t> in_order(std::span<const std::uint32_t> values, std::span<const std::uint32_t> order) {
  std::vector<std::uint32_t> out(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) out[i] = values[order[i]];
  return out;
}

double distance(DVec3 a, DVec3 b) { return glm::length(a - b); }

std::string text(double number) {
  std::ostringstream out;
  out << number;
  return out.str();
}

/// Each of them once, ascending: who clicks twice at one place says it once.
std::vector<std::uint32_t> distinct(std::span<const std::uint32_t> nodes) {
  std::vector<std::uint32_t> out(nodes.begin(), nodes.end());
  std::ranges::sort(out);
  out.erase(std::ranges::unique(out).begin(), out.end());
  return out;
}

double smallness_of(std::size_t clicks) { return std::min(smallness_per_click * double(clicks - 1), most_smallness); }

/// So much or a little more, so that the next click rarely asks for other surroundings.
double by_steps(double reach) { return std::exp2(std::ceil(2 * std::log2(reach)) / 2); }

}  // namespace

Surroundings surroundings_of(const Array3& mean, const Grow& grow) {
  const DVec3 middle = grow.inside[0];
  if (grow.reach) return {middle, *grow.reach};
  double farthest = 0, nearest = std::numeric_limits<double>::infinity();
  for (const DVec3 point : grow.inside) farthest = std::max(farthest, distance(middle, point));
  for (const DVec3 point : grow.outside) nearest = std::min(nearest, distance(middle, point));
  std::vector<double> squared = squared_distances(mean, middle);
  const auto half = squared.begin() + std::ptrdiff_t(squared.size() / 2);
  std::nth_element(squared.begin(), half, squared.end());
  const double by_scene_share = grow.whole ? reach_of_whole : reach_by_scene;
  const double half_of_scene = std::sqrt(*half), by_scene = by_scene_share * half_of_scene;
  // An outside point that is nowhere near the scene says nothing of the thing's size.
  if (nearest <= beside_scene * half_of_scene) farthest = std::max(farthest, nearest);
  const double by_points = farthest > 0 ? by_steps(reach_by_points * farthest) : 0;
  // Rows at the very same place as the point: anything above nothing holds them.
  return {middle, std::max({by_scene, by_points, 1e-30})};
}

std::optional<Surroundings> surroundings_of(const Array3& mean, std::span<const std::uint8_t> rows) {
  DVec3 sum(0.0);
  std::vector<double> squared;
  for (std::size_t row = 0; row < rows.size(); ++row)
    if (rows[row] != 0) sum += DVec3(mean.get(row)), squared.push_back(0);
  if (squared.empty()) return std::nullopt;
  const DVec3 middle = sum / double(squared.size());
  auto next = squared.begin();
  for (std::size_t row = 0; row < rows.size(); ++row) {
    if (rows[row] == 0) continue;
    const DVec3 offset = DVec3(mean.get(row)) - middle;
    *next++ = glm::dot(offset, offset);
  }
  const auto nearly_all = squared.begin() + std::ptrdiff_t(most_of_rows * double(squared.size() - 1));
  std::nth_element(squared.begin(), nearly_all, squared.end());
  const double farthest = reach_by_rows * std::sqrt(*nearly_all);
  if (!(farthest > 0)) return std::nullopt;  // all at one place: nothing lies between them
  return Surroundings{middle, by_steps(farthest)};
}

Neighbourhood::Neighbourhood(const scene::GaussianCloud& cloud, const Surroundings& surroundings,
                             std::size_t most_nodes)
    : surroundings_(surroundings), index_({}, 3) {
  divide(cloud.mean, most_nodes);
  points_ = neighbours::points_of(cloud.mean, nodes_, surroundings.middle);
  index_ = neighbours::PointIndex(points_, 3);
  graph_ = neighbours::join_nearest(points_, index_, neighbours_joined);
  weight_ = similarity_of_edges(cloud, nodes_, graph_);
  for (float& one : weight_) one = std::max(one, least_weight);
  join_others(cloud.mean);
}

void Neighbourhood::divide(const Array3& mean, std::size_t most_nodes) {
  const std::vector<double> squared = squared_distances(mean, surroundings_.middle);
  const double limit = surroundings_.reach * surroundings_.reach;
  std::vector<std::uint32_t> rows;
  for (std::size_t row = 0; row < squared.size(); ++row)
    if (squared[row] <= limit) rows.push_back(std::uint32_t(row));
  const Thinned thinned = thin_out(rows, most_nodes);
  const auto in_morton_order = [&](std::span<const std::uint32_t> of) {
    return in_order(of, neighbours::morton_order(neighbours::points_of(mean, of, surroundings_.middle)));
  };
  nodes_ = in_morton_order(thinned.kept);
  others_ = in_morton_order(thinned.others);
  size_ = rows.size();
}

void Neighbourhood::join_others(const Array3& mean) {
  const auto nearest = index_.nearest(neighbours::points_of(mean, others_, surroundings_.middle), 1);
  std::size_t joined = 0;
  for (std::size_t i = 0; i < others_.size(); ++i) {
    const float limit = neighbours::joining_spacings * graph_.spacing[nearest[i].index];
    if (nearest[i].squared_distance > limit * limit) continue;
    others_[joined++] = others_[i];
    node_of_other_.push_back(nearest[i].index);
  }
  others_.resize(joined);
}

Result<Neighbourhood::Seeds> Neighbourhood::seeds_of(const scene::GaussianCloud& cloud, const Grow& grow) const {
  if (nodes_.empty())
    return fail(ErrorCode::unprocessable, "no Gaussian within " + text(surroundings_.reach) + " of the first point",
                "inside[0]");
  std::map<std::uint32_t, Claim> claims;
  Seeds seeds;
  for (std::size_t i = 0; i < grow.inside.size(); ++i) {
    if (const double away = distance(grow.inside[i], surroundings_.middle); away > surroundings_.reach)
      return fail(ErrorCode::unprocessable,
                  "the point lies " + text(away) + " from the first one, beyond the reach of " +
                      text(surroundings_.reach) + ": grow from it in an operation of its own, or raise the reach",
                  "inside[" + std::to_string(i) + "]");
    seeds.clicked.inside.push_back(claim(cloud, grow.inside[i], Given::inside, claims));
  }
  for (const DVec3 point : grow.outside)
    if (distance(point, surroundings_.middle) <= surroundings_.reach)
      seeds.clicked.outside.push_back(claim(cloud, point, Given::outside, claims));
  seeds.given.assign(nodes_.size(), Given::no);
  for (const auto& [node, one] : claims) seeds.given[node] = one.side;
  take_far_nodes(seeds.given);
  const auto belongs_to = [&](Given side) {
    return [&seeds, side](std::uint32_t n) { return seeds.given[n] != side; };
  };
  std::erase_if(seeds.clicked.inside, belongs_to(Given::inside));
  std::erase_if(seeds.clicked.outside, belongs_to(Given::outside));
  if (seeds.clicked.inside.empty())
    return fail(ErrorCode::unprocessable, "all Gaussians around the inside points are nearer to outside ones",
                "inside[0]");
  return seeds;
}

std::uint32_t Neighbourhood::claim(const scene::GaussianCloud& cloud, DVec3 point, Given side,
                                   std::map<std::uint32_t, Claim>& claims) const {
  struct Covering {
    double cover;
    float squared_distance;
    std::uint32_t node;
  };
  std::vector<Covering> near;
  for (const neighbours::Neighbour& one :
       index_.nearest(neighbours::point_of(point, surroundings_.middle), rows_near_click))
    near.push_back(
        {cover(cloud, nodes_[one.index], double(graph_.spacing[one.index]), point), one.squared_distance, one.index});
  // Where nothing covers the point, the nearest count, which come first.
  std::stable_sort(near.begin(), near.end(), [](const Covering& a, const Covering& b) { return a.cover > b.cover; });
  near.resize(std::min(near.size(), rows_clicked));
  for (const Covering& one : near) {
    const Claim mine{-one.cover, one.squared_distance, side};
    const auto [at, is_new] = claims.emplace(one.node, mine);
    if (!is_new) at->second = std::min(at->second, mine);
  }
  return near.front().node;
}

void Neighbourhood::take_far_nodes(std::vector<Given>& given) const {
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    const bool is_far = glm::length(place_of(node)) >= far_border * surroundings_.reach;
    if (is_far && given[node] == Given::no) given[node] = Given::outside;
  }
}

Result<Grown> Neighbourhood::grow(const scene::GaussianCloud& cloud, const Grow& grow) const {
  auto seeds = seeds_of(cloud, grow);
  if (!seeds) return propagate(seeds);
  suppose_extent(*seeds);
  NaturalBorder border = grow.whole ? whole_border(*seeds, grow.wider) : border_of(*seeds, {false, grow.wider});
  // Who asks for less is not to get back just what that leaves out.
  if (border.wider >= 0) take_leftovers(*seeds, border.inside);
  return Grown{rows_of(border.inside), border.wider, border.more, border.less};
}

Result<Grown> Neighbourhood::grow_beyond(const scene::GaussianCloud& cloud, const Grow& grow,
                                         std::span<const std::uint32_t> rows, int farther) const {
  auto seeds = seeds_of(cloud, grow);
  if (!seeds) return propagate(seeds);
  const std::vector<std::uint8_t> was_taken = nodes_among(rows);
  for (std::uint32_t node = 0; node < nodes_.size(); ++node)
    if (was_taken[node] != 0) seeds->given[node] = Given::inside;
  std::erase_if(seeds->clicked.outside, [&](std::uint32_t node) { return was_taken[node] != 0; });
  NaturalBorder border = border_of(*seeds, {.wider = farther, .beyond = true});
  if (border.wider == 0) return Grown{{rows.begin(), rows.end()}, 0, border.more, border.less};
  take_leftovers(*seeds, border.inside);
  // The rows were found among other nodes: what goes with these nodes now has been left out before.
  for (std::uint32_t node = 0; node < nodes_.size(); ++node)
    if (was_taken[node] != 0) border.inside[node] = 0;
  std::vector<std::uint32_t> all;
  std::ranges::set_union(rows, rows_of(border.inside), std::back_inserter(all));
  return Grown{std::move(all), border.wider, border.more, border.less};
}

Result<std::vector<std::uint32_t>> Neighbourhood::left_of(const scene::GaussianCloud& cloud, const Grow& grow,
                                                          std::span<const std::uint32_t> rows) const {
  auto seeds = seeds_of(cloud, grow);
  if (!seeds) return propagate(seeds);
  const std::vector<std::uint8_t> was_taken = nodes_among(rows);
  const auto is_on_it = [&](std::uint32_t node) { return was_taken[node] != 0; };
  if (std::ranges::none_of(seeds->clicked.outside, is_on_it)) return std::vector<std::uint32_t>{};
  suppose_extent(*seeds);
  std::vector<double> potential = random_walk(graph_, weight_, seeds->given, seeds->leak);
  // The walk goes where it would; what was not taken is outside wherever it ends.
  for (std::uint32_t node = 0; node < nodes_.size(); ++node)
    if (seeds->given[node] == Given::no && was_taken[node] == 0)
      seeds->given[node] = Given::outside, potential[node] = 0;
  std::vector<std::uint32_t> left;
  std::ranges::set_intersection(rows, rows_of(border_of(*seeds, potential, {.whole = grow.whole}).inside),
                                std::back_inserter(left));
  return left;
}

bool Neighbourhood::may_be_on(const scene::GaussianCloud& cloud, const Grow& grow,
                              std::span<const std::uint32_t> rows) const {
  if (grow.outside.empty()) return false;
  const auto seeds = seeds_of(cloud, grow);
  if (!seeds) return true;
  const std::vector<std::uint8_t> is_among = nodes_among(rows);
  return std::ranges::any_of(seeds->clicked.outside, [&](std::uint32_t node) { return is_among[node] != 0; });
}

double Neighbourhood::area(std::span<const std::uint32_t> rows) const {
  return select::area_of(graph_, nodes_among(rows));
}

double Neighbourhood::border_ratio(std::span<const std::uint32_t> rows) const {
  return select::border_ratio(graph_, weight_, nodes_among(rows));
}

void Neighbourhood::suppose_extent(Seeds& seeds) const {
  if (distinct(seeds.clicked.outside).size() >= clicks_around) return;
  seeds.leak = leak_beyond(seeds.clicked.inside);
  seeds.smallness = smallness_of(distinct(seeds.clicked.inside).size());
}

void Neighbourhood::take_leftovers(const Seeds& seeds, std::vector<std::uint8_t>& inside) const {
  if (distinct(seeds.clicked.outside).size() > clicks_around) return;
  select::take_leftovers(graph_, weight_, seeds.given, seeds.clicked.outside, inside);
}

NaturalBorder Neighbourhood::border_of(const Seeds& seeds, BorderChoice choice) const {
  return border_of(seeds, random_walk(graph_, weight_, seeds.given, seeds.leak), choice);
}

NaturalBorder Neighbourhood::border_of(const Seeds& seeds, std::span<const double> potential,
                                       BorderChoice choice) const {
  choice.leaks = !seeds.leak.empty();
  choice.smallness = seeds.smallness;
  return natural_border(graph_, weight_, potential, seeds.given, seeds.clicked, choice);
}

DVec3 Neighbourhood::place_of(std::uint32_t node) const {
  const float* at = points_.data() + std::size_t(3) * node;
  return {at[0], at[1], at[2]};
}

std::vector<float> Neighbourhood::leak_beyond(std::span<const std::uint32_t> clicked) const {
  const std::vector<std::uint32_t> nodes = distinct(clicked);
  std::vector<float> clicks;
  double spread = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) spread = std::max(spread, distance(place_of(nodes[i]), place_of(nodes[k])));
    const float* const at = points_.data() + std::size_t(3) * nodes[i];
    clicks.insert(clicks.end(), at, at + 3);
  }
  if (!(spread > 0)) return {};
  const auto count = double(nodes.size());
  const double extent = spread * (count + 1) / (count - 1);
  const std::vector<neighbours::Neighbour> nearest = neighbours::PointIndex(clicks, 3).nearest(points_, 1);
  std::vector<float> leak;
  for (const neighbours::Neighbour& click : nearest) {
    const double away = double(click.squared_distance) / (extent * extent);
    leak.push_back(float(leak_at_extent * std::min(away, leak_farther)));
  }
  return leak;
}

NaturalBorder Neighbourhood::whole_border(const Seeds& seeds, int wider) const {
  Seeds tried = seeds, best_seeds = seeds;
  NaturalBorder best = border_of(seeds, {true, 0});
  std::vector<std::uint32_t> found;
  for (std::uint32_t node = 0; node < best.inside.size(); ++node)
    if (best.inside[node] != 0) found.push_back(node);
  FarEnds ends;
  const auto size = [](const NaturalBorder& border) {
    return double(std::count(border.inside.begin(), border.inside.end(), std::uint8_t{1}));
  };
  const double most = more_by_far_ends * size(best);
  for (int i = 0; i < far_ends && click_far_end(found, tried, ends); ++i) {
    NaturalBorder border = border_of(tried, {true, 0});
    if (size(border) > most || size(border) <= size(best)) continue;
    best = std::move(border), best_seeds = tried;
  }
  return wider == 0 ? best : border_of(best_seeds, {true, wider});
}

bool Neighbourhood::click_far_end(std::span<const std::uint32_t> inside, Seeds& seeds, FarEnds& ends) const {
  ends.squared.resize(inside.size(), std::numeric_limits<double>::infinity());
  for (; ends.clicks < seeds.clicked.inside.size(); ++ends.clicks) {
    const DVec3 click = place_of(seeds.clicked.inside[ends.clicks]);
    for (std::size_t i = 0; i < inside.size(); ++i) {
      const DVec3 offset = place_of(inside[i]) - click;
      ends.squared[i] = std::min(ends.squared[i], glm::dot(offset, offset));
    }
  }
  const auto far_end = std::max_element(ends.squared.begin(), ends.squared.end());
  if (far_end == ends.squared.end() || !(*far_end > 0)) return false;
  const std::uint32_t node = inside[std::size_t(far_end - ends.squared.begin())];
  seeds.given[node] = Given::inside;
  seeds.clicked.inside.push_back(node);
  return true;
}

std::vector<std::uint32_t> Neighbourhood::settle(std::span<const Given> given,
                                                 std::span<const std::uint8_t> inclined) const {
  std::vector<Given> given_nodes(nodes_.size());
  std::ranges::transform(nodes_, given_nodes.begin(), [&](std::uint32_t row) { return given[row]; });
  const std::vector<double> potential = random_walk(graph_, weight_, given_nodes);
  return rows_where([&](std::uint32_t node, std::uint32_t row) {
    if (given[row] != Given::no) return given[row] == Given::inside;
    return potential[node] > (!inclined.empty() && inclined[row] != 0 ? inclination : 0.5);
  });
}

std::vector<std::uint8_t> Neighbourhood::nodes_among(std::span<const std::uint32_t> rows) const {
  std::vector<std::uint8_t> out(nodes_.size());
  std::ranges::transform(nodes_, out.begin(),
                         [&](std::uint32_t row) { return std::uint8_t(std::ranges::binary_search(rows, row)); });
  return out;
}

std::vector<std::uint32_t> Neighbourhood::rows_of(std::span<const std::uint8_t> inside) const {
  return rows_where([&](std::uint32_t node, std::uint32_t) { return inside[node] != 0; });
}

template <class Test>
std::vector<std::uint32_t> Neighbourhood::rows_where(Test&& test) const {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t node = 0; node < nodes_.size(); ++node)
    if (test(node, nodes_[node])) rows.push_back(nodes_[node]);
  for (std::size_t i = 0; i < others_.size(); ++i)
    if (test(node_of_other_[i], others_[i])) rows.push_back(others_[i]);
  std::ranges::sort(rows);
  return rows;
}

}  // namespace engine::select
