#include "engine/select/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::select {
namespace {

constexpr std::size_t lines_per_chunk = 16;  // of a picture, of a parallel task: a choice

/// Calls use(x) for each place at which the polygon's edges cross the line of pixels at height y. An edge has its upper
/// end and not its lower one, so that two edges that meet cross a line once, or not at all.
template <class Use>
void each_crossing(std::span<const DVec2> corners, double y, Use&& use) {
  DVec2 from = corners.back();
  for (const DVec2 to : corners) {
    if ((from.y <= y) != (to.y <= y)) use(from.x + (y - from.y) / (to.y - from.y) * (to.x - from.x));
    from = to;
  }
}

/// The places along a line; none where low > high.
struct Interval {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();

  void unite(Interval other) {
    if (other.low > other.high) return;
    low = std::min(low, other.low), high = std::max(high, other.high);
  }
  /// Keeps the x with low_value <= slope x + offset <= high_value.
  void cut(double slope, double offset, double low_value, double high_value) {
    if (slope == 0) {
      if (offset < low_value || offset > high_value) *this = {};
      return;
    }
    const double a = (low_value - offset) / slope, b = (high_value - offset) / slope;
    low = std::max(low, std::min(a, b)), high = std::min(high, std::max(a, b));
  }
};

/// Where the line of pixels at height y runs within the radius of an end.
Interval within_disc(DVec2 end, double radius, double y) {
  const double squared = radius * radius - (y - end.y) * (y - end.y);
  if (squared < 0) return {};
  const double half = std::sqrt(squared);
  return {end.x - half, end.x + half};
}

/// The same of a segment: what is within a radius of it is convex, so that a line runs through it in one piece.
Interval within_segment(DVec2 from, DVec2 to, double radius, double y) {
  Interval out = within_disc(from, radius, y);
  out.unite(within_disc(to, radius, y));
  const double length = glm::distance(from, to);
  if (length == 0) return out;
  const DVec2 along = (to - from) / length;
  Interval beside{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  beside.cut(along.x, (y - from.y) * along.y - from.x * along.x, 0, length);
  beside.cut(-along.y, (y - from.y) * along.x + from.x * along.y, -radius, radius);
  out.unite(beside);
  return out;
}

/// Calls use(from, to) for the segments of a line; a single point is one.
template <class Use>
void each_segment(std::span<const DVec2> points, Use&& use) {
  if (points.size() == 1) return use(points[0], points[0]);
  for (std::size_t i = 1; i < points.size(); ++i) use(points[i - 1], points[i]);
}

/// The first pixel of a line whose centre is at x or right of it, within [0, width].
int first_pixel(double x, int width) { return int(std::clamp(std::ceil(x - 0.5), 0.0, double(width))); }

/// A picture, each line of which fill(line, span of its pixels) draws.
template <class Fill>
scene::Image picture_of(const scene::Camera& camera, Fill&& fill) {
  scene::Image out(camera.width, camera.height, 1);
  const std::size_t width = std::size_t(camera.width);
  parallel_for(std::size_t(camera.height), lines_per_chunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) fill(double(y) + 0.5, std::span(out.data).subspan(y * width, width));
  });
  return out;
}

}  // namespace

bool holds(const Polygon& polygon, DVec2 at) {
  bool odd = false;
  each_crossing(polygon.points, at.y, [&](double x) { odd ^= x <= at.x; });
  return odd;
}

bool holds(const Stroke& stroke, DVec2 at) {
  bool held = false;
  each_segment(stroke.points, [&](DVec2 from, DVec2 to) {
    const DVec2 along = to - from, offset = at - from;
    const double squared = glm::dot(along, along);
    const double part = squared > 0 ? std::clamp(glm::dot(offset, along) / squared, 0.0, 1.0) : 0;
    held |= glm::distance(offset, part * along) <= stroke.radius;
  });
  return held;
}

scene::Image drawn(const Polygon& polygon) {
  return picture_of(polygon.camera, [&](double y, std::span<float> line) {
    std::vector<double> crossings;
    each_crossing(polygon.points, y, [&](double x) { crossings.push_back(x); });
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2)
      for (int x = first_pixel(crossings[i], int(line.size())); x < first_pixel(crossings[i + 1], int(line.size()));
           ++x)
        line[std::size_t(x)] = 1;
  });
}

scene::Image drawn(const Stroke& stroke) {
  return picture_of(stroke.camera, [&](double y, std::span<float> line) {
    // Where segments begin and end, so that however many overlap, each pixel is written once.
    std::vector<int> change(line.size() + 1, 0);
    each_segment(stroke.points, [&](DVec2 from, DVec2 to) {
      const Interval held = within_segment(from, to, stroke.radius, y);
      if (held.low > held.high) return;
      const int end = int(std::clamp(std::floor(held.high - 0.5) + 1, 0.0, double(line.size())));
      const int begin = first_pixel(held.low, int(line.size()));
      if (begin < end) ++change[std::size_t(begin)], --change[std::size_t(end)];
    });
    int depth = 0;
    for (std::size_t x = 0; x < line.size(); ++x) line[x] = (depth += change[x]) > 0 ? 1.0f : 0.0f;
  });
}

}  // namespace engine::select
