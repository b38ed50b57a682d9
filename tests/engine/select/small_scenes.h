// Scenes of a few Gaussians for tests of selecting.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/sh.h"
#include "engine/select/select.h"

namespace engine::select {

/// Appends a grey ball of a Gaussian.
inline void add_at(scene::GaussianCloud& cloud, Vec3 mean, float opacity_logit = 4.0f, float log_scale = -3.0f,
                   Vec3 color = Vec3(0.5f)) {
  const std::size_t row = cloud.size();
  cloud.resize(row + 1);
  cloud.mean.set(row, mean);
  cloud.log_scale.set(row, Vec3(log_scale));
  cloud.rotation.set(row, {1, 0, 0, 0});
  cloud.opacity_logit[row] = opacity_logit;
  for (std::size_t c = 0; c < 3; ++c)
    cloud.sh_row(row)[c * scene::sh_coefficients(cloud.sh_degree)] = (color[int(c)] - 0.5f) / float(scene::sh_c0);
}

inline scene::GaussianCloud cloud_at(std::initializer_list<Vec3> means) {
  scene::GaussianCloud cloud;
  for (const Vec3 mean : means) add_at(cloud, mean);
  return cloud;
}

/// Rows at x = 0, 1, ..., n - 1.
inline scene::GaussianCloud line_of(int n) {
  scene::GaussianCloud cloud;
  for (int x = 0; x < n; ++x) add_at(cloud, {float(x), 0, 0});
  return cloud;
}

/// A square sheet of side x side flat Gaussians around `middle`, in a plane of constant z.
inline void add_sheet(scene::GaussianCloud& cloud, Vec3 middle, int side, float spacing, Vec3 color) {
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) {
      const float half = 0.5f * float(side - 1);
      add_at(cloud, middle + spacing * Vec3(float(u) - half, float(v) - half, 0), 4, std::log(0.6f * spacing), color);
      cloud.log_scale.z.back() = std::log(0.05f * spacing);
    }
}

/// A red board of 24 x 24 rows on a table of 48 x 48, whose corner is white: 4 x 4 rows, or as many as are asked for.
/// Nobody has seen the table under the board.
struct BoardOnTable {
  scene::GaussianCloud cloud;
  std::vector<std::uint32_t> board, corner, red;  ///< Rows, ascending; the board is the two others.

  explicit BoardOnTable(int corner_side = 4) {
    for (int y = -12; y < 36; ++y)
      for (int x = -12; x < 36; ++x)
        if (x < 0 || y < 0 || x >= 24 || y >= 24)
          add_sheet(cloud, 0.1f * Vec3(float(x) - 12, float(y) - 12, 0), 1, 0.1f, {0.6f, 0.4f, 0.2f});
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 24; ++x) {
        const auto row = std::uint32_t(cloud.size());
        const bool is_corner = x < corner_side && y < corner_side;
        add_sheet(cloud, 0.1f * Vec3(float(x) - 12, float(y) - 12, 0.3f), 1, 0.1f,
                  is_corner ? Vec3(0.95f) : Vec3(0.5f, 0.05f, 0.05f));
        (is_corner ? corner : red).push_back(row);
        board.push_back(row);
      }
  }
};

/// At the origin, along z; 100 x 100 pixels, of which 100 are as wide as the view is deep.
inline scene::Camera front_camera() {
  scene::Camera camera;
  camera.fx = camera.fy = 100;
  camera.cx = camera.cy = 50;
  camera.width = camera.height = 100;
  return camera;
}

/// The numbers of the selected rows.
inline std::vector<std::size_t> rows_of(const RowSet& rows) {
  std::vector<std::size_t> out;
  for (std::size_t row = 0; row < rows.size(); ++row)
    if (rows[row] != 0) out.push_back(row);
  return out;
}

using RowList = std::vector<std::size_t>;

/// The rows that a valid selection gives.
inline RowList selected(const scene::GaussianCloud& cloud, const Selection& selection) {
  return rows_of(select(cloud, selection).value().rows);
}

}  // namespace engine::select
