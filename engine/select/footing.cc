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
constexpr double sunk = 0.03;          // share of the part, by opacity, that lies lower: fluff below a surface
constexpr double widest = 0.1;         // of a row: a wall of one row counts no more than that
constexpr double least_spread = 0.06;  // of a plane's points, the way they spread less: a row of them is no plane
constexpr double on_plane = 0.4;       // share of what is near the feet, by weight: the rest may be other things
constexpr double other_way = 0.7;      // cosine of 45 degrees: no support of a crown turns further along a way
constexpr double same_way = 0.985;     // cosine of 10 degrees: of a flat floor, found twice, 2 or 3
constexpr std::size_t least_touching = 5;
constexpr std::size_t least_points = 12, most_points = 1500, most_feet = 500;  // more of them tell no more
constexpr int guesses = 150;  // with 0.4 on the plane, a tenth of which hits it three times
constexpr int refinements = 5, rounds = 3;

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

/// The part at one end of its way, in its units.
class Posture {
 public:
  Posture(std::vector<DVec3> places, std::span<const double> opacity)
      : places_(std::move(places)), opacity_(opacity.begin(), opacity.end()) {
    for (const DVec3& place : places_) middle_ += place / double(places_.size());
  }

  [[nodiscard]] Plane facing(Plane plane) const {
    if (plane.height(middle_) < 0) plane.normal = -plane.normal;
    return plane;
  }
  [[nodiscard]] std::vector<DVec3> feet(DVec3 up) const {
    std::vector<std::pair<double, double>> levels;
    for (std::size_t k = 0; k < places_.size(); ++k) levels.emplace_back(glm::dot(places_[k], up), opacity_[k]);
    std::sort(levels.begin(), levels.end());
    double below = sunk * std::accumulate(opacity_.begin(), opacity_.end(), 0.0);
    const auto lowest = std::ranges::find_if(levels, [&](const auto& level) { return (below -= level.second) < 0; });
    const double top = (lowest == levels.end() ? levels.back() : *lowest).first + band;
    std::vector<DVec3> out;
    std::ranges::copy_if(places_, std::back_inserter(out), [&](DVec3 place) { return glm::dot(place, up) <= top; });
    return out;
  }

 private:
  std::vector<DVec3> places_;
  std::vector<double> opacity_;
  DVec3 middle_{0.0};
};

/// Those that are near one of the feet, the nearer the heavier: so a crown is flat enough.
std::vector<Point> near(std::span<const Point> rest, std::span<const DVec3> feet) {
  std::vector<float> at, asked;
  const auto append = [](std::vector<float>& to, DVec3 place) {
    const auto point = neighbours::point_of(place, DVec3(0.0));
    to.insert(to.end(), point.begin(), point.end());
  };
  for (std::size_t k = 0; k < feet.size(); k += 1 + feet.size() / most_feet) append(at, feet[k]);
  for (const Point& point : rest) append(asked, point.at);
  const std::vector<neighbours::Neighbour> nearest = neighbours::PointIndex(at, 3).nearest(asked, 1);
  std::vector<Point> out;
  for (std::size_t k = 0; k < rest.size(); ++k) {
    const double closeness = 1 - double(nearest[k].squared_distance) / (reach * reach);
    if (closeness > 0) out.push_back({rest[k].at, closeness * rest[k].weight});
  }
  return out;
}

/// The part and what stays around it, at one end of its way.
struct End {
  Posture part;
  std::vector<Point> rest;

  [[nodiscard]] std::vector<Point> by_feet(DVec3 up) const { return near(rest, part.feet(up)); }
  /// The plane by the feet as they are above a plane that faces about the same way.
  [[nodiscard]] std::optional<Plane> settled_on(Plane plane) const {
    for (int k = 0; k < rounds; ++k) {
      const std::optional<Plane> next = plane_by(by_feet(plane.normal), plane.normal);
      if (!next) return std::nullopt;
      plane = part.facing(*next);
    }
    return plane;
  }
};

/// One plane for both ends, where enough of what is near the feet is on it at each of them.
std::optional<Plane> common_plane(const End& before, const Plane& there, const End& after, const Plane& here) {
  if (glm::dot(there.normal, here.normal) < same_way) return std::nullopt;
  std::vector<Point> all = before.by_feet(there.normal);
  const std::vector<Point> others = after.by_feet(here.normal);
  const std::size_t first = all.size();
  all.insert(all.end(), others.begin(), others.end());
  const std::optional<Plane> plane = plane_by(all, here.normal);
  const auto carries = [&](std::span<const Point> points) {
    return weight_on(points, *plane) >= on_plane * weight_of(points);
  };
  if (!plane || !carries(std::span(all).first(first)) || !carries(others)) return std::nullopt;
  return after.part.facing(*plane);
}

/// The box around a part.
struct Box {
  DVec3 low{0.0}, high{0.0};

  explicit Box(std::span<const DVec3> places) : low(places[0]), high(places[0]) {
    for (const DVec3& place : places) low = glm::min(low, place), high = glm::max(high, place);
  }
  [[nodiscard]] bool holds(DVec3 place, double margin) const {
    return glm::all(glm::greaterThanEqual(place, low - margin)) && glm::all(glm::lessThanEqual(place, high + margin));
  }
};

/// World to units of the part.
struct Units {
  DVec3 middle{0.0};
  double extent = 0;

  [[nodiscard]] DVec3 of(DVec3 place) const { return (place - middle) / extent; }
  [[nodiscard]] std::vector<DVec3> of(std::span<const DVec3> places) const {
    std::vector<DVec3> out;
    for (const DVec3& place : places) out.push_back(of(place));
    return out;
  }
};

double opacity_of(const scene::GaussianCloud& cloud, std::size_t row) {
  return double(render::opacity<float>(cloud.opacity_logit[row]));
}

/// What of the rest is around the boxes. Weighed by opacity and width.
std::vector<std::vector<Point>> rest_around(const scene::LayeredCloud& scene, const Array3& means,
                                            std::span<const std::uint32_t> moved, std::span<const Box> boxes,
                                            const Units& units) {
  const double margin = reach * units.extent;
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < means.size(); ++row)
    if (std::ranges::any_of(boxes, [&](const Box& box) { return box.holds(DVec3(means.get(row)), margin); }) &&
        !std::ranges::binary_search(moved, row))
      rows.push_back(row);
  const scene::GaussianCloud cloud = scene::gather(scene, rows);
  std::vector<std::vector<Point>> out(boxes.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const DVec3 place(cloud.mean.get(k)), log_scale(cloud.log_scale.get(k));
    const double thinnest = std::min({log_scale.x, log_scale.y, log_scale.z});
    const double width = std::exp((log_scale.x + log_scale.y + log_scale.z - thinnest) / 2) / units.extent;
    for (std::size_t b = 0; b < boxes.size(); ++b)
      if (boxes[b].holds(place, margin))
        out[b].push_back({units.of(place), opacity_of(cloud, k) * std::min(width, widest)});
  }
  return out;
}

Footing footing(const End& end, const Plane& plane, const Units& units) {
  const std::vector<DVec3> feet = end.part.feet(plane.normal);
  DVec3 foot(0.0);
  for (const DVec3& place : feet) foot += place / double(feet.size());
  return {plane.normal, units.middle + units.extent * foot, units.extent * plane.height(foot)};
}

}  // namespace

std::optional<Footings> footings_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                    std::span<const Touch> touches, std::span<const std::uint32_t> moved,
                                    std::span<const DVec3> arrived) {
  assert(!part.empty() && touches.size() == part.size() && arrived.size() == part.size());
  const Array3 means = scene::means(scene);
  std::vector<DVec3> places, touching;
  for (std::size_t k = 0; k < part.size(); ++k) {
    places.emplace_back(means.get(part[k]));
    if (touches[k] != Touch::nothing) touching.push_back(places.back());
  }
  const std::array boxes{Box(places), Box(arrived)};
  const Units units{(boxes[0].low + boxes[0].high) / 2.0, glm::distance(boxes[0].low, boxes[0].high)};
  if (touching.size() < least_touching || !(units.extent > 0)) return std::nullopt;

  const scene::GaussianCloud own = scene::gather(scene, part);
  std::vector<double> opacity;
  for (std::size_t k = 0; k < part.size(); ++k) opacity.push_back(opacity_of(own, k));
  std::vector<std::vector<Point>> rest = rest_around(scene, means, moved, boxes, units);
  const End before{Posture(units.of(places), opacity), std::move(rest[0])};
  const End after{Posture(units.of(arrived), opacity), std::move(rest[1])};

  std::optional<Plane> there = plane_by(near(before.rest, units.of(touching)));
  if (there) there = before.settled_on(before.part.facing(*there));
  if (!there) return std::nullopt;
  const std::optional<Plane> here = after.settled_on(*there);
  if (!here) return std::nullopt;
  if (const auto one = common_plane(before, *there, after, *here))
    return Footings{footing(before, *one, units), footing(after, *one, units)};
  return Footings{footing(before, *there, units), footing(after, *here, units)};
}

}  // namespace engine::select
