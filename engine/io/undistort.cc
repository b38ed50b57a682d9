#include "engine/io/undistort.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::io {
namespace {

/// Distorted over undistorted radius, at radius r of the plane z = 1.
double radial_ratio(const Lens& lens, double r) {
  const auto& k = lens.k;
  if (lens.model == LensModel::perspective) {
    const double r2 = r * r;
    return 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
  }
  // Near the axis atan(r) / r is 1 - r^2 / 3: below 1e-8 that is 1 to the last bit, and r = 0 has no quotient.
  if (r < 1e-8) return 1;
  const double t = std::atan(r), t2 = t * t;
  return t / r * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

/// Does the distorted radius grow all the way to r? Polynomials bend back somewhere; beyond that point the lens would
/// show two directions in one place.
bool is_monotonic(const Lens& lens, double r) {
  constexpr int steps = 256;
  double previous = 0;
  for (int i = 1; i <= steps; ++i) {
    const double radius = r * i / steps, distorted = radius * radial_ratio(lens, radius);
    if (!(distorted > previous)) return false;
    previous = distorted;
  }
  return true;
}

/// Does every pixel on the border of the zoomed pinhole picture look at the photograph? Then so do all within.
bool fills_picture(const Lens& lens, double zoom) {
  constexpr int steps = 64;  // per side; between two samples the curve leaves the photo by far less than a pixel
  const double right = lens.width - 0.5, bottom = lens.height - 0.5;  // centres of the border's pixels
  double furthest = 0;
  for (int i = 0; i <= steps; ++i) {
    const double u = std::lerp(0.5, right, double(i) / steps), v = std::lerp(0.5, bottom, double(i) / steps);
    for (const DVec2 pixel : {DVec2(u, 0.5), DVec2(u, bottom), DVec2(0.5, v), DVec2(right, v)}) {
      const DVec2 plane((pixel.x - lens.cx) / (zoom * lens.fx), (pixel.y - lens.cy) / (zoom * lens.fy));
      const DVec2 seen = photo_from_plane(lens, plane);
      if (!(seen.x >= 0 && seen.x <= lens.width && seen.y >= 0 && seen.y <= lens.height)) return false;
      furthest = std::max(furthest, glm::length(plane));
    }
  }
  return is_monotonic(lens, furthest);
}

Result<void> validate_coefficients(const Lens& lens) {
  const auto check = [](double value, const std::string& name) -> Result<void> {
    if (std::isfinite(value)) return {};
    return fail(ErrorCode::invalid_argument, "lens " + name + ": expected a finite number", name);
  };
  for (std::size_t i = 0; i < lens.k.size(); ++i)
    if (auto checked = check(lens.k[i], "k" + std::to_string(i + 1)); !checked) return checked;
  for (std::size_t i = 0; i < lens.p.size(); ++i)
    if (auto checked = check(lens.p[i], "p" + std::to_string(i + 1)); !checked) return checked;
  return {};
}

}  // namespace

DVec2 photo_from_plane(const Lens& lens, DVec2 plane) {
  const double r2 = glm::dot(plane, plane), xy = plane.x * plane.y;
  DVec2 bent = plane * radial_ratio(lens, std::sqrt(r2));
  bent.x += 2 * lens.p[0] * xy + lens.p[1] * (r2 + 2 * plane.x * plane.x);
  bent.y += 2 * lens.p[1] * xy + lens.p[0] * (r2 + 2 * plane.y * plane.y);
  return {lens.fx * bent.x + lens.cx, lens.fy * bent.y + lens.cy};
}

Lens resized(const Lens& lens, int width, int height) {
  Lens out = lens;
  const double scale_x = double(width) / lens.width, scale_y = double(height) / lens.height;
  out.fx *= scale_x, out.cx *= scale_x;
  out.fy *= scale_y, out.cy *= scale_y;
  out.width = width, out.height = height;
  return out;
}

Result<scene::Camera> undistorted_camera(const Lens& lens) {
  scene::Camera camera;
  camera.fx = lens.fx, camera.fy = lens.fy, camera.cx = lens.cx, camera.cy = lens.cy;
  camera.width = lens.width, camera.height = lens.height;
  if (auto valid = validate(camera); !valid) return propagate(valid);
  if (auto valid = validate_coefficients(lens); !valid) return propagate(valid);
  if (lens.is_pinhole() || fills_picture(lens, 1)) return camera;

  double too_wide = 1, zoom = 4;
  if (!fills_picture(lens, zoom))
    return fail(ErrorCode::unsupported,
                "the lens distorts too strongly, or its principal point lies outside the photo: undistort the photos "
                "first, for example with `colmap image_undistorter`");
  for (int i = 0; i < 30; ++i) {  // halves the interval down to 3e-9, far below a pixel in 16384
    const double middle = 0.5 * (too_wide + zoom);
    (fills_picture(lens, middle) ? zoom : too_wide) = middle;
  }
  camera.fx *= zoom, camera.fy *= zoom;
  return camera;
}

Result<scene::Image> undistort(const scene::Image& photo, const Lens& lens, const scene::Camera& camera) {
  if (photo.width != lens.width || photo.height != lens.height)
    return fail(ErrorCode::invalid_argument, "the photo is " + std::to_string(photo.width) + "x" +
                                                 std::to_string(photo.height) +
                                                 " pixels, its lens was calibrated for " + std::to_string(lens.width) +
                                                 "x" + std::to_string(lens.height));
  scene::Image out(camera.width, camera.height, photo.channels);
  // fmin and fmax also turn a NaN, which a lens bent beyond all measure can give, into an index.
  const auto within = [](double position, int size) { return std::fmin(std::fmax(position, 0.0), size - 1.0); };
  parallel_for(std::size_t(out.height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y) {
      for (int x = 0; x < out.width; ++x) {
        const DVec2 plane((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
        const DVec2 seen = photo_from_plane(lens, plane);
        const double u = within(seen.x - 0.5, photo.width), v = within(seen.y - 0.5, photo.height);
        const int x0 = int(u), y0 = int(v);
        const int x1 = std::min(x0 + 1, photo.width - 1), y1 = std::min(y0 + 1, photo.height - 1);
        const auto a = float(u - x0), b = float(v - y0);
        for (int c = 0; c < out.channels; ++c) {
          const float above = (1 - a) * photo.at(x0, y0, c) + a * photo.at(x1, y0, c);
          const float below = (1 - a) * photo.at(x0, y1, c) + a * photo.at(x1, y1, c);
          out.at(x, y, c) = (1 - b) * above + b * below;
        }
      }
    }
  });
  return out;
}

}  // namespace engine::io
