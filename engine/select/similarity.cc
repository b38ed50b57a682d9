#include "engine/select/similarity.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/scene/sh.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice

// What difference counts for one, at the least; in a noisy capture, it is so many times what neighbours usually differ
// by. Chosen as those of neighbourhood.cc.
constexpr float least_color = 0.10f;    // of 0 to 1, over the three channels
constexpr float least_turn = 0.25f;     // 1 - cos of the angle between normals: 41 degrees
constexpr float least_log_size = 0.7f;  // a factor of two
constexpr float usual_differences = 8.0f;
constexpr float spacings_apart = 2.0f;  // so many spacings apart, the same surface hardly goes on

/// What an edge compares of a Gaussian.
struct Look {
  Vec3 color;      ///< 0 to 1
  Vec3 normal;     ///< Unit.
  float flat;      ///< 0 for a sphere or a needle, 1 for a disc: how much its normal means.
  float log_size;  ///< Of its two longer axes.
};

Look look_of(const scene::GaussianCloud& cloud, std::size_t row) {
  Look look;
  const std::size_t stride = scene::sh_coefficients(cloud.sh_degree);
  for (int c = 0; c < 3; ++c)
    look.color[c] = std::clamp(0.5f + float(scene::sh_c0) * cloud.sh_row(row)[std::size_t(c) * stride], 0.0f, 1.0f);
  const Vec3 scale = cloud.log_scale.get(row);
  std::array<int, 3> axes{0, 1, 2};
  std::sort(axes.begin(), axes.end(), [&](int a, int b) { return scale[a] < scale[b]; });
  const Quat q = cloud.rotation.get(row);
  const float length = std::max({std::abs(q.w), std::abs(q.x), std::abs(q.y), std::abs(q.z), 1e-30f});
  look.normal = glm::mat3_cast(glm::normalize(q / length))[axes[0]];
  look.flat = 1 - std::exp(std::max(scale[axes[0]] - scale[axes[1]], -20.0f));
  look.log_size = std::clamp(0.5f * (scale[axes[1]] + scale[axes[2]]), -20.0f, 20.0f);
  return look;
}

/// How two Gaussians differ: squares.
struct Difference {
  float color = 0, turn = 0, log_size = 0;
};

Difference difference(const Look& a, const Look& b) {
  const Vec3 color = a.color - b.color;
  const float turn = a.flat * b.flat * (1 - std::min(std::abs(glm::dot(a.normal, b.normal)), 1.0f));
  const float log_size = a.log_size - b.log_size;
  return {glm::dot(color, color), turn, log_size * log_size};
}

/// The mean difference over all edges: what is usual.
Difference usual_difference(std::span<const Look> looks, const NeighbourGraph& graph) {
  std::vector<std::array<double, 3>> sums(chunk_count(graph.size(), grain), {0, 0, 0});
  parallel_for(graph.size(), grain, [&](std::size_t begin, std::size_t end) {
    std::array<double, 3>& sum = sums[begin / grain];
    for (std::size_t node = begin; node < end; ++node)
      for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
        const Difference one = difference(looks[node], looks[graph.to[edge]]);
        sum[0] += double(one.color), sum[1] += double(one.turn), sum[2] += double(one.log_size);
      }
  });
  std::array<double, 3> all{0, 0, 0};
  for (const auto& sum : sums)
    for (std::size_t i = 0; i < 3; ++i) all[i] += sum[i];
  const double edges = std::max(double(graph.to.size()), 1.0);
  return {float(all[0] / edges), float(all[1] / edges), float(all[2] / edges)};
}

}  // namespace

std::vector<float> similarity_of_edges(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                       const NeighbourGraph& graph) {
  std::vector<Look> looks(rows.size());
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node) looks[node] = look_of(cloud, rows[node]);
  });
  const Difference usual = usual_difference(looks, graph);
  const float color = std::max(least_color * least_color, usual_differences * usual.color);
  const float turn = std::max(least_turn, usual_differences * usual.turn);
  const float log_size = std::max(least_log_size * least_log_size, usual_differences * usual.log_size);
  std::vector<float> out(graph.to.size());
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
        const std::uint32_t other = graph.to[edge];
        const Difference one = difference(looks[node], looks[other]);
        const float spacing = spacings_apart * std::min(graph.spacing[node], graph.spacing[other]);
        const float apart = graph.length[edge] > 0 ? std::min(graph.length[edge] / spacing, 10.0f) : 0.0f;
        out[edge] = std::exp(-(one.color / color + one.turn / turn + one.log_size / log_size + apart * apart));
      }
  });
  return out;
}

}  // namespace engine::select
