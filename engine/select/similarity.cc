#include "engine/select/similarity.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/render/project.h"
#include "engine/scene/base_color.h"
#include "engine/select/shapes.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice

// Chosen on the captured cases mug, turn, plant and rod, and on the ball, the mug and an apple of the demo scene. Each
// but most_by_color may be doubled or halved, and what one to four clicks select stays about the same.
constexpr float color_difference = 0.15f;  // that counts for one; of 0 to 1, over the three channels
// The most that colours speak for a border: patterns have borders as sharp as things have. Infinite, the stripes of a
// ball are things of their own; 2.5 takes part of what a thing stands on.
constexpr float most_by_color = 3.0f;
constexpr float turn_difference = 0.5f;  // that counts for one; 1 - cos of the angle between normals: 60 degrees
// Opacity below which an edge counts the less: between a thing and the wall behind it a trainer leaves a haze that
// hangs together with both. Chosen on single clicks on captured cases and on a trained capture of a doll: 0.1 and 0.2
// take parts of the captured things from each other, whose Gaussians are fainter, and 0.02 is too little for the doll's
// bow and hat.
constexpr float hardly_shows = 0.05f;
constexpr double thinnest = 0.5;  // of the spacing: what is thinner does not overlap with its own surface
constexpr int smoothing_rounds = 2;
constexpr float smoothed_difference = 0.15f;  // of colours: standard deviation of how alike is alike

/// Of the logarithm of a length: what floats hold, so that no square or product of squares leaves the range of doubles.
constexpr float most_log_length = 88.0f;

/// What an edge compares of a Gaussian.
struct Look {
  DMat3 covariance{0.0};  ///< With `thinnest`.
  double root = 0;        ///< Fourth root of its determinant.
  double weight = 0;      ///< Opacity times the product of the two longer axes: how much of a picture it can fill.
  Vec3 normal{0.0f};      ///< Unit.
  float flat = 0;         ///< 0 for a sphere or a needle, 1 for a disc: how much its normal means.
  float shows = 0;        ///< 0 to 1, from `hardly_shows` on.
};

DMat3 rotation_of_row(const scene::GaussianCloud& cloud, std::size_t row) {
  return rotation_of(DQuat(cloud.rotation.get(row)));
}

/// Half-axes, world units.
DVec3 extent_of(const scene::GaussianCloud& cloud, std::size_t row) {
  return glm::exp(DVec3(glm::clamp(cloud.log_scale.get(row), -most_log_length, most_log_length)));
}

DVec3 thickened(DVec3 extent, double spacing) { return extent * extent + DVec3(std::pow(thinnest * spacing, 2.0)); }

/// R diag(variance) R^T
DMat3 covariance_of(const DMat3& rotation, DVec3 variance) {
  DMat3 scaled = rotation;
  for (int axis = 0; axis < 3; ++axis) scaled[axis] *= variance[axis];
  return scaled * glm::transpose(rotation);
}

Look look_of(const scene::GaussianCloud& cloud, std::size_t row, double spacing) {
  const DMat3 rotation = rotation_of_row(cloud, row);
  const DVec3 extent = extent_of(cloud, row), variance = thickened(extent, spacing);
  std::array<int, 3> axes{0, 1, 2};
  std::sort(axes.begin(), axes.end(), [&](int a, int b) { return extent[a] < extent[b]; });
  Look look;
  look.covariance = covariance_of(rotation, variance);
  look.root = std::pow(variance.x * variance.y * variance.z, 0.25);
  const float opacity = render::opacity<float>(cloud.opacity_logit[row]);
  look.weight = double(opacity) * extent[axes[1]] * extent[axes[2]];
  look.normal = Vec3(rotation[axes[0]]);
  look.flat = float(1 - extent[axes[0]] / extent[axes[1]]);
  look.shows = std::min(opacity / hardly_shows, 1.0f);
  return look;
}

/// d^T S^-1 d, and the determinant of S, which is symmetric; a determinant of 0 if S cannot be inverted.
struct Inverted {
  double squared_distance = 0, determinant = 0;
};
Inverted through_inverse(const DMat3& s, DVec3 d) {
  const DVec3 first = glm::cross(s[1], s[2]), second = glm::cross(s[2], s[0]), third = glm::cross(s[0], s[1]);
  const double determinant = glm::dot(s[0], first);
  if (!(determinant > 0)) return {};
  const double sum = d.x * glm::dot(first, d) + d.y * glm::dot(second, d) + d.z * glm::dot(third, d);
  return {std::max(sum / determinant, 0.0), determinant};
}

/// Bhattacharyya coefficient of two Gaussians, 0 to 1.
double overlap(const Look& a, const Look& b, DVec3 between) {
  const Inverted mean = through_inverse(0.5 * (a.covariance + b.covariance), between);
  if (!(mean.determinant > 0)) return 0;  // discs without any thickness or spacing
  return std::min(std::exp(-0.125 * mean.squared_distance) * (a.root * b.root / std::sqrt(mean.determinant)), 1.0);
}

/// Calls use(node, edge) for each edge from a node to a higher one: each pair once.
template <class Use>
void each_pair(const neighbours::NeighbourGraph& graph, Use&& use) {
  parallel_for(graph.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
        if (graph.to[edge] > node) use(node, edge);
  });
}

float squared(Vec3 v) { return glm::dot(v, v); }

/// Colours evened out once.
std::vector<Vec3> smoothed(const neighbours::NeighbourGraph& graph, std::span<const Look> looks,
                           std::span<const float> overlaps, std::span<const Vec3> colors) {
  std::vector<Vec3> out(colors.size());
  parallel_for(graph.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node) {
      double weights = looks[node].weight;
      DVec3 sum = weights * DVec3(colors[node]);
      for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
        const std::uint32_t other = graph.to[edge];
        const float apart = squared(colors[other] - colors[node]) / (2 * smoothed_difference * smoothed_difference);
        const double weight = looks[other].weight * double(overlaps[edge] * std::exp(-apart));
        weights += weight;
        sum += weight * DVec3(colors[other]);
      }
      out[node] = weights > 0 ? Vec3(sum / weights) : colors[node];  // opacities may be 0
    }
  });
  return out;
}

}  // namespace

Vec3 color_of(const scene::GaussianCloud& cloud, std::size_t row) {
  return glm::clamp(scene::base_color(cloud, row), 0.0f, 1.0f);
}

std::vector<float> similarity_of_edges(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                       const neighbours::NeighbourGraph& graph) {
  std::vector<Look> looks(rows.size());
  std::vector<Vec3> colors(rows.size());
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node) {
      looks[node] = look_of(cloud, rows[node], double(graph.spacing[node]));
      colors[node] = color_of(cloud, rows[node]);
    }
  });
  std::vector<float> out(graph.to.size());
  each_pair(graph, [&](std::size_t node, std::uint32_t edge) {
    const std::uint32_t other = graph.to[edge];
    const DVec3 between = DVec3(cloud.mean.get(rows[other])) - DVec3(cloud.mean.get(rows[node]));
    out[edge] = out[graph.back[edge]] = float(overlap(looks[node], looks[other], between));
  });
  for (int round = 0; round < smoothing_rounds; ++round) colors = smoothed(graph, looks, out, colors);
  each_pair(graph, [&](std::size_t node, std::uint32_t edge) {
    const Look &a = looks[node], &b = looks[graph.to[edge]];
    const float color = squared(colors[node] - colors[graph.to[edge]]) / (color_difference * color_difference);
    const float turn = a.flat * b.flat * (1 - std::min(std::abs(glm::dot(a.normal, b.normal)), 1.0f));
    out[edge] *= a.shows * b.shows * std::exp(-(std::min(color, most_by_color) + turn / turn_difference));
    out[graph.back[edge]] = out[edge];
  });
  return out;
}

double cover(const scene::GaussianCloud& cloud, std::size_t row, double spacing, DVec3 point) {
  const DVec3 from_mean = point - DVec3(cloud.mean.get(row));
  const DVec3 along = glm::transpose(rotation_of_row(cloud, row)) * from_mean;
  const DVec3 variance = thickened(extent_of(cloud, row), spacing);
  const double falloff = std::exp(-0.5 * glm::dot(along / variance, along));
  return double(render::opacity<float>(cloud.opacity_logit[row])) * falloff;
}

}  // namespace engine::select
