#include "engine/repair/surroundings.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/correct/corrector.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/forward.h"
#include "engine/repair/seed.h"
#include "engine/repair/survey.h"

namespace engine::repair {
namespace {

constexpr int most_px = 512;  // of a picture's longer side: finer ones show the same points more often
// Fewer pixels may be an error of the depth at an outline; more of them tell no more than so many.
constexpr std::size_t least_pixels = 3, many_pixels = 20;
constexpr std::size_t neighbours_asked = 12;  // they say how a surface lies: a choice
constexpr float farthest = 1e9f;              // of a place, so that squares of distances fit a float

/// What a pixel shows.
struct Sample {
  std::uint64_t cell = 0;  ///< Of a grid of surroundings_spacing.
  Vec3 place{0.0f}, color{0.0f};
};

/// Cells per axis, from the middle of the part: its half extent, and what is around it.
constexpr int cells = int((0.5f + surroundings_reach) / surroundings_spacing) + 1;

void add_samples(const scene::Camera& camera, const render::Rendering& shown, const Surroundings& frame,
                 std::vector<Sample>& samples) {
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double depth = double(shown.median_depth.at(x, y));
      if (!(depth > 0) || shown.alpha.at(x, y) < correct::trusted) continue;
      const Vec3 place = frame.place_of(point_at(camera, {x + 0.5, y + 0.5}, 1 / depth));
      std::uint64_t cell = 0;
      bool is_near = true;
      for (int axis = 0; axis < 3; ++axis) {
        const float at = std::floor(place[axis] / surroundings_spacing);
        is_near = is_near && at >= -float(cells) && at < float(cells);
        if (is_near) cell = cell * (2 * cells) + std::uint64_t(int(at) + cells);
      }
      if (!is_near) continue;
      Vec3 color;
      for (int c = 0; c < 3; ++c) color[c] = std::clamp(shown.color.at(x, y, c), 0.0f, 1.0f);
      samples.push_back({cell, place, color});
    }
}

/// A point for each cell that enough pixels show.
void gather(std::vector<Sample>& samples, Surroundings& out) {
  std::ranges::stable_sort(samples, {}, &Sample::cell);
  for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
    Vec3 place(0.0f), color(0.0f);
    for (end = begin; end < samples.size() && samples[end].cell == samples[begin].cell; ++end)
      place += samples[end].place, color += samples[end].color;
    const std::size_t count = end - begin;
    if (count < least_pixels) continue;
    for (int axis = 0; axis < 3; ++axis) out.place.push_back(place[axis] / float(count));
    out.color.push_back(color / float(count));
    out.weight.push_back(float(std::min(count, many_pixels)) / float(many_pixels));
  }
}

std::vector<Vec3> normals_of(const Surroundings& around) {
  const std::size_t asked = std::min(neighbours_asked, around.size());
  const auto nearest = neighbours::PointIndex(around.place, 3).nearest(around.place, asked);
  std::vector<Vec3> normals(around.size());
  parallel_for(around.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto beside = std::span(nearest).subspan(i * asked, asked);
      DVec3 mean(0.0);
      for (const auto& n : beside) mean += DVec3(around.at(n.index)) / double(asked);
      Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
      for (const auto& n : beside) {
        const DVec3 offset = DVec3(around.at(n.index)) - mean;
        const Eigen::Vector3d column(offset.x, offset.y, offset.z);
        spread += column * column.transpose();
      }
      const Eigen::Vector3d least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
      normals[i] = Vec3(float(least.x()), float(least.y()), float(least.z()));
    }
  });
  return normals;
}

}  // namespace

Vec3 Surroundings::place_of(DVec3 point) const {
  const DVec3 apart = (point - middle) / extent;
  return Vec3(glm::clamp(apart, DVec3(-double(farthest)), DVec3(double(farthest))));
}

Result<Surroundings> surroundings_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                                     std::span<const scene::Camera> cameras,
                                     const std::function<Result<void>(double)>& looked) {
  Surroundings out;
  if (part.empty()) return out;
  const Bounds box = most_of(scene, part);
  out.middle = (box.low + box.high) / 2.0;
  out.extent = glm::length(box.high - box.low);
  if (!(out.extent > 0)) return out;

  render::Layers layers(scene);
  layers.hidden = part;
  render::ForwardOptions options;
  options.depth = true;
  render::Workspace workspace;
  render::Rendering shown;
  std::vector<Sample> samples;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    const scene::Camera camera = scene::fit_within(cameras[v], most_px);
    render::forward(layers, camera, options, {}, workspace, shown);
    add_samples(camera, shown, out, samples);
    if (auto going = looked(double(v + 1) / double(cameras.size())); !going) return propagate(going);
  }
  gather(samples, out);
  if (out.size() == 0) return out;
  out.normal = normals_of(out);

  std::vector<float> rows;
  for (const std::uint32_t row : part) {
    const DVec3 mean(scene.mean.get(row));
    if (glm::any(glm::lessThan(mean, box.low)) || glm::any(glm::greaterThan(mean, box.high))) continue;
    const Vec3 place = out.place_of(mean);
    for (int axis = 0; axis < 3; ++axis) rows.push_back(place[axis]);
  }
  out.distance.assign(out.size(), surroundings_reach);
  if (rows.empty()) return out;
  const auto nearest = neighbours::PointIndex(rows, 3).nearest(out.place, 1);
  for (std::size_t i = 0; i < out.size(); ++i) out.distance[i] = std::sqrt(nearest[i].squared_distance);
  return out;
}

}  // namespace engine::repair
