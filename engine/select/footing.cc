#include "engine/select/footing.h"

#include <algorithm>
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
constexpr std::size_t least_points = 12;
// More of them tell no more: of a plane's points to guess by, rows of the part and around it, feet.
constexpr std::size_t most_points = 1500, most_rows = 4000, most_rest = 20'000, most_feet = 500;
constexpr int guesses = 150;  // with 0.4 on the plane, a tenth of which hits it three times
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

/// Of planes through three of the points, drawn by their weights, the one that most of them are on.
///   towards  its normal, but for 45 degrees and its sign; zero: any
std::optional<Plane> guess(std::span<const Point> points, DVec3 towards) {
  std::vector<double> up_to;
  for (const Point& point : points) up_to.push_back((up_to.empty() ? 0 : up_to.back()) + point.weight);
  Rng rng(0);
  const auto any = [&] {
    const auto drawn = std::ranges::upper_bound(up_to, double(rng.uniform()) * up_to.back());
    return points[std::min(std::size_t(drawn - up_to.begin()), points.size() - 1)].at;
  };
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
///   towards  as above; the normal is on that side
std::optional<Plane> plane_by(std::span<const Point> points, DVec3 towards) {
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
  if (glm::dot(plane->normal, towards) < 0) plane->normal = -plane->normal;
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

/// The rows that say where a part ends, at one end of its way.
class Posture {
 public:
  explicit Posture(std::vector<DVec3> places) : places_(std::move(places)) {}

  [[nodiscard]] const std::vector<DVec3>& places() const { return places_; }
  [[nodiscard]] Plane below(Plane plane) const {
    DVec3 middle(0.0);
    for (const DVec3& place : places_) middle += place / double(places_.size());
    if (plane.height(middle) < 0) plane.normal = -plane.normal;
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
  /// The plane by the feet as they are above a plane that faces about the same way.
  [[nodiscard]] std::optional<Plane> settled_on(Plane plane, std::span<const Point> rest) const {
    for (int k = 0; k < rounds; ++k) {
      const std::optional<Plane> next = plane_by(near(rest, feet(plane.normal)), plane.normal);
      if (!next) return std::nullopt;
      plane = *next;
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
  std::vector<DVec3> places_;  ///< In units of the part; at least one.
};

double opacity_of(const scene::GaussianCloud& cloud, std::size_t row) {
  return double(render::opacity<float>(cloud.opacity_logit[row]));
}

/// Every so many of them, so that no more than `most` are left.
template <class T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t most) {
  std::vector<T> out;
  for (std::size_t k = 0; k < all.size(); k += 1 + all.size() / most) out.push_back(all[k]);
  return out;
}

/// Some of what stays around a part. Weighed by opacity and width.
std::vector<Point> rest_around(const scene::LayeredCloud& scene, const Array3& means,
                               std::span<const std::uint32_t> moved, const Box& box, const Units& units) {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < means.size(); ++row)
    if (box.reaches(units.of(DVec3(means.get(row)))) && !std::ranges::binary_search(moved, row)) rows.push_back(row);
  const scene::GaussianCloud cloud = scene::gather(scene, thinned(rows, most_rest));
  std::vector<Point> out;
  for (std::size_t k = 0; k < cloud.size(); ++k) {
    const DVec3 log_scale(cloud.log_scale.get(k));
    const double thinnest = std::min({log_scale.x, log_scale.y, log_scale.z});
    const double width = std::exp((log_scale.x + log_scale.y + log_scale.z - thinnest) / 2) / units.extent;
    out.push_back({units.of(DVec3(cloud.mean.get(k))), opacity_of(cloud, k) * std::min(width, widest)});
  }
  return out;
}

/// Where the rows are that say where a part ends, world units: all of them do where it hardly shows.
std::vector<DVec3> shown_places(const scene::GaussianCloud& part) {
  std::vector<DVec3> all, shown;
  for (std::size_t row = 0; row < part.size(); ++row) {
    all.emplace_back(part.mean.get(row));
    if (opacity_of(part, row) >= shows) shown.push_back(all.back());
  }
  return shown.empty() ? all : shown;
}

}  // namespace

struct Stance::Before {
  Units units;
  Posture part;
  Plane plane;                   ///< That it stands on.
  std::vector<Point> near_feet;  ///< What stays, by its feet.
};

Stance::Stance(const scene::LayeredCloud& scene, const Array3& means, std::span<const std::uint32_t> part,
               std::span<const Touch> touches, std::span<const std::uint32_t> moved)
    : part_(part.begin(), part.end()), moved_(moved.begin(), moved.end()) {
  assert(!part.empty() && touches.size() == part.size());
  std::vector<DVec3> places = shown_places(scene::gather(scene, part)), touching;
  const Box box(places);
  const Units units{(box.low + box.high) / 2.0, glm::distance(box.low, box.high)};
  if (!(units.extent > 0)) return;
  for (DVec3& place : places) place = units.of(place);
  for (std::size_t k = 0; k < part.size(); ++k)
    if (touches[k] != Touch::nothing) touching.push_back(units.of(DVec3(means.get(part[k]))));
  if (touching.size() < least_touching) return;

  const std::vector<Point> rest = rest_around(scene, means, moved, Box(places), units);
  Posture posture(thinned(places, most_rows));
  std::optional<Plane> plane = plane_by(near(rest, touching), DVec3(0.0));
  if (plane) plane = posture.settled_on(posture.below(*plane), rest);
  if (!plane) return;
  std::vector<Point> near_feet = near(rest, posture.feet(plane->normal));
  before_ = std::make_shared<const Before>(Before{units, std::move(posture), *plane, std::move(near_feet)});
}

std::optional<Footings> Stance::after(const scene::LayeredCloud& scene, const Array3& means,
                                      const std::function<DVec3(DVec3)>& motion) const {
  if (!before_) return std::nullopt;
  const auto& [units, before, there, near_before] = *before_;
  std::vector<DVec3> arrived;
  for (const DVec3& place : before.places()) arrived.push_back(units.of(motion(units.world(place))));
  const std::vector<Point> rest = rest_around(scene, means, moved_, Box(arrived), units);
  const Posture after(std::move(arrived));
  const std::optional<Plane> here = after.settled_on(there, rest);
  if (!here) return std::nullopt;
  if (glm::dot(there.normal, here->normal) >= same_way)
    if (const auto one = common_plane(near_before, near(rest, after.feet(here->normal)), here->normal))
      return Footings{before.footing(*one, units), after.footing(*one, units)};
  return Footings{before.footing(there, units), after.footing(*here, units)};
}

std::size_t Stance::size() const { return part_.size() + moved_.size() + (before_ ? before_->near_feet.size() : 0); }

bool Stance::is_of(std::span<const std::uint32_t> part, std::span<const std::uint32_t> moved) const {
  return std::ranges::equal(part_, part) && std::ranges::equal(moved_, moved);
}

}  // namespace engine::select
