#include "engine/repair/surfaces.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/mask/mask.h"

namespace engine::repair {
namespace {

constexpr std::size_t most_surfaces = 5;
constexpr std::size_t most_points = 1500;  // that vote for a surface
constexpr int trials = 200;        // 1 - (1 - 1/4^3)^200: 96 % certain of a plane that a quarter of the points lie on
constexpr int curved_trials = 40;  // each grows from three neighbours: 90 % certain of what 6 % of the points lie on
constexpr double on_surface = 0.006;  // relative difference of depths
constexpr double loosely = 0.02;      // the same, while a curved surface grows
constexpr double patch = 0.2;         // extents of the surroundings, from which it grows
constexpr double clearly_more = 1.25;
constexpr double in_front = 0.02;     // by so much nearer a surface hides what is behind it
constexpr int directions_needed = 7;  // of eight in which the surface is met again

constexpr int least_surroundings = 24;  // pixels around the vacated ones, or half of their extent

constexpr float same_surface = 0.05f;  // relative difference of depths between neighbouring pixels

struct Point {
  double x = 0, y = 0, inverse_depth = 0;  ///< Pixels from the middle of the surroundings, in parts of their extent.
};

/// Inverse depth as a polynomial of the pixel: affine for a plane, of second degree for what is curved.
struct Surface {
  Eigen::Matrix<double, 6, 1> of = Eigen::Matrix<double, 6, 1>::Zero();  ///< 1, x, y, x^2, x y, y^2
  [[nodiscard]] double operator()(double x, double y) const {
    return of[0] + of[1] * x + of[2] * y + of[3] * x * x + of[4] * x * y + of[5] * y * y;
  }
};

bool lies_on(const Surface& surface, const Point& point, double within = on_surface) {
  return std::abs(surface(point.x, point.y) - point.inverse_depth) <= within * point.inverse_depth;
}

std::optional<Surface> plane_through(const Point& a, const Point& b, const Point& c, double pixel) {
  const double bx = b.x - a.x, by = b.y - a.y, cx = c.x - a.x, cy = c.y - a.y;
  const double area = bx * cy - by * cx;
  if (std::abs(area) < 4 * pixel * pixel) return std::nullopt;  // nearly on a line
  const double bz = b.inverse_depth - a.inverse_depth, cz = c.inverse_depth - a.inverse_depth;
  Surface plane;
  plane.of[1] = (bz * cy - cz * by) / area, plane.of[2] = (cz * bx - bz * cx) / area;
  plane.of[0] = a.inverse_depth - plane.of[1] * a.x - plane.of[2] * a.y;
  return plane;
}

/// Least squares over the points that lie on the surface, with so many of the terms: 3 for a plane, 6.
Surface refined(const Surface& surface, std::span<const Point> points, int terms, double within = on_surface) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  int on = 0;
  for (const Point& p : points) {
    if (!lies_on(surface, p, within)) continue;
    Eigen::Matrix<double, 6, 1> term;
    term << 1, p.x, p.y, p.x * p.x, p.x * p.y, p.y * p.y;
    normal += term * term.transpose();
    right += p.inverse_depth * term;
    ++on;
  }
  if (on < terms) return surface;
  const auto solver = normal.topLeftCorner(terms, terms).ldlt();
  // Where points lie on few lines, the terms cannot be told apart.
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > 1e-9 * solver.vectorD().maxCoeff()))
    return surface;
  Surface out;
  out.of.head(terms) = solver.solve(right.head(terms));
  return out;
}

std::size_t count_on(const Surface& surface, std::span<const Point> points) {
  return std::size_t(std::count_if(points.begin(), points.end(), [&](const Point& p) { return lies_on(surface, p); }));
}

/// What is curved is nearly plane nearby: a patch of it, which takes in what goes on from it with the same curvature.
Surface grown(const Surface& plane, std::span<const Point> points) {
  Surface surface = plane;
  for (const double within : {loosely, loosely, loosely, loosely, on_surface, on_surface, on_surface})
    surface = refined(surface, points, 6, within);
  return surface;
}

/// A surface that many points lie on, and how many.
struct Candidate {
  Surface surface;
  std::size_t on = 0;
};

/// The plane that most points lie on (Fischler and Bolles 1981).
Candidate best_plane(std::span<const Point> points, double pixel, Rng& rng) {
  Candidate best;
  for (int trial = 0; trial < trials; ++trial) {
    const auto draw = [&] { return points[rng.below(std::uint32_t(points.size()))]; };
    const Point a = draw(), b = draw(), c = draw();
    const auto plane = plane_through(a, b, c, pixel);
    if (!plane) continue;
    if (const std::size_t on = count_on(*plane, points); on > best.on) best = {*plane, on};
  }
  if (best.on == 0) return best;
  for (int i = 0; i < 3; ++i) best.surface = refined(best.surface, points, 3);
  best.on = count_on(best.surface, points);
  return best;
}

/// The same for what is curved.
Candidate best_curved(std::span<const Point> points, double pixel, Rng& rng) {
  Candidate best;
  for (int trial = 0; trial < curved_trials; ++trial) {
    const Point a = points[rng.below(std::uint32_t(points.size()))];
    const auto draw_near = [&] {
      Point near = a;
      for (int tries = 0; tries < 20; ++tries) {
        near = points[rng.below(std::uint32_t(points.size()))];
        if (std::hypot(near.x - a.x, near.y - a.y) < patch) break;
      }
      return near;
    };
    const Point b = draw_near(), c = draw_near();
    const auto plane = plane_through(a, b, c, pixel);
    if (!plane) continue;
    const Surface surface = grown(*plane, points);
    if (const std::size_t on = count_on(surface, points); on > best.on) best = {surface, on};
  }
  return best;
}

/// Surfaces that many points lie on, the one with most first. A curved one must explain clearly more than a plane.
std::vector<Surface> find_surfaces(std::vector<Point> points, double pixel, std::uint64_t seed) {
  const std::size_t enough = std::max<std::size_t>(points.size() / 12, 20);
  std::vector<Surface> surfaces;
  Rng rng(seed);
  while (surfaces.size() < most_surfaces && points.size() >= enough) {
    const Candidate plane = best_plane(points, pixel, rng), curved = best_curved(points, pixel, rng);
    const Candidate& best = double(curved.on) > clearly_more * double(plane.on) ? curved : plane;
    if (best.on < enough) break;
    surfaces.push_back(best.surface);
    std::erase_if(points, [&](const Point& p) { return lies_on(surfaces.back(), p); });
  }
  return surfaces;
}

/// The surroundings of what was vacated: what goes on there must show here.
class Surroundings {
 public:
  explicit Surroundings(const scene::Mask& vacated) {
    const scene::Rect box = scene::bounding_box(vacated);
    const int by = std::max(least_surroundings, std::max(box.width(), box.height()) / 2);
    rect_ = {std::max(box.x0 - by, 0), std::max(box.y0 - by, 0), std::min(box.x1 + by, vacated.width),
             std::min(box.y1 + by, vacated.height)};
    scale_ = 2.0 / std::max({rect_.width(), rect_.height(), 1});  // so that powers of positions stay near 1
  }
  [[nodiscard]] const scene::Rect& rect() const { return rect_; }
  [[nodiscard]] double pixel() const { return scale_; }  ///< How long it is in the coordinates of points.
  [[nodiscard]] Point point(int x, int y, double inverse_depth) const {
    return {(x + 0.5 - (rect_.x0 + rect_.x1) / 2.0) * scale_, (y + 0.5 - (rect_.y0 + rect_.y1) / 2.0) * scale_,
            inverse_depth};
  }
  /// Inverse depth of a surface at a pixel position.
  [[nodiscard]] double value(const Surface& surface, DVec2 pixel) const {
    return surface((pixel.x - (rect_.x0 + rect_.x1) / 2.0) * scale_, (pixel.y - (rect_.y0 + rect_.y1) / 2.0) * scale_);
  }
  [[nodiscard]] bool holds(int x, int y) const {
    return x >= rect_.x0 && y >= rect_.y0 && x < rect_.x1 && y < rect_.y1;
  }

 private:
  scene::Rect rect_;
  double scale_ = 1;
};

std::vector<Point> points_of(const SurfaceView& view, const Surroundings& near) {
  const std::size_t width = std::size_t(view.inverse_depth.width);
  std::vector<std::size_t> shown;
  for (int y = near.rect().y0; y < near.rect().y1; ++y)
    for (int x = near.rect().x0; x < near.rect().x1; ++x)
      if (view.shows_surface.at(x, y) != 0) shown.push_back(std::size_t(y) * width + std::size_t(x));
  std::vector<Point> points;
  const std::size_t count = std::min(shown.size(), most_points);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = shown[k * shown.size() / count], x = i % width, y = i / width;
    points.push_back(near.point(int(x), int(y), double(view.inverse_depth.data[i])));
  }
  return points;
}

/// In how many of eight directions each pixel meets one that shows the surface.
std::vector<std::uint8_t> directions_met(const SurfaceView& view, const Surroundings& near, const Surface& surface) {
  const int width = view.inverse_depth.width, height = view.inverse_depth.height;
  const auto index = [&](int x, int y) { return std::size_t(y) * std::size_t(width) + std::size_t(x); };
  std::vector<std::uint8_t> shows(view.shows_surface.data.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      shows[index(x, y)] = view.shows_surface.at(x, y) != 0 && near.holds(x, y) &&
                           lies_on(surface, near.point(x, y, double(view.inverse_depth.at(x, y))));
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

/// Without crumbs: what hangs together and is nowhere wider than outlines are blurred is an error of the depth, as at
/// the blurred outlines of things, and not a surface.
scene::Image without_crumbs(const scene::Image& found) {
  scene::Image out = found;
  scene::Mask filled(found.width, found.height);
  for (std::size_t i = 0; i < found.data.size(); ++i) filled.data[i] = found.data[i] > 0;
  const scene::Mask wide = mask::opened(filled, mask::blur_radius(found.height));
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

ContinuedSurfaces continued_surfaces(const SurfaceView& view, const IsFree& is_free, std::uint64_t seed) {
  const int width = view.inverse_depth.width, height = view.inverse_depth.height;
  scene::Image out(width, height, 1);
  if (view.vacated.area() == 0) return {std::move(out), {}, {}};
  const Surroundings near(view.vacated);
  const std::vector<Surface> surfaces = find_surfaces(points_of(view, near), near.pixel(), seed);
  for (const Surface& surface : surfaces) {
    const std::vector<std::uint8_t> met = directions_met(view, near, surface);
    parallel_for(std::size_t(height), 4, [&](std::size_t begin, std::size_t end) {
      for (int y = int(begin); y < int(end); ++y)
        for (int x = 0; x < width; ++x) {
          if (view.vacated.at(x, y) == 0) continue;
          if (met[std::size_t(y) * std::size_t(width) + std::size_t(x)] < directions_needed) continue;
          const Point at = near.point(x, y, 0);
          const double here = surface(at.x, at.y);
          const double seen = double(view.inverse_depth.at(x, y)), found = double(out.at(x, y));
          if (here <= found) continue;  // a nearer one is there already
          const bool hides = here > (1 + in_front) * seen;
          const bool replaces =
              view.doubtful.at(x, y) != 0 && (view.within.at(x, y) != 0 || here > (1 - in_front) * seen);
          if (!hides && !replaces) continue;
          if (!is_free({x + 0.5, y + 0.5}, here)) out.at(x, y) = float(here);
        }
    });
  }
  out = without_crumbs(out);
  ContinuedSurfaces continued{std::move(out), {}, near.rect()};
  std::size_t most = 0;
  for (const Surface& surface : surfaces) {
    std::size_t on = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (const float here = continued.inverse_depth.at(x, y); here > 0)
          on += lies_on(surface, near.point(x, y, double(here))) ? 1 : 0;
    if (on <= most) continue;
    most = on;
    continued.main = [surface, near](DVec2 pixel) { return near.value(surface, pixel); };
  }
  return continued;
}

}  // namespace engine::repair
