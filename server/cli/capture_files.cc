#include "server/cli/capture_files.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <span>
#include <sstream>
#include <string>
#include <utility>

#include "engine/core/atomic_file.h"
#include "engine/core/vec.h"
#include "engine/io/quantised.h"

namespace server::cli {
namespace {

using engine::Result;
using engine::scene::Camera;
using engine::scene::GaussianCloud;

std::ostringstream text() {
  std::ostringstream out;
  out << std::setprecision(std::numeric_limits<double>::max_digits10);
  return out;
}

std::string cameras_text(const std::vector<Camera>& views) {
  auto out = text();
  out << "# camera id, model, width, height, fx, fy, cx, cy\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera& view = views[i];
    out << i + 1 << " PINHOLE " << view.width << ' ' << view.height << ' ' << view.fx << ' ' << view.fy << ' '
        << view.cx << ' ' << view.cy << '\n';
  }
  return out.str();
}

std::string images_text(const std::vector<Camera>& views) {
  auto out = text();
  out << "# image id, qw, qx, qy, qz, tx, ty, tz, camera id, name; then a line of 2D points, empty here\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const engine::DQuat q = glm::normalize(glm::quat_cast(views[i].rotation));
    const engine::DVec3 t = views[i].translation;
    out << i + 1 << ' ' << q.w << ' ' << q.x << ' ' << q.y << ' ' << q.z << ' ' << t.x << ' ' << t.y << ' ' << t.z
        << ' ' << i + 1 << ' ' << views[i].name << "\n\n";
  }
  return out.str();
}

int colour_byte(const GaussianCloud& cloud, std::size_t row, std::size_t channel) {
  const double dc = cloud.sh_row(row)[channel * engine::scene::sh_coefficients(cloud.sh_degree)];
  return int(std::lround(255 * std::clamp(0.5 + engine::io::sh_c0 * dc, 0.0, 1.0)));
}

std::string points_text(const GaussianCloud& cloud, std::size_t max_points) {
  auto out = text();
  out << std::setprecision(std::numeric_limits<float>::max_digits10);
  out << "# point id, x, y, z, r, g, b, error, track (empty here)\n";
  const std::size_t step = std::max<std::size_t>(1, (cloud.size() + max_points - 1) / max_points);
  for (std::size_t row = 0; row < cloud.size(); row += step) {
    const engine::Vec3 mean = cloud.mean.get(row);
    out << row / step + 1 << ' ' << mean.x << ' ' << mean.y << ' ' << mean.z;
    for (std::size_t channel = 0; channel < 3; ++channel) out << ' ' << colour_byte(cloud, row, channel);
    out << " 0\n";
  }
  return out.str();
}

}  // namespace

Result<void> write_colmap_text(const std::filesystem::path& folder, const std::vector<Camera>& views,
                               const GaussianCloud& cloud, std::size_t max_points) {
  for (const auto& [name, content] : {std::pair<const char*, std::string>{"cameras.txt", cameras_text(views)},
                                      {"images.txt", images_text(views)},
                                      {"points3D.txt", points_text(cloud, max_points)}}) {
    auto written = engine::write_file(folder / name, std::as_bytes(std::span(content)));
    if (!written) return written;
  }
  return {};
}

}  // namespace server::cli
