// What tests of gradients share: upstream, the passes at hand, and their results as columns and as one vector.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/backward.h"
#include "engine/render/reference/backward_reference.h"
#include "engine/render/reference/forward_reference.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {

constexpr float y0 = 0.28209479177387814f;  // the constant SH function

inline std::vector<std::uint32_t> all_rows(const Layers& layers) {
  std::vector<std::uint32_t> rows(layers.size());
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

inline Upstream random_upstream(int width, int height, std::uint64_t seed) {
  Upstream upstream{scene::Image(width, height, 3), scene::Image(width, height, 1), scene::Image(width, height, 1)};
  Rng rng(seed);
  for (scene::Image* image : {&upstream.color, &upstream.depth, &upstream.alpha})
    for (float& value : image->data) value = rng.normal();
  return upstream;
}

inline BackwardOptions on(Backend backend, Semantics semantics = Semantics::dense_stop) {
  return {.forward = {.background = {0.1f, 0.5f, 0.9f}, .backend = backend, .semantics = semantics}};
}

inline Gradients gradients_of(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                              const Upstream& upstream, std::span<const std::uint32_t> rows) {
  Gradients out;
  out.reset(rows.size(), layers.base->sh_degree);
  BackwardWorkspace workspace;
  backward(layers, camera, options, upstream, rows, workspace, out);
  return out;
}

inline Gradients gradients_of(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                              const Upstream& upstream) {
  return gradients_of(layers, camera, options, upstream, all_rows(layers));
}

/// Gradients of the sum of the three channels at the one pixel of one_pixel_camera(), before black.
inline Gradients at_one_pixel(const scene::GaussianCloud& cloud, BackwardOptions options) {
  options.forward.background = Vec3(0.0f);
  return gradients_of(cloud, one_pixel_camera(), options, {.color = scene::Image(1, 1, 3, 1.0f)});
}

inline float sigmoid(float logit) { return 1 / (1 + std::exp(-logit)); }

struct Column {
  const char* name;
  std::vector<float> values;
};

inline std::vector<Column> columns_of(const Gradients& g) {
  return {{"mean.x", g.mean.x},
          {"mean.y", g.mean.y},
          {"mean.z", g.mean.z},
          {"log_scale.x", g.log_scale.x},
          {"log_scale.y", g.log_scale.y},
          {"log_scale.z", g.log_scale.z},
          {"rotation.w", g.rotation.w},
          {"rotation.x", g.rotation.x},
          {"rotation.y", g.rotation.y},
          {"rotation.z", g.rotation.z},
          {"opacity_logit", g.opacity_logit},
          {"sh", g.sh},
          {"mean2d_x_px", g.mean2d_x_px},
          {"mean2d_y_px", g.mean2d_y_px}};
}

inline double relative_l2(const std::vector<float>& seen, const std::vector<float>& expected) {
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += std::pow(double(seen[i]) - double(expected[i]), 2);
    norm += std::pow(double(expected[i]), 2);
  }
  return std::sqrt(difference) / std::max(std::sqrt(norm), 1e-30);
}

inline void expect_close(const Gradients& seen, const Gradients& expected, double tolerance) {
  const auto a = columns_of(seen), b = columns_of(expected);
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].values.size(), b[i].values.size());
    EXPECT_LE(relative_l2(a[i].values, b[i].values), tolerance) << a[i].name;
  }
}

// Clouds and their gradients as one vector: mean, log scale and rotation component by component, logit, SH.

inline std::vector<double> values_of(const scene::GaussianCloud& cloud) {
  std::vector<double> x;
  for (const auto* column :
       {&cloud.mean.x, &cloud.mean.y, &cloud.mean.z, &cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z,
        &cloud.rotation.w, &cloud.rotation.x, &cloud.rotation.y, &cloud.rotation.z, &cloud.opacity_logit, &cloud.sh})
    x.insert(x.end(), column->begin(), column->end());
  return x;
}

inline scene::GaussianCloud with_values(scene::GaussianCloud cloud, const std::vector<double>& x) {
  auto next = x.begin();
  for (auto* column :
       {&cloud.mean.x, &cloud.mean.y, &cloud.mean.z, &cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z,
        &cloud.rotation.w, &cloud.rotation.x, &cloud.rotation.y, &cloud.rotation.z, &cloud.opacity_logit, &cloud.sh})
    for (float& value : *column) value = float(*next++);
  return cloud;
}

inline std::vector<double> values_of(const Gradients& g) {
  std::vector<double> x;
  for (const auto* column : {&g.mean.x, &g.mean.y, &g.mean.z, &g.log_scale.x, &g.log_scale.y, &g.log_scale.z,
                             &g.rotation.w, &g.rotation.x, &g.rotation.y, &g.rotation.z, &g.opacity_logit, &g.sh})
    x.insert(x.end(), column->begin(), column->end());
  return x;
}

inline std::vector<double> values_of(const ReferenceGradients<double>& g) {
  std::vector<double> x;
  const auto append = [&](const auto& arrays) {
    if (arrays.empty()) return;
    for (std::size_t k = 0; k < arrays[0].size(); ++k)
      for (const auto& array : arrays) x.push_back(array[k]);
  };
  append(g.mean), append(g.log_scale), append(g.rotation);
  x.insert(x.end(), g.opacity_logit.begin(), g.opacity_logit.end());
  x.insert(x.end(), g.sh.begin(), g.sh.end());
  return x;
}

inline ReferenceUpstream<double> planes_of(const Upstream& upstream) {
  const auto plane = [](const scene::Image& image, int c) {
    if (image.data.empty()) return std::vector<double>{};
    const auto from = image.plane(c);
    return std::vector<double>(from.begin(), from.end());
  };
  return {{plane(upstream.color, 0), plane(upstream.color, 1), plane(upstream.color, 2)},
          plane(upstream.depth, 0),
          plane(upstream.alpha, 0)};
}

/// <upstream, pictures>: the loss whose gradients a backward pass gives.
inline double loss(const ReferencePictures<double>& pictures, const ReferenceUpstream<double>& upstream) {
  double sum = 0;
  const auto add = [&](const std::vector<double>& picture, const std::vector<double>& weight) {
    for (std::size_t i = 0; i < weight.size(); ++i) sum += picture[i] * weight[i];
  };
  for (std::size_t c = 0; c < 3; ++c) add(pictures.color[c], upstream.color[c]);
  add(pictures.depth, upstream.depth);
  add(pictures.alpha, upstream.alpha);
  return sum;
}

}  // namespace engine::render
