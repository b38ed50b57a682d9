// Backward splatting: how a loss over rendered pictures changes with the Gaussians.
// Source: Kerbl et al. 2023, appendix A, for the pullback of a projection; the rest is the chain rule.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/soa.h"
#include "engine/render/blend.h"
#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::render {

/// dL/d(picture) of the pictures that forward() made with the same options. An empty one is zero.
struct Upstream {
  scene::Image color = {};  ///< [3] dL/dcolor
  scene::Image depth = {};  ///< [1] dL/ddepth
  scene::Image alpha = {};  ///< [1] dL/dalpha
};

/// dL/d(stored values) of R chosen rows of a cloud: what log scales, quaternions of any length and logits are as a file
/// holds them. A quaternion's gradient has no component along it.
struct Gradients {
  int sh_degree = 0;
  Array3 mean;                       ///< [R] per world unit
  Array3 log_scale;                  ///< [R]
  Array4 rotation;                   ///< [R]
  std::vector<float> opacity_logit;  ///< [R]
  std::vector<float> sh;             ///< [R][3][sh_coefficients(sh_degree)], as GaussianCloud::sh
  /// dL/d(position of the splat in the picture), per pixel: the statistic densification goes by. Of the last view
  /// alone, since it is its length that is averaged over views; zero where the view shows nothing of the row.
  std::vector<float> mean2d_x_px, mean2d_y_px;  ///< [R]

  [[nodiscard]] std::size_t size() const { return opacity_logit.size(); }
  /// All zero, for so many rows of a cloud of this degree.
  void reset(std::size_t rows, int degree);
};

/// What a backward pass computes.
struct BackwardOptions {
  /// What was rendered. Its background, degree, rectangle, tiles, backend and semantics count; which pictures it asked
  /// for does not. Pixels outside the rectangle or the tiles contribute nothing.
  ForwardOptions forward;
  AlphaClamp alpha_clamp = AlphaClamp::exact;
};

/// Memory that a sequence of backward passes shares. Not for two threads at once.
class BackwardWorkspace {
 public:
  BackwardWorkspace();
  ~BackwardWorkspace();
  BackwardWorkspace(BackwardWorkspace&&) noexcept;
  BackwardWorkspace& operator=(BackwardWorkspace&&) noexcept;

 private:
  friend void backward(const Layers&, const scene::Camera&, const BackwardOptions&, const Upstream&,
                       std::span<const std::uint32_t>, BackwardWorkspace&, Gradients&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Adds dL/d(row) to out, for the rows that may change; all others only shape what is in front of and behind them.
///   layers, camera  what was rendered
///   rows      [R], rows of the layers, each once and ascending, none of them hidden: row rows[r] has its gradient at r
///   upstream  pictures of the size that forward() gave them: the camera's, or that of options.forward.rect
///   out       of R rows and the layers' degree (Gradients::reset()); added to, so that views sum, but for mean2d,
///             which is overwritten
///   values    finite for every finite cloud, valid camera and upstream of ordinary size, unless SH coefficients near
///             the end of float cancel
///   bytes     the same for any number of threads; they may differ between backends and instruction sets
///   throws    std::bad_alloc, as forward() does; also beyond 2^32 of what memory is taken for
/// Kinks: what is skipped (alpha below 1/255, splats at which a ray ends and all behind, at or before the near plane,
/// tiles that tile16_stop does not reach) has no gradient, and that it might come in has none either: depth order,
/// tiles and cuts are taken as they are. At the edge of a clamp the derivative is the one from inside, but for that of
/// alpha at 0.99, where it is zero. Costs projecting, sorting and, in the tiles that rows and upstream touch, blending
/// once more, for nothing of the forward pass is kept (Frame and LocalFrame keep it), and about twice that for walking
/// back. Memory: 48 bytes per row that may change and tile (of 20,000 rows on: 3 x 3 tiles) that its box meets, whether
/// or not the tile is wanted.
/// Precondition: that of forward(); semantics other than dense_stop and straight_through need Backend::reference.
void backward(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
              const Upstream& upstream, std::span<const std::uint32_t> rows, BackwardWorkspace& workspace,
              Gradients& out);

}  // namespace engine::render
