#include "engine/render/reference/forward_reference.h"

#include "engine/render/blend.h"
#include "engine/render/reference/reference_splats.h"

namespace engine::render {

template <std::floating_point Real>
ReferencePictures<Real> forward_reference(const Layers& layers, const scene::Camera& camera,
                                          const ForwardOptions& options, std::span<const Real> weight) {
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  ReferencePictures<Real> out;
  for (auto& plane : out.color) plane.assign(pixels, 0);
  out.depth.assign(pixels, 0);
  out.median_depth.assign(pixels, 0);
  out.weight.assign(pixels, 0);
  out.contributions.assign(pixels, 0);
  std::vector<Real> transmittance(pixels, 1);
  std::vector<std::uint8_t> ended(pixels, 0);

  for (const ReferenceSplat<Real>& splat : reference_splats(layers, view_params<Real>(camera), options)) {
    const auto [columns, rows] = reach_of(splat, options.semantics, camera.width, camera.height);
    for (int y = rows.begin; y < rows.end; ++y)
      for (int x = columns.begin; x < columns.end; ++x) {
        const std::size_t pixel = std::size_t(y) * std::size_t(camera.width) + std::size_t(x);
        if (ended[pixel]) continue;
        const Real alpha = falloff(splat.at, splat.opacity, Real(x) - splat.at.x, Real(y) - splat.at.y).alpha;
        if (alpha < Real(min_alpha)) continue;
        const Real before = transmittance[pixel], after = before * (1 - alpha);
        if (options.semantics != Semantics::dense_nostop && after < Real(min_transmittance)) {
          ended[pixel] = 1;
          continue;
        }
        const Real blend = before * alpha;
        for (std::size_t c = 0; c < 3; ++c) out.color[c][pixel] += blend * splat.color[c];
        out.depth[pixel] += blend * splat.at.depth;
        if (!weight.empty()) out.weight[pixel] += blend * weight[splat.row];
        if (before >= Real(0.5) && after < Real(0.5)) out.median_depth[pixel] = splat.at.depth;
        transmittance[pixel] = after;
        ++out.contributions[pixel];
      }
  }
  out.alpha.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (int c = 0; c < 3; ++c) out.color[std::size_t(c)][i] += transmittance[i] * Real(options.background[c]);
    out.alpha[i] = 1 - transmittance[i];
  }
  return out;
}

template ReferencePictures<float> forward_reference(const Layers&, const scene::Camera&, const ForwardOptions&,
                                                    std::span<const float>);
template ReferencePictures<double> forward_reference(const Layers&, const scene::Camera&, const ForwardOptions&,
                                                     std::span<const double>);

}  // namespace engine::render
