#include "engine/repair/chart.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/vec.h"
#include "engine/mask/mask.h"
#include "engine/repair/plane.h"
#include "engine/repair/seed.h"
#include "engine/scene/in_picture.h"

namespace engine::repair {
namespace {

// The picture shows so many times what goes on, so that a corrector finds there what to take.
constexpr double surroundings = 2.5;
// Pixels of a side of the picture, at least and at most: a corrector compares patches, and takes its time.
constexpr int least_side = 64, most_side = 768;
constexpr std::size_t least_points = 32;  // fewer pixels are no surface to look at
constexpr double most_of = 0.98;          // of the points; the rest may be errors of depth
// Cosine of the angle to the normal from which on a view shows a surface too much at a slant to tell anything.
constexpr double grazing = 0.1;
// Relative difference of depths from which on a view shows something else than the surface.
constexpr double off_surface = 0.02;
// Pixels of a view on a pixel of the chart beyond which more of them show nothing that the chart could hold; the bound
// keeps weights finite beside a camera that stands on the surface.
constexpr double finest = 16;
// Pixels of the ring around what goes on that is asked whether it is known, and the part of it that has to be: other
// things may stand about.
constexpr int ring_px = 4;
constexpr double nearly_all = 0.8;
// Trust of a pixel of a view from which on next to nothing of what nobody has seen shows there.
constexpr float wholly_seen = 0.98f;
// At a slant a rim is wider in the chart than in the view, by so many times at most: a choice.
constexpr int widened = 2;
// Halvings of the interval in which a ray is known to meet the surface: to a millionth of the depth.
constexpr int halvings = 20;

/// How far from the middle nearly all of the points are.
double reach_of(std::span<const DVec3> points, DVec3 middle) {
  std::vector<double> reach;
  for (const DVec3 point : points) reach.push_back(glm::length(point - middle));
  const auto farthest = reach.begin() + std::ptrdiff_t(most_of * double(reach.size() - 1));
  std::nth_element(reach.begin(), farthest, reach.end());
  return *farthest;
}

/// A point on the surface, if the ray through a pixel of the chart meets it where it is known.
///   distance  of the camera from the middle, world units
std::optional<DVec3> meet(const scene::Camera& camera, DVec2 pixel, double distance, const scene::Camera& view,
                          const ContinuedSurfaces& surfaces) {
  const auto behind = [&](double inverse_depth) -> std::optional<double> {
    const DVec3 p = view.cam_from_world(point_at(camera, pixel, inverse_depth));
    if (!(p.z > 0)) return std::nullopt;
    return p.z * surfaces.main(view.pixel_from_cam(p)) - 1;
  };
  double nearer = 1.5 / distance, farther = 0.6 / distance;  // inverse depths: a chart is flatter than that
  const auto first = behind(nearer), last = behind(farther);
  if (!first || !last || (*first > 0) == (*last > 0)) return std::nullopt;
  for (int i = 0; i < halvings; ++i) {
    const double middle = (nearer + farther) / 2;
    const auto at = behind(middle);
    if (!at) return std::nullopt;
    ((*at > 0) == (*first > 0) ? nearer : farther) = middle;
  }
  const DVec3 point = point_at(camera, pixel, (nearer + farther) / 2);
  const DVec2 seen_at = view.pixel_from_cam(view.cam_from_world(point));
  const scene::Rect known = surfaces.known;
  if (!(seen_at.x >= known.x0 && seen_at.x < known.x1 && seen_at.y >= known.y0 && seen_at.y < known.y1))
    return std::nullopt;
  return point;
}

/// The value between pixel centres, by the four around it.
float between(const scene::Image& image, DVec2 at, int channel) {
  const double x = std::clamp(at.x - 0.5, 0.0, image.width - 1.0), y = std::clamp(at.y - 0.5, 0.0, image.height - 1.0);
  const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  const float u = float(x - x0), v = float(y - y0);
  const float upper = image.at(x0, y0, channel) + u * (image.at(x1, y0, channel) - image.at(x0, y0, channel));
  const float lower = image.at(x0, y1, channel) + u * (image.at(x1, y1, channel) - image.at(x0, y1, channel));
  return upper + v * (lower - upper);
}

}  // namespace

std::optional<Chart> chart_of(const scene::Camera& view, const ContinuedSurfaces& surfaces) {
  const scene::Image& found = surfaces.inverse_depth;
  if (!surfaces.main) return std::nullopt;
  const auto goes_on_at = [&](int x, int y) {
    const double here = double(found.at(x, y)), main = surfaces.main({x + 0.5, y + 0.5});
    return here > 0 && std::abs(here - main) < off_surface * here;
  };
  std::vector<DVec3> points;
  for (int y = 0; y < found.height; ++y)
    for (int x = 0; x < found.width; ++x)
      if (goes_on_at(x, y)) points.push_back(point_at(view, {x + 0.5, y + 0.5}, double(found.at(x, y))));
  if (points.size() < least_points) return std::nullopt;
  Plane place = plane_of(points);
  const DVec3 back = view.centre() - place.middle;
  const double distance = glm::length(back);
  if (glm::dot(place.normal, back) < 0) place.normal = -place.normal;
  if (!(glm::dot(place.normal, back) > grazing * distance)) return std::nullopt;

  Chart chart;
  const double wanted = 2 * surroundings * reach_of(points, place.middle) * view.fy / distance;
  const int side = int(std::clamp(std::ceil(wanted), double(least_side), double(most_side)));
  // What is farther from the view is up.
  chart.camera = scene::look_at(place.middle + distance * place.normal, place.middle, -back, 1.0, side, side);
  chart.camera.fx = chart.camera.fy = view.fy * std::min(1.0, double(side) / wanted);
  chart.inverse_depth = chart.weights = scene::Image(side, side, 1);
  chart.colors = scene::Image(side, side, 3);
  chart.goes_on = scene::Mask(side, side);
  parallel_for(std::size_t(side), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < side; ++x) {
        const auto point = meet(chart.camera, {x + 0.5, y + 0.5}, distance, view, surfaces);
        if (!point) continue;
        chart.inverse_depth.at(x, y) = float(1 / chart.camera.cam_from_world(*point).z);
        const DVec2 seen_at = view.pixel_from_cam(view.cam_from_world(*point));
        chart.goes_on.at(x, y) = goes_on_at(int(seen_at.x), int(seen_at.y));
      }
  });
  return chart;
}

void add_view(Chart& chart, const scene::Camera& view, const Shown& shown) {
  const DVec3 facing = glm::transpose(chart.camera.rotation) * DVec3(0, 0, -1);
  const int side = chart.camera.width;
  parallel_for(std::size_t(side), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < side; ++x) {
        const double here = double(chart.inverse_depth.at(x, y));
        if (!(here > 0)) continue;
        const DVec3 point = point_at(chart.camera, {x + 0.5, y + 0.5}, here), p = view.cam_from_world(point);
        const auto at = pixel_in_picture(view, p);
        if (!at) continue;
        const int u = int(at->x), v = int(at->y);
        const bool shows_it =
            shown.reliable.at(u, v) != 0 && std::abs(p.z * double(shown.inverse_depth.at(u, v)) - 1) < off_surface;
        const DVec3 back = view.centre() - point;
        const double slant = glm::dot(facing, back) / glm::length(back);
        if (!shows_it || slant < grazing) continue;
        // Pixels of the view on a pixel of the chart.
        const double fineness = std::min(slant * std::pow(view.fy / p.z / (chart.camera.fy * here), 2), finest);
        const float weight = float(fineness * fineness);
        for (int c = 0; c < 3; ++c) chart.colors.at(x, y, c) += weight * between(shown.color, *at, c);
        chart.weights.at(x, y) += weight;
      }
  });
}

scene::Mask untold_around(const Chart& chart, int rim_px) {
  scene::Mask untold = mask::dilate(chart.goes_on, widened * rim_px);
  for (std::size_t i = 0; i < untold.data.size(); ++i)
    if (chart.weights.data[i] > 0) untold.data[i] = 0;
  return untold;
}

bool is_surrounded(const Chart& chart, int rim_px) {
  const scene::Mask near = mask::dilate(chart.goes_on, widened * rim_px);
  const scene::Mask far = mask::dilate(chart.goes_on, widened * rim_px + ring_px);
  std::size_t ring = 0, known = 0;
  for (std::size_t i = 0; i < far.data.size(); ++i)
    if (far.data[i] != 0 && near.data[i] == 0) ++ring, known += chart.weights.data[i] > 0 ? 1 : 0;
  return ring > 0 && double(known) >= nearly_all * double(ring);
}

scene::Mask rim_of(const Chart& chart, const scene::Camera& view, const scene::Image& trust, int rim_px) {
  const int wide = widened * rim_px;
  scene::Mask surface = chart.goes_on;
  for (std::size_t i = 0; i < surface.data.size(); ++i) surface.data[i] |= chart.weights.data[i] > 0;
  // Where nobody tells of it, on one side at least, it may end.
  surface = mask::eroded(mask::dilate(surface, wide), wide);
  const scene::Mask near = mask::dilate(chart.goes_on, wide);
  scene::Mask rim(near.width, near.height);
  for (int y = 0; y < rim.height; ++y)
    for (int x = 0; x < rim.width; ++x) {
      const double here = double(chart.inverse_depth.at(x, y));
      if (near.at(x, y) == 0 || surface.at(x, y) == 0 || chart.goes_on.at(x, y) != 0 || !(here > 0)) continue;
      const DVec3 point = point_at(chart.camera, {x + 0.5, y + 0.5}, here);
      const auto at = pixel_in_picture(view, view.cam_from_world(point));
      rim.at(x, y) = at && trust.at(int(at->x), int(at->y)) < wholly_seen;
    }
  return rim;
}

scene::Image picture_of(const Chart& chart) {
  scene::Image picture = chart.colors;
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < picture.pixels(); ++i)
      if (const float weight = chart.weights.data[i]; weight > 0) picture.plane(c)[i] /= weight;
  return picture;
}

}  // namespace engine::repair
