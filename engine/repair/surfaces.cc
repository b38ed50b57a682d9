#include "engine/repair/surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/mask/mask.h"

namespace engine::repair {
namespace {

constexpr std::size_t most_planes = 5;
constexpr std::size_t most_points = 1500;  // that vote for a plane
constexpr int trials = 200;         // 1 - (1 - 1/4^3)^200: 96 % certain of a plane that a quarter of the points lie on
constexpr double on_plane = 0.006;  // relative difference of depths
constexpr double in_front = 0.02;   // by so much nearer a surface hides what is behind it
constexpr int directions_needed = 7;  // of eight in which the surface is met again

constexpr int least_surroundings = 24;  // pixels around the vacated ones, or half of their extent

constexpr float same_surface = 0.05f;  // relative difference of depths between neighbouring pixels

/// Inverse depth as an affine function of the pixel.
struct Plane {
  double at_origin = 0, per_x = 0, per_y = 0;
  [[nodiscard]] double operator()(double x, double y) const { return at_origin + per_x * x + per_y * y; }
};

struct Point {
  double x = 0, y = 0, inverse_depth = 0;
};

bool lies_on(const Plane& plane, const Point& point) {
  return std::abs(plane(point.x, point.y) - point.inverse_depth) <= on_plane * point.inverse_depth;
}

std::optional<Plane> plane_through(const Point& a, const Point& b, const Point& c) {
  const double bx = b.x - a.x, by = b.y - a.y, cx = c.x - a.x, cy = c.y - a.y;
  const double area = bx * cy - by * cx;
  if (std::abs(area) < 4) return std::nullopt;  // square pixels: nearly on a line
  const double bz = b.inverse_depth - a.inverse_depth, cz = c.inverse_depth - a.inverse_depth;
  Plane plane;
  plane.per_x = (bz * cy - cz * by) / area, plane.per_y = (cz * bx - bz * cx) / area;
  plane.at_origin = a.inverse_depth - plane.per_x * a.x - plane.per_y * a.y;
  return plane;
}

/// Least squares over the points that lie on the plane.
Plane refined(const Plane& plane, std::span<const Point> points) {
  double n = 0, mx = 0, my = 0, mz = 0;
  for (const Point& p : points)
    if (lies_on(plane, p)) n += 1, mx += p.x, my += p.y, mz += p.inverse_depth;
  if (n < 3) return plane;
  mx /= n, my /= n, mz /= n;
  double xx = 0, xy = 0, yy = 0, xz = 0, yz = 0;
  for (const Point& p : points) {
    if (!lies_on(plane, p)) continue;
    const double x = p.x - mx, y = p.y - my, z = p.inverse_depth - mz;
    xx += x * x, xy += x * y, yy += y * y, xz += x * z, yz += y * z;
  }
  const double determinant = xx * yy - xy * xy;
  if (determinant <= 1e-9 * xx * yy) return plane;
  Plane out;
  out.per_x = (xz * yy - yz * xy) / determinant, out.per_y = (yz * xx - xz * xy) / determinant;
  out.at_origin = mz - out.per_x * mx - out.per_y * my;
  return out;
}

/// Planes that many points lie on, the one with most first (Fischler and Bolles 1981).
std::vector<Plane> find_planes(std::vector<Point> points, std::uint64_t seed) {
  const std::size_t enough = std::max<std::size_t>(points.size() / 12, 20);
  std::vector<Plane> planes;
  Rng rng(seed);
  while (planes.size() < most_planes && points.size() >= enough) {
    Plane best;
    std::size_t most = 0;
    for (int trial = 0; trial < trials; ++trial) {
      const auto draw = [&] { return points[rng.below(std::uint32_t(points.size()))]; };
      const Point a = draw(), b = draw(), c = draw();
      const auto plane = plane_through(a, b, c);
      if (!plane) continue;
      const auto on =
          std::size_t(std::count_if(points.begin(), points.end(), [&](const Point& p) { return lies_on(*plane, p); }));
      if (on > most) most = on, best = *plane;
    }
    if (most < enough) break;
    for (int i = 0; i < 3; ++i) best = refined(best, points);
    planes.push_back(best);
    std::erase_if(points, [&](const Point& p) { return lies_on(best, p); });
  }
  return planes;
}

/// The surroundings of what was vacated: what goes on there must show here.
scene::Rect surroundings(const scene::Mask& vacated) {
  const scene::Rect box = scene::bounding_box(vacated);
  const int by = std::max(least_surroundings, std::max(box.width(), box.height()) / 2);
  return {std::max(box.x0 - by, 0), std::max(box.y0 - by, 0), std::min(box.x1 + by, vacated.width),
          std::min(box.y1 + by, vacated.height)};
}

std::vector<Point> points_of(const SurfaceView& view) {
  const std::size_t width = std::size_t(view.inverse_depth.width);
  const scene::Rect near = surroundings(view.vacated);
  std::vector<std::size_t> shown;
  for (int y = near.y0; y < near.y1; ++y)
    for (int x = near.x0; x < near.x1; ++x)
      if (view.shows_surface.at(x, y) != 0) shown.push_back(std::size_t(y) * width + std::size_t(x));
  std::vector<Point> points;
  const std::size_t count = std::min(shown.size(), most_points);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = shown[k * shown.size() / count], x = i % width, y = i / width;
    points.push_back({double(x) + 0.5, double(y) + 0.5, double(view.inverse_depth.data[i])});
  }
  return points;
}

/// In how many of eight directions each pixel meets one that shows the plane.
std::vector<std::uint8_t> directions_met(const SurfaceView& view, const Plane& plane) {
  const int width = view.inverse_depth.width, height = view.inverse_depth.height;
  const auto index = [&](int x, int y) { return std::size_t(y) * std::size_t(width) + std::size_t(x); };
  std::vector<std::uint8_t> shows(view.shows_surface.data.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Point point{x + 0.5, y + 0.5, double(view.inverse_depth.at(x, y))};
      shows[index(x, y)] = view.shows_surface.at(x, y) != 0 && lies_on(plane, point);
    }
  std::vector<std::uint8_t> met(shows.size(), 0), reach(shows.size());
  for (const auto& [dx, dy] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}}) {
    // Pixels in such an order that the one to look at, at (-dx, -dy), was there before.
    for (int j = 0; j < height; ++j)
      for (int i = 0; i < width; ++i) {
        const int x = dx < 0 ? width - 1 - i : i, y = dy < 0 ? height - 1 - j : j;
        const int u = x - dx, v = y - dy;
        const bool inside = u >= 0 && v >= 0 && u < width && v < height;
        reach[index(x, y)] = shows[index(x, y)] != 0 || (inside && reach[index(u, v)] != 0);
        met[index(x, y)] = std::uint8_t(met[index(x, y)] + reach[index(x, y)]);
      }
  }
  return met;
}

/// Without crumbs: what hangs together and is nowhere three pixels wide is an error of the depth, as at the blurred
/// outlines of things, and not a surface.
scene::Image without_crumbs(const scene::Image& found) {
  scene::Image out = found;
  scene::Mask filled(found.width, found.height);
  for (std::size_t i = 0; i < found.data.size(); ++i) filled.data[i] = found.data[i] > 0;
  const scene::Mask wide = mask::opened(filled, 1);
  std::vector<std::uint8_t> seen(found.data.size(), 0);
  std::vector<std::size_t> together;
  const int width = found.width, height = found.height;
  for (std::size_t start = 0; start < found.data.size(); ++start) {
    if (found.data[start] == 0 || seen[start] != 0) continue;
    together.assign(1, start);
    seen[start] = 1;
    for (std::size_t k = 0; k < together.size(); ++k) {
      const std::size_t at = together[k];
      const int x = int(at % std::size_t(width)), y = int(at / std::size_t(width));
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
          const std::size_t next = std::size_t(v) * std::size_t(width) + std::size_t(u);
          const bool joined =
              found.data[next] > 0 && std::abs(found.data[next] - found.data[at]) <= same_surface * found.data[at];
          if (joined && seen[next] == 0) seen[next] = 1, together.push_back(next);
        }
    }
    if (std::none_of(together.begin(), together.end(), [&](std::size_t at) { return wide.data[at] != 0; }))
      for (const std::size_t at : together) out.data[at] = 0;
  }
  return out;
}

}  // namespace

scene::Image continued_surfaces(const SurfaceView& view, const IsFree& is_free, std::uint64_t seed) {
  const int width = view.inverse_depth.width, height = view.inverse_depth.height;
  scene::Image out(width, height, 1);
  for (const Plane& plane : find_planes(points_of(view), seed)) {
    const std::vector<std::uint8_t> met = directions_met(view, plane);
    parallel_for(std::size_t(height), 4, [&](std::size_t begin, std::size_t end) {
      for (int y = int(begin); y < int(end); ++y)
        for (int x = 0; x < width; ++x) {
          if (view.vacated.at(x, y) == 0) continue;
          if (met[std::size_t(y) * std::size_t(width) + std::size_t(x)] < directions_needed) continue;
          const double here = plane(x + 0.5, y + 0.5);
          const double seen = double(view.inverse_depth.at(x, y)), found = double(out.at(x, y));
          if (here <= found) continue;  // a nearer one is there already
          const bool hides = here > (1 + in_front) * seen;
          const bool replaces = view.doubtful.at(x, y) != 0 && here > (1 - in_front) * seen;
          if (!hides && !replaces) continue;
          if (!is_free({x + 0.5, y + 0.5}, here)) out.at(x, y) = float(here);
        }
    });
  }
  return without_crumbs(out);
}

}  // namespace engine::repair
