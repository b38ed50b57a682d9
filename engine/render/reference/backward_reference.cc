#include "engine/render/reference/backward_reference.h"

#include <algorithm>
#include <limits>

#include "engine/render/blend.h"
#include "engine/render/reference/reference_splats.h"

namespace engine::render {
namespace {

/// What the walk back starts from, per pixel.
template <std::floating_point Real>
struct Rays {
  std::vector<Real> transmittance;   ///< Behind the last blended splat.
  std::vector<std::size_t> blended;  ///< Splats from this one on are not blended.
};

/// The forward pass, of which only the ends of the rays are kept.
template <std::floating_point Real>
Rays<Real> ends_of_rays(const std::vector<ReferenceSplat<Real>>& splats, Semantics semantics, int width, int height) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  Rays<Real> rays{std::vector<Real>(pixels, 1), std::vector<std::size_t>(pixels, splats.size())};
  // Without an early stop a ray goes on until dividing would no longer bring its transmittance back.
  const Real floor = semantics == Semantics::dense_nostop ? std::numeric_limits<Real>::min() : Real(min_transmittance);
  for (std::size_t k = 0; k < splats.size(); ++k) {
    const auto& splat = splats[k];
    const auto [columns, rows] = reach_of(splat, semantics, width, height);
    for (int y = rows.begin; y < rows.end; ++y)
      for (int x = columns.begin; x < columns.end; ++x) {
        const std::size_t pixel = std::size_t(y) * std::size_t(width) + std::size_t(x);
        if (rays.blended[pixel] < k) continue;
        const Real alpha = falloff(splat.at, splat.opacity, Real(x) - splat.at.x, Real(y) - splat.at.y).alpha;
        if (alpha < Real(min_alpha)) continue;
        const Real after = rays.transmittance[pixel] * (1 - alpha);
        if (after < floor) {
          rays.blended[pixel] = k;
        } else {
          rays.transmittance[pixel] = after;
        }
      }
  }
  return rays;
}

/// dL/d(pictures) at one pixel.
template <std::floating_point Real>
struct PixelUpstream {
  std::array<Real, 3> color{};
  Real depth = 0, alpha = 0;
};

template <std::floating_point Real>
PixelUpstream<Real> at_pixel(const ReferenceUpstream<Real>& upstream, std::size_t pixel) {
  PixelUpstream<Real> v;
  for (std::size_t c = 0; c < 3; ++c)
    if (!upstream.color[c].empty()) v.color[c] = upstream.color[c][pixel];
  if (!upstream.depth.empty()) v.depth = upstream.depth[pixel];
  if (!upstream.alpha.empty()) v.alpha = upstream.alpha[pixel];
  return v;
}

/// dL/d(splat) of every splat, by walking all rays back to front.
template <std::floating_point Real>
std::vector<SplatGradient<double>> splat_gradients(const std::vector<ReferenceSplat<Real>>& splats,
                                                   const scene::Camera& camera, const BackwardOptions& options,
                                                   const ReferenceUpstream<Real>& upstream) {
  const Semantics semantics = options.forward.semantics;
  const Rays<Real> ends = ends_of_rays(splats, semantics, camera.width, camera.height);
  std::vector<RayBackward<Real>> rays(ends.transmittance.size());
  for (std::size_t pixel = 0; pixel < rays.size(); ++pixel) {
    const PixelUpstream<Real> v = at_pixel(upstream, pixel);
    Real v_transmittance = -v.alpha;
    for (std::size_t c = 0; c < 3; ++c) v_transmittance += Real(options.forward.background[int(c)]) * v.color[c];
    rays[pixel] = {ends.transmittance[pixel], ends.transmittance[pixel] * v_transmittance};
  }

  std::vector<SplatGradient<double>> v_splats(splats.size());
  for (std::size_t k = splats.size(); k-- > 0;) {
    const auto& splat = splats[k];
    const auto [columns, rows] = reach_of(splat, semantics, camera.width, camera.height);
    for (int y = rows.begin; y < rows.end; ++y)
      for (int x = columns.begin; x < columns.end; ++x) {
        const std::size_t pixel = std::size_t(y) * std::size_t(camera.width) + std::size_t(x);
        if (ends.blended[pixel] <= k) continue;
        const auto at = falloff(splat.at, splat.opacity, Real(x) - splat.at.x, Real(y) - splat.at.y);
        if (at.alpha < Real(min_alpha)) continue;
        const PixelUpstream<Real> v = at_pixel(upstream, pixel);
        Real v_weight = splat.at.depth * v.depth;
        for (std::size_t c = 0; c < 3; ++c) v_weight += splat.color[c] * v.color[c];
        const Real v_alpha = blend_vjp(at.alpha, v_weight, rays[pixel]);
        falloff_vjp(at, v_alpha, options.alpha_clamp, v_splats[k]);
        const Real weight = rays[pixel].transmittance * at.alpha;
        for (std::size_t c = 0; c < 3; ++c) v_splats[k].color[c] += weight * v.color[c];
        v_splats[k].depth += weight * v.depth;
      }
  }
  return v_splats;
}

template <std::floating_point Real>
SplatGradient<Real> narrowed(const SplatGradient<double>& v) {
  return {.g = Real(v.g),
          .along = Real(v.along),
          .across = Real(v.across),
          .along_along = Real(v.along_along),
          .along_across = Real(v.along_across),
          .across_across = Real(v.across_across),
          .color = {Real(v.color[0]), Real(v.color[1]), Real(v.color[2])},
          .depth = Real(v.depth)};
}

}  // namespace

template <std::floating_point Real>
ReferenceGradients<Real> backward_reference(const Layers& layers, const scene::Camera& camera,
                                            const BackwardOptions& options, const ReferenceUpstream<Real>& upstream,
                                            std::span<const std::uint32_t> rows) {
  const auto view = view_params<Real>(camera);
  const int degree = std::min(layers.base->sh_degree, options.forward.max_sh_degree);
  const std::size_t stride = layers.base->sh_stride();
  ReferenceGradients<Real> out;
  out.mean.resize(rows.size());
  out.log_scale.resize(rows.size());
  out.rotation.resize(rows.size());
  out.opacity_logit.resize(rows.size());
  out.sh.resize(rows.size() * stride);
  out.mean2d_px.resize(rows.size());

  const auto splats = reference_splats(layers, view, options.forward);
  const auto v_splats = splat_gradients(splats, camera, options, upstream);
  for (std::size_t k = 0; k < splats.size(); ++k) {
    const auto found = std::lower_bound(rows.begin(), rows.end(), splats[k].row);
    if (found == rows.end() || *found != splats[k].row) continue;
    const auto r = std::size_t(found - rows.begin());
    const LayerRow at = layer_row(layers, splats[k].row);
    const StoredShape<Real> stored(at);
    const auto v_splat = narrowed<Real>(v_splats[k]);
    const auto v_projection = projection_gradient(splats[k].at, v_splat);
    const auto v = project_vjp(view, stored.mean, stored.log_scale, stored.rotation, v_projection);
    const auto v_mean_of_color = color_vjp(view, stored.mean, at.cloud.sh_row(at.row), degree, v_splat.color,
                                           std::span<Real>(out.sh).subspan(r * stride, stride));
    for (std::size_t i = 0; i < 3; ++i) out.mean[r][i] = v.mean[i] + v_mean_of_color[i];
    out.log_scale[r] = v.log_scale;
    out.rotation[r] = v.rotation;
    out.opacity_logit[r] = opacity_logit_gradient(Real(at.cloud.opacity_logit[at.row]), v_splat);
    out.mean2d_px[r] = {v_projection.x, v_projection.y};
  }
  return out;
}

template ReferenceGradients<float> backward_reference(const Layers&, const scene::Camera&, const BackwardOptions&,
                                                      const ReferenceUpstream<float>&, std::span<const std::uint32_t>);
template ReferenceGradients<double> backward_reference(const Layers&, const scene::Camera&, const BackwardOptions&,
                                                       const ReferenceUpstream<double>&,
                                                       std::span<const std::uint32_t>);

}  // namespace engine::render
