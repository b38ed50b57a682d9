#include "engine/optim/losses.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "engine/core/parallel.h"
#include "engine/optim/losses_simd.h"

namespace engine::optim {
namespace {

constexpr std::size_t l1_rows = 32;  // rows of one channel in a parallel task: a choice

template <class A, class B>
bool same_shape(const A& a, const B& b) {
  return a.width == b.width && a.height == b.height && a.channels == b.channels;
}

[[maybe_unused]] bool fits(PictureView rendered, PictureView target, MaskView mask, MutablePictureView v_rendered) {
  return same_shape(rendered, target) && same_shape(rendered, v_rendered) &&
         (mask.data == nullptr || (mask.width == rendered.width && mask.height == rendered.height));
}

std::size_t tiles(int pixels, int size) { return std::size_t((pixels + size - 1) / size); }

}  // namespace

Result<void> validate(const L1Options& options) {
  if (options.scale >= 1e-6 && options.scale <= 1) return {};  // the square of a smaller one may vanish in float
  return fail(ErrorCode::invalid_argument, "The scale of the smoothed L1 must be from 1e-6 to 1.", "l1.scale");
}

Result<void> validate(const BackgroundLossOptions& options) {
  if (!(options.l1_weight >= 0 && std::isfinite(options.l1_weight)))
    return fail(ErrorCode::invalid_argument, "A loss weight must be 0 or more.", "l1_weight");
  if (!(options.ssim_weight >= 0 && std::isfinite(options.ssim_weight)))
    return fail(ErrorCode::invalid_argument, "A loss weight must be 0 or more.", "ssim_weight");
  return validate(options.l1);
}

double smooth_l1_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels,
                      const L1Options& options, double weight, LossWorkspace& workspace,
                      MutablePictureView v_rendered) {
  assert(fits(rendered, target, mask, v_rendered) && view_pixels >= rendered.pixels());
  if (rendered.pixels() == 0 || rendered.channels == 0) return 0;
  const double values = double(view_pixels) * rendered.channels;
  const auto height = std::size_t(rendered.height), rows = height * std::size_t(rendered.channels);
  workspace.partial.assign(chunk_count(rows, l1_rows), 0.0);
  parallel_for(rows, l1_rows, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const int c = int(i / height), y = int(i % height);
      sum += smooth_l1_row(rendered.row(c, y), target.row(c, y), mask.data != nullptr ? mask.row(y) : nullptr,
                           rendered.width, options.kind, float(options.scale), float(weight / values),
                           v_rendered.row(c, y));
    }
    workspace.partial[begin / l1_rows] = sum;
  });
  return std::accumulate(workspace.partial.begin(), workspace.partial.end(), 0.0) / values;
}

scene::Rect with_rim(scene::Rect changed, int width, int height) {
  if (changed.empty()) return {};
  return {std::max(changed.x0 - ssim_rim, 0), std::max(changed.y0 - ssim_rim, 0),
          std::min(changed.x1 + ssim_rim, width), std::min(changed.y1 + ssim_rim, height)};
}

void ssim_sums(PictureView rendered, PictureView target, MaskView mask, SsimTerm term, float scale,
               LossWorkspace& workspace, MutablePictureView v_rendered, std::span<double> sums) {
  assert(fits(rendered, target, mask, v_rendered) && sums.size() == std::size_t(rendered.channels));
  const std::size_t columns = tiles(rendered.width, ssim_tile_width), rows = tiles(rendered.height, ssim_tile_height);
  const std::size_t per_channel = columns * rows;
  workspace.partial.assign(per_channel * sums.size(), 0.0);
  parallel_for(workspace.partial.size(), 1, [&](std::size_t chunk, std::size_t) {
    const int c = int(chunk / per_channel);
    SsimChannel channel{.rendered = rendered, .target = target, .mask = mask, .v_rendered = v_rendered, .scale = scale};
    channel.rendered.data = rendered.row(c, 0);
    channel.target.data = target.row(c, 0);
    channel.v_rendered.data = v_rendered.row(c, 0);
    const int x = int(chunk % per_channel % columns) * ssim_tile_width;
    const int y = int(chunk % per_channel / columns) * ssim_tile_height;
    workspace.partial[chunk] = ssim_tile(
        channel, term,
        {x, y, std::min(x + ssim_tile_width, rendered.width), std::min(y + ssim_tile_height, rendered.height)});
  });
  for (std::size_t c = 0; c < sums.size(); ++c) {
    const auto first = workspace.partial.begin() + std::ptrdiff_t(c * per_channel);
    sums[c] = std::accumulate(first, first + std::ptrdiff_t(per_channel), 0.0);
  }
}

double ssim_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels, double weight,
                 LossWorkspace& workspace, MutablePictureView v_rendered) {
  assert(view_pixels >= rendered.pixels());
  if (rendered.pixels() == 0 || rendered.channels == 0) return 0;
  const double values = double(view_pixels) * rendered.channels;
  workspace.sums.resize(std::size_t(rendered.channels));
  ssim_sums(rendered, target, mask, SsimTerm::full, float(weight / values), workspace, v_rendered, workspace.sums);
  return std::accumulate(workspace.sums.begin(), workspace.sums.end(), 0.0) / values;
}

BackgroundLoss background_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels,
                               const BackgroundLossOptions& options, LossWorkspace& workspace,
                               MutablePictureView v_rendered) {
  BackgroundLoss loss;
  if (options.l1_weight > 0)
    loss.l1 = smooth_l1_loss(rendered, target, mask, view_pixels, options.l1, options.l1_weight, workspace, v_rendered);
  if (options.ssim_weight > 0)
    loss.ssim = ssim_loss(rendered, target, mask, view_pixels, options.ssim_weight, workspace, v_rendered);
  loss.total = options.l1_weight * loss.l1 + options.ssim_weight * loss.ssim;
  return loss;
}

}  // namespace engine::optim
