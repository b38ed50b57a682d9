#include "engine/optim/perceptual.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numeric>
#include <span>

#include "engine/core/parallel.h"

namespace engine::optim {
namespace {

constexpr int window_side = 11;  // pixels, as in Wang 2003
constexpr std::array<double, max_ms_ssim_scales> wang_weights{0.0448, 0.2856, 0.3001, 0.2363, 0.1333};
constexpr std::size_t rows_per_chunk = 32;  // of a parallel task: a choice

/// The picture's size, without touching memory it already has.
void reshape(scene::Image& image, int width, int height, int channels) {
  image.width = width, image.height = height, image.channels = channels;
  image.data.resize(image.pixels() * std::size_t(channels));
}

/// body(channel, y) for all rows of all channels.
template <class Body>
void for_rows(int height, int channels, const Body& body) {
  const auto rows = std::size_t(height);
  parallel_for(rows * std::size_t(channels), rows_per_chunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(int(i / rows), int(i % rows));
  });
}

void halve(const scene::Image& fine, scene::Image& coarse) {
  reshape(coarse, fine.width / 2, fine.height / 2, fine.channels);
  const PictureView from = view(fine);
  const MutablePictureView to = view(coarse);
  for_rows(coarse.height, coarse.channels, [&](int c, int y) {
    const float *upper = from.row(c, 2 * y), *lower = from.row(c, 2 * y + 1);
    float* out = to.row(c, y);
    for (int x = 0; x < coarse.width; ++x)
      out[x] = 0.25f * ((upper[2 * x] + upper[2 * x + 1]) + (lower[2 * x] + lower[2 * x + 1]));
  });
}

/// Pullback of halve(): adds to v_fine.
void halve_vjp(const scene::Image& v_coarse, scene::Image& v_fine) {
  const PictureView from = view(v_coarse);
  const MutablePictureView to = view(v_fine);
  for_rows(v_coarse.height, v_coarse.channels, [&](int c, int y) {
    const float* in = from.row(c, y);
    for (float* out : {to.row(c, 2 * y), to.row(c, 2 * y + 1)})
      for (int x = 0; x < v_coarse.width; ++x) {
        out[2 * x] += 0.25f * in[x];
        out[2 * x + 1] += 0.25f * in[x];
      }
  });
}

/// Is a colour another one than that of a picture stored to `dead_zone`? False only if certain: NaN differs.
bool differs(float ours, float theirs, float dead_zone) {
  if (dead_zone == 0) return ours != theirs;
  const bool beyond_the_end = (theirs == 1 && ours > 1) || (theirs == 0 && ours < 0);
  return !(std::abs(ours - theirs) <= dead_zone || beyond_the_end);
}

void scale_plane(std::span<float> plane, float factor) {
  for (float& value : plane) value *= factor;
}

}  // namespace

Result<void> validate(const MsSsimOptions& options) {
  if (!(options.ms_ssim_weight >= 0 && options.ms_ssim_weight <= 1))
    return fail(ErrorCode::invalid_argument, "The weight of MS-SSIM must be between 0 and 1.", "ms_ssim_weight");
  if (!(options.floor > 0 && options.floor < 1))
    return fail(ErrorCode::invalid_argument, "The floor of MS-SSIM's terms must be between 0 and 1.", "floor");
  return validate(options.l1);
}

int ms_ssim_scales(int width, int height) {
  int scales = 1;
  while (scales < max_ms_ssim_scales && (std::min(width, height) >> scales) >= window_side) ++scales;
  return scales;
}

std::vector<double> ms_ssim_weights(int scales) {
  assert(scales >= 1 && scales <= max_ms_ssim_scales);
  std::vector<double> weights(wang_weights.begin(), wang_weights.begin() + scales);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  return weights;
}

MsSsimLoss::MsSsimLoss(const MsSsimOptions& options) : options_(options) { assert(validate(options)); }

Result<double> MsSsimLoss::evaluate(const scene::Image& rendered, const scene::Image& target,
                                    scene::Image& v_rendered) {
  assert(rendered.width == target.width && rendered.height == target.height && rendered.channels == target.channels);
  assert(rendered.pixels() > 0 && rendered.channels > 0);
  const auto count = std::size_t(ms_ssim_scales(rendered.width, rendered.height));
  const auto channels = std::size_t(rendered.channels);
  const std::vector<double> weight = ms_ssim_weights(int(count));
  if (scales_.size() < count) scales_.resize(count);

  // Forward, and with it the gradient of each scale's mean by itself: the factors it is to be multiplied by are known
  // only when all scales are.
  for (std::size_t j = 0; j < count; ++j) {
    Scale& scale = scales_[j];
    const scene::Image& x = j == 0 ? rendered : scale.rendered;
    const scene::Image& t = j == 0 ? target : scale.target;
    reshape(scale.gradient, x.width, x.height, x.channels);
    std::fill(scale.gradient.data.begin(), scale.gradient.data.end(), 0.0f);
    scale.mean_loss.resize(channels);
    const SsimTerm term = j + 1 == count ? SsimTerm::full : SsimTerm::contrast_structure;
    ssim_sums(view(x), view(t), {}, term, float(1.0 / double(x.pixels())), workspace_, view(scale.gradient),
              scale.mean_loss);
    for (double& loss : scale.mean_loss) loss /= double(x.pixels());
    if (j + 1 < count) halve(x, scales_[j + 1].rendered), halve(t, scales_[j + 1].target);
  }

  double loss = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    // 1 - prod (1 - l_j)^w_j by way of logarithms, which keeps the digits of small losses.
    double log_product = 0;
    const double ceiling = 1 - options_.floor;
    for (std::size_t j = 0; j < count; ++j)
      log_product += weight[j] * std::log1p(-std::clamp(scales_[j].mean_loss[c], 0.0, ceiling));
    loss += -std::expm1(log_product) / double(channels);
    for (std::size_t j = 0; j < count; ++j) {
      const double mean_loss = scales_[j].mean_loss[c];
      const double slope =
          mean_loss < ceiling ? std::exp(log_product) * weight[j] / (1 - mean_loss) / double(channels) : 0.0;
      scale_plane(scales_[j].gradient.plane(int(c)), float(options_.ms_ssim_weight * slope));
    }
  }
  for (std::size_t j = count - 1; j > 0; --j) halve_vjp(scales_[j].gradient, scales_[j - 1].gradient);

  reshape(v_rendered, rendered.width, rendered.height, rendered.channels);
  std::copy(scales_[0].gradient.data.begin(), scales_[0].gradient.data.end(), v_rendered.data.begin());
  const double l1_weight = 1 - options_.ms_ssim_weight;
  const double l1 = smooth_l1_loss(view(rendered), view(target), {}, rendered.pixels(), options_.l1, l1_weight,
                                   workspace_, view(v_rendered));
  return options_.ms_ssim_weight * loss + l1_weight * l1;
}

Result<double> edit_loss(PerceptualLoss& loss, PictureView rendered, PictureView edited, MaskView mask,
                         std::size_t view_pixels, double weight, EditWorkspace& workspace,
                         MutablePictureView v_rendered, float dead_zone) {
  assert(rendered.width == edited.width && rendered.height == edited.height && rendered.channels == edited.channels);
  assert(mask.width == rendered.width && mask.height == rendered.height && view_pixels >= rendered.pixels());
  if (rendered.pixels() == 0 || rendered.channels == 0) return 0.0;
  reshape(workspace.composite, rendered.width, rendered.height, rendered.channels);
  reshape(workspace.target, rendered.width, rendered.height, rendered.channels);
  const MutablePictureView composite = view(workspace.composite), target = view(workspace.target);
  for_rows(rendered.height, rendered.channels, [&](int c, int y) {
    const float *ours = rendered.row(c, y), *theirs = edited.row(c, y);
    const std::uint8_t* set = mask.row(y);
    std::copy_n(theirs, rendered.width, target.row(c, y));
    float* out = composite.row(c, y);
    for (int x = 0; x < rendered.width; ++x) {
      const bool counts = set[x] != 0 && differs(ours[x], theirs[x], dead_zone);
      out[x] = counts ? ours[x] - std::copysign(dead_zone, ours[x] - theirs[x]) : theirs[x];
    }
  });
  Result<double> value = loss.evaluate(workspace.composite, workspace.target, workspace.v_composite);
  if (!value) return value;
  const double share = double(rendered.pixels()) / double(view_pixels);
  const PictureView v_composite = view(workspace.v_composite);
  for_rows(rendered.height, rendered.channels, [&](int c, int y) {
    const float* in = v_composite.row(c, y);
    const float *ours = rendered.row(c, y), *theirs = edited.row(c, y);
    const std::uint8_t* set = mask.row(y);
    float* out = v_rendered.row(c, y);
    const auto factor = float(weight * share);
    for (int x = 0; x < rendered.width; ++x) {
      const bool counts = set[x] != 0 && (dead_zone == 0 || differs(ours[x], theirs[x], dead_zone));
      out[x] += counts ? factor * in[x] : 0.0f;
    }
  });
  return *value * share;
}

}  // namespace engine::optim
