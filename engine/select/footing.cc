#include "engine/select/footing.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/svd.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/project.h"

namespace engine::select {
namespace {

// Lengths in units of the part: the diagonal of the box around it.
// Chosen on the captured cases mug, pouf, board, can, chair and chair_led, where 0.25 to 0.35 and 0.03 to 0.07 do
// alike.
constexpr double reach = 0.25;         // from the feet: the surface that counts
constexpr double thickness = 0.05;     // that rows of one surface are off the plane at most; trained floors have 0.01
constexpr double band = 0.05;          // above the lowest of the part: its feet
constexpr double sunk = 0.03;          // share of the part that lies lower: fluff below a surface
constexpr double widest = 0.1;         // of a row: a wall of one row counts no more than that
constexpr double least_spread = 0.06;  // of a plane's points, the way they spread less: a row of them is no plane
constexpr double on_plane = 0.4;       // share of what is near the feet, by weight: the rest may be other things
constexpr double other_way = 0.7;      // cosine of 45 degrees: no support of a crown turns further along a way
constexpr double same_way = 0.985;     // cosine of 10 degrees: of a flat floor, found twice, 2 or 3
constexpr std::size_t least_touching = 5;
constexpr std::size_t least_points = 12, most_points = 1500, most_rows = 4000,
                      most_feet = 500;  // more of them tell no more
constexpr int guesses = 150;            // with 0.4 on the plane, a tenth of which hits it three times
constexpr int refinements = 5, rounds = 2;
constexpr double shows = 0.1;  // opacity of a row that says where a part ends

struct Point {
  DVec3 at{0.0};
  double weight = 0;
};

struct Plane {
  DVec3 point{0.0}, normal{0.0};

  [[nodiscard]] double height(DVec3 at) const { return glm::dot(at - point, normal); }
  /// 1 on the plane, 0 as far as its thickness goes.
  [[nodiscard]] double closeness(DVec3 at) const {
    const double off = height(at) / thickness;
    return std::max(0.0, 1 - off * off);
  }
};

double weight_on(std::span<const Point> points, const Plane& plane) {
  double sum = 0;
  for (const Point& point : points) sum += plane.closeness(point.at) > 0 ? point.weight : 0;
  return sum;
}

double weight_of(std::span<const Point> points) {
  return std::accumulate(points.begin(), points.end(), 0.0,
                         [](double sum, const Point& point) { return sum + point.weight; });
}

/// Of planes through three of the points the one that most of them are on.
///   towards  its normal, but for 45 degrees and its sign; zero: any
std::optional<Plane> guess(std::span<const Point> points, DVec3 towards) {
  Rng rng(0);
  const auto any = [&] { return points[rng.below(std::uint32_t(points.size()))].at; };
  const std::size_t stride = 1 + points.size() / most_points;
  std::optional<Plane> best;
  double most = 0;
  for (int k = 0; k < guesses; ++k) {
    const DVec3 a = any(), b = any(), c = any(), across = glm::cross(b - a, c - a);
    const double area = glm::length(across);
    if (!(area > least_spread * least_spread)) continue;
    const Plane plane{a, across / area};
    if (towards != DVec3(0.0) && std::abs(glm::dot(plane.normal, towards)) < other_way) continue;
    double sum = 0;
    for (std::size_t i = 0; i < points.size(); i += stride) sum += points[i].weight * plane.closeness(points[i].at);
    if (sum > most) most = sum, best = plane;
  }
  return best;
}

/// The plane that enough of the points are on, by the least squares of those, the closer the more.
std::optional<Plane> plane_by(std::span<const Point> points, DVec3 towards = DVec3(0.0)) {
  if (points.size() < least_points) return std::nullopt;
  std::optional<Plane> plane = guess(points, towards);
  if (!plane) return std::nullopt;
  double spread = 0;
  for (int k = 0; k < refinements; ++k) {
    std::vector<double> weight;
    double sum = 0;
    DVec3 middle(0.0);
    for (const Point& point : points) {
      const double closeness = plane->closeness(point.at);
      weight.push_back(point.weight * closeness * closeness);
      sum += weight.back(), middle += weight.back() * point.at;
    }
    if (!(sum > 0)) return std::nullopt;
    middle /= sum;
    DMat3 covariance(0.0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const DVec3 offset = points[i].at - middle;
      covariance += weight[i] / sum * glm::outerProduct(offset, offset);
    }
    const Svd axes = decompose(covariance);
    plane = Plane{middle, axes.u[2]};
    spread = std::sqrt(axes.s.y);
  }
  if (spread < least_spread || weight_on(points, *plane) < on_plane * weight_of(points)) return std::nullopt;
  return plane;
}

/// One plane for both ends, where enough of what is near the feet is on it at each of them.
std::optional<Plane> common_plane(std::span<const Point> before, std::span<const Point> after, DVec3 towards) {
  std::vector<Point> all(before.begin(), before.end());
  all.insert(all.end(), after.begin(), after.end());
  const std::optional<Plane> plane = plane_by(all, towards);
  const auto carries = [&](std::span<const Point> points) {
    return weight_on(points, *plane) >= on_plane * weight_of(points);
  };
  return plane && carries(before) && carries(after) ? plane : std::nullopt;
}

/// World to units of the part.
struct Units {
  DVec3 middle{0.0};
  double extent = 0;

  [[nodiscard]] DVec3 of(DVec3 place) const { return (place - middle) / extent; }
  [[nodiscard]] DVec3 world(DVec3 place) const { return middle + extent * place; }
};

struct Box {
  DVec3 low{0.0}, high{0.0};

  explicit Box(std::span<const DVec3> places) : low(places[0]), high(places[0]) {
    for (const DVec3& place : places) low = glm::min(low, place), high = glm::max(high, place);
  }
  [[nodiscard]] bool reaches(DVec3 place) const {
    return glm::all(glm::greaterThanEqual(place, low - reach)) && glm::all(glm::lessThanEqual(place, high + reach));
  }
};

/// Those that are near one of the feet, the nearer the heavier: so a crown is flat enough.
std::vector<Point> near(std::span<const Point> rest, std::span<const DVec3> feet) {
  const Box box(feet);
  std::vector<Point> out;
  std::ranges::copy_if(rest, std::back_inserter(out), [&](const Point& point) { return box.reaches(point.at); });
  std::vector<float> at, asked;
  const auto append = [](std::vector<float>& to, DVec3 place) {
    const auto point = neighbours::point_of(place, DVec3(0.0));
    to.insert(to.end(), point.begin(), point.end());
  };
  for (std::size_t k = 0; k < feet.size(); k += 1 + feet.size() / most_feet) append(at, feet[k]);
  for (const Point& point : out) append(asked, point.at);
  const std::vector<neighbours::Neighbour> nearest = neighbours::PointIndex(at, 3).nearest(asked, 1);
  for (std::size_t k = 0; k < out.size(); ++k)
    out[k].weight *= std::max(0.0, 1 - double(nearest[k].squared_distance) / (reach * reach));
  std::erase_if(out, [](const Point& point) { return !(point.weight > 0); });
  return out;
}

/// A part and what stays around it, at one end of its way.
class End {
 public:
  /// In units of the part, at least one place.
  End(std::vector<DVec3> places, std::vector<Point> rest) : places_(std::move(places)), rest_(std::move(rest)) {
    for (const DVec3& place : places_) middle_ += place / double(places_.size());
  }

  [[nodiscard]] Plane facing(Plane plane) const {
    if (plane.height(middle_) < 0) plane.normal = -plane.normal;
    return plane;
  }
  [[nodiscard]] std::vector<DVec3> feet(DVec3 up) const {
    std::vector<double> levels;
    for (const DVec3& place : places_) levels.push_back(glm::dot(place, up));
    const auto lowest = levels.begin() + std::ptrdiff_t(sunk * double(levels.size()));
    std::nth_element(levels.begin(), lowest, levels.end());
    std::vector<DVec3> out;
    std::ranges::copy_if(places_, std::back_inserter(out),
                         [&](DVec3 place) { return glm::dot(place, up) <= *lowest + band; });
    return out;
  }
  [[nodiscard]] std::vector<Point> near(std::span<const DVec3> feet) const { return select::near(rest_, feet); }
  [[nodiscard]] std::vector<Point> near_feet(DVec3 up) const { return near(feet(up)); }
  /// The plane by the feet as they are above a plane that faces about the same way.
  [[nodiscard]] std::optional<Plane> settled_on(Plane plane) const {
    for (int k = 0; k < rounds; ++k) {
      const std::optional<Plane> next = plane_by(near_feet(plane.normal), plane.normal);
      if (!next) return std::nullopt;
      plane = facing(*next);
    }
    return plane;
  }
  [[nodiscard]] Footing footing(const Plane& plane, const Units& units) const {
    const std::vector<DVec3> feet_there = feet(plane.normal);
    DVec3 foot(0.0);
    for (const DVec3& place : feet_there) foot += place / double(feet_there.size());
    return {plane.normal, units.world(foot), units.extent * plane.height(foot)};
  }

 private:
  std::vector<DVec3> places_;
  std::vector<Point> rest_;
  DVec3 middle_{0.0};
};

double opacity_of(const scene::GaussianCloud& cloud, std::size_t row) {
  return double(render::opacity<float>(cloud.opacity_logit[row]));
}

/// What of the rest is around a part. Weighed by opacity and width.
std::vector<Point> rest_around(const scene::LayeredCloud& scene, std::span<const std::uint32_t> moved, const Box& box,
                               const Units& units) {
  const Array3 means = scene::means(scene);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < means.size(); ++row)
    if (box.reaches(units.of(DVec3(means.get(row)))) && !std::ranges::binary_search(moved, row)) rows.push_back(row);
  const scene::GaussianCloud cloud = scene::gather(scene, rows);
  std::vector<Point> out;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const DVec3 log_scale(cloud.log_scale.get(k));
    const double thinnest = std::min({log_scale.x, log_scale.y, log_scale.z});
    const double width = std::exp((log_scale.x + log_scale.y + log_scale.z - thinnest) / 2) / units.extent;
    out.push_back({units.of(DVec3(cloud.mean.get(k))), opacity_of(cloud, k) * std::min(width, widest)});
  }
  return out;
}

/// Some of the rows that say where a part ends: all of them do where it hardly shows.
std::vector<DVec3> places_of(const scene::GaussianCloud& part, const Units& units) {
  const auto show = std::ranges::count_if(part.opacity_logit,
                                          [](float logit) { return double(render::opacity<float>(logit)) >= shows; });
  const std::size_t stride = 1 + std::size_t(show > 0 ? show : std::ptrdiff_t(part.size())) / most_rows;
  std::vector<DVec3> out;
  std::size_t k = 0;
  for (std::size_t row = 0; row < part.size(); ++row)
    if ((show == 0 || opacity_of(part, row) >= shows) && k++ % stride == 0)
      out.push_back(units.of(DVec3(part.mean.get(row))));
  return out;
}

}  // namespace

struct Stance::Before {
  Units units;
  std::vector<DVec3> places;  ///< Of some rows of the part, in its units.
  End end;
  Plane plane;                   ///< That it stands on.
  std::vector<Point> near_feet;  ///< What stays, by its feet.
};

Stance::Stance(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part, std::span<const Touch> touches,
               std::span<const std::uint32_t> moved)
    : part_(part.begin(), part.end()), moved_(moved.begin(), moved.end()) {
  assert(!part.empty() && touches.size() == part.size());
  const scene::GaussianCloud cloud = scene::gather(scene, part);
  std::vector<DVec3> all, touching;
  for (std::size_t k = 0; k < part.size(); ++k) {
    all.emplace_back(cloud.mean.get(k));
    if (touches[k] != Touch::nothing) touching.push_back(all.back());
  }
  const Box world(all);
  const Units units{(world.low + world.high) / 2.0, glm::distance(world.low, world.high)};
  if (touching.size() < least_touching || !(units.extent > 0)) return;
  for (auto* places : {&all, &touching})
    for (DVec3& place : *places) place = units.of(place);

  std::vector<DVec3> places = places_of(cloud, units);
  End end(places, rest_around(scene, moved, Box(all), units));
  std::optional<Plane> plane = plane_by(end.near(touching));
  if (plane) plane = end.settled_on(end.facing(*plane));
  if (!plane) return;
  std::vector<Point> near_feet = end.near_feet(plane->normal);
  before_ =
      std::make_shared<const Before>(Before{units, std::move(places), std::move(end), *plane, std::move(near_feet)});
}

std::optional<Footings> Stance::after(const scene::LayeredCloud& scene,
                                      const std::function<DVec3(DVec3)>& motion) const {
  if (!before_) return std::nullopt;
  const auto& [units, places, before, there, near_before] = *before_;
  std::vector<DVec3> arrived;
  for (const DVec3& place : places) arrived.push_back(units.of(motion(units.world(place))));
  std::vector<Point> rest = rest_around(scene, moved_, Box(arrived), units);
  const End end(std::move(arrived), std::move(rest));
  const std::optional<Plane> here = end.settled_on(there);
  if (!here) return std::nullopt;
  if (glm::dot(there.normal, here->normal) >= same_way)
    if (const auto one = common_plane(near_before, end.near_feet(here->normal), here->normal))
      return Footings{before.footing(before.facing(*one), units), end.footing(end.facing(*one), units)};
  return Footings{before.footing(there, units), end.footing(*here, units)};
}

bool Stance::is_of(std::span<const std::uint32_t> part, std::span<const std::uint32_t> moved) const {
  return std::ranges::equal(part_, part) && std::ranges::equal(moved_, moved);
}

}  // namespace engine::select
