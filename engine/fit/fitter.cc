#include "engine/fit/fitter.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <utility>

#include "engine/fit/start.h"
#include "engine/optim/picture_view.h"
#include "engine/render/largest_weight.h"
#include "engine/scene/cloud_bytes.h"
#include "engine/scene/opacity.h"
#include "engine/train/random_streams.h"

namespace engine::fit {
namespace {

constexpr double identical_db = 100;  // PSNR of equal pictures in means: infinity has no mean. A choice.
constexpr int min_side = 64;          // pixels: a smaller photo is not halved further. A choice.

// Parts of the iterations after which photos are halved once less often. ADR 8; a choice.
constexpr double finer_after[] = {0.1, 0.3};
// Parts that the iterations are divided into; the SH degree grows by one with each. ADR 8; a choice.
constexpr int bands_in = 10;

// Least extent of a capture, as a part of the distance of the scene. Rates of positions go by the extent, and where the
// cameras hardly differ in place (a single photo, a panorama) nothing would move without it. A choice.
constexpr double min_extent = 0.1;

train::RandomKey key_of(const FitOptions& options) { return {.seed = options.seed, .interval = 0, .correction = 0}; }

std::vector<scene::Camera> cameras_of(std::span<const Photo> photos) {
  std::vector<scene::Camera> cameras;
  for (const Photo& photo : photos) cameras.push_back(photo.camera);
  return cameras;
}

/// Median distance of the means from the first camera, world units.
double distance_of(const scene::GaussianCloud& cloud, const scene::Camera& camera) {
  const DVec3 centre = camera.centre();
  std::vector<double> distance(cloud.size());
  for (std::size_t i = 0; i < distance.size(); ++i) distance[i] = glm::distance(centre, DVec3(cloud.mean.get(i)));
  const auto middle = distance.begin() + std::ptrdiff_t(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  return *middle;
}

}  // namespace

Result<void> validate(const FitOptions& options) {
  const auto wrong = [](const char* what, const char* where) { return fail(ErrorCode::invalid_argument, what, where); };
  if (options.iterations < 1) return wrong("A fit has 1 or more iterations.", "iterations");
  if (options.sh_degree < 0 || options.sh_degree > scene::max_sh_degree)
    return wrong("The SH degree is 0 to 3.", "sh_degree");
  if (options.max_gaussians < 1) return wrong("A scene has 1 or more Gaussians.", "max_gaussians");
  if (options.halvings < 0 || options.halvings > 8) return wrong("Photos are halved 0 to 8 times.", "halvings");
  if (!(options.least_opacity >= 0 && options.least_opacity < 1))
    return wrong("The least opacity is 0 to below 1.", "least_opacity");
  if (auto valid = optim::validate(options.rates); !valid) return valid;
  if (!(options.rates.position > 0)) return wrong("Its decay needs a rate of positions above 0.", "rates.position");
  if (auto valid = optim::validate(options.adam); !valid) return valid;
  if (auto valid = optim::validate(options.loss); !valid) return valid;
  return train::validate(options.densify);
}

Phase phase_of(const FitOptions& options, int start_degree, int iteration) {
  const double progress = double(iteration) / options.iterations;
  Phase phase{options.halvings, std::max(start_degree, 0)};
  for (const double after : finer_after)
    if (progress >= after && phase.halvings > 0) --phase.halvings;
  if (progress >= finer_after[1]) phase.halvings = 0;
  const auto tenths = int(std::int64_t{bands_in} * iteration / options.iterations);
  phase.sh_degree = std::max(start_degree, std::min(options.sh_degree, tenths));
  return phase;
}

Fitter::Fitter(std::vector<Photo> photos, scene::GaussianCloud start, const FitOptions& options)
    : options_(options),
      photos_(std::move(photos)),
      cloud_(std::move(start)),
      start_degree_(cloud_.sh_degree),
      start_rows_(cloud_.size()),
      extent_(std::max(scene::capture_extent(cameras_of(photos_)),
                       min_extent * distance_of(cloud_, photos_.front().camera))),
      adam_(cloud_.size(), cloud_.sh_degree, options.adam) {
  assert(validate(options) && !photos_.empty() && cloud_.size() > 0 && cloud_.sh_degree <= options.sh_degree);
  position_gradients_.reset(cloud_.size());
}

void Fitter::enter(const Phase& phase) {
  if (!phase_ || phase.halvings != phase_->halvings) {
    halved_.clear();
    if (phase.halvings > 0) halved_.reserve(photos_.size());
    for (std::size_t p = 0; phase.halvings > 0 && p < photos_.size(); ++p) {
      const auto large = [](const Photo& photo) {
        return std::min(photo.camera.width, photo.camera.height) >= 2 * min_side;
      };
      if (!large(photos_[p])) {
        halved_.push_back(photos_[p]);
        continue;
      }
      Photo photo = half_size(photos_[p]);
      for (int h = 1; h < phase.halvings && large(photo); ++h) photo = half_size(photo);
      halved_.push_back(std::move(photo));
    }
  }
  if (phase.sh_degree != cloud_.sh_degree) {
    cloud_ = with_sh_degree(cloud_, phase.sh_degree);
    adam_ = train::CloudAdam(cloud_.size(), phase.sh_degree, options_.adam);
  }
  phase_ = phase;
}

Result<double> Fitter::step() {
  assert(!done());
  if (const Phase phase = phase_of(options_, start_degree_, iteration_); phase_ != phase) enter(phase);
  const std::vector<Photo>& photos = halved_.empty() ? photos_ : halved_;
  const std::size_t in_epoch = std::size_t(iteration_) % photos.size();
  if (in_epoch == 0 || order_.empty())
    order_ = train::shuffled(photos.size(), key_of(options_), std::size_t(iteration_) - in_epoch);
  const Photo& photo = photos[order_[in_epoch]];
  const scene::Camera& camera = photo.camera;

  to_image(photo, photo_);
  if (rendered_.width != camera.width || rendered_.height != camera.height)
    rendered_ = scene::Image(camera.width, camera.height, 3);
  frame_.forward(cloud_, camera, options_.background, rendered_);
  v_rendered_.width = camera.width, v_rendered_.height = camera.height, v_rendered_.channels = 3;
  v_rendered_.data.assign(rendered_.data.size(), 0.0f);
  const double loss = optim::background_loss(optim::view(rendered_), optim::view(photo_), {}, photo_.pixels(),
                                             options_.loss, loss_workspace_, optim::view(v_rendered_))
                          .total;
  gradients_.reset(cloud_.size(), cloud_.sh_degree);
  frame_.backward(cloud_, v_rendered_, gradients_);

  const optim::LearningRates& rates = options_.rates;
  const double progress = double(iteration_) / options_.iterations;
  auto stepped =
      adam_.step(cloud_, gradients_,
                 {.position = extent_ * optim::exponential_decay(rates.position, rates.position * rates.last, progress),
                  .sh_dc = rates.sh_dc,
                  .sh_rest = rates.sh_rest,
                  .opacity_logit = rates.opacity_logit,
                  .log_scale = rates.log_scale,
                  .rotation = rates.rotation});
  if (!stepped) {
    stepped.error().where = "gaussian" + stepped.error().where;
    return propagate(stepped);
  }
  if (!std::isfinite(loss))
    return fail(ErrorCode::internal, "The loss is not a finite number at iteration " + std::to_string(iteration_) + ".",
                "view[" + camera.name + "].loss");
  ++iteration_;

  const train::DensifyOptions& densify_options = options_.densify;
  if (densify_options.every > 0 && iteration_ <= densify_options.until * options_.iterations) {
    position_gradients_.add(gradients_, camera);
    if (iteration_ % densify_options.every == 0) densify();
  }
  return loss;
}

/// The limit grows evenly until densification ends: Gaussians that are fitted longest have had the most time to settle.
std::size_t Fitter::max_gaussians_now() const {
  const double part = std::min(1.0, iteration_ / std::max(1.0, options_.densify.until * options_.iterations));
  const double from = double(start_rows_), to = double(options_.max_gaussians);
  return to <= from ? start_rows_ : std::size_t(from + (to - from) * part);
}

void Fitter::densify() {
  prune();
  const std::size_t limit = max_gaussians_now();
  const double loss_weight = options_.loss.l1_weight + options_.loss.ssim_weight;
  const auto rows = train::rows_to_densify(position_gradients_, options_.densify.gradient * loss_weight,
                                           limit - std::min(limit, cloud_.size()));
  Rng rng = train::stream(key_of(options_), train::Purpose::split, std::size_t(iteration_));
  train::add_children(cloud_, rows, options_.densify.dense * extent_, rng);
  adam_.append_rows(rows.size());
  position_gradients_.reset(cloud_.size());
}

void Fitter::prune() {
  const auto faintest = float(scene::logit(options_.least_opacity));  // -inf for 0
  std::vector<std::uint8_t> keep(cloud_.size());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) kept += keep[i] = cloud_.opacity_logit[i] >= faintest;
  if (kept == keep.size() || kept == 0) return;
  cloud_ = scene::select(cloud_, keep);
  adam_.keep_rows(keep);
  position_gradients_.keep_rows(keep);
}

void Fitter::write(ByteWriter& out) const {
  out.write(std::int32_t(iteration_));
  scene::write_cloud(out, cloud_);
  adam_.write(out);
  out.write_all(std::span<const double>(position_gradients_.sum));
  out.write_all(std::span<const std::uint32_t>(position_gradients_.views));
}

void Fitter::read(ByteReader& in) {
  iteration_ = in.read<std::int32_t>();
  cloud_ = scene::read_cloud(in);
  if (!in.ok() || iteration_ < 0 || iteration_ > options_.iterations || cloud_.size() == 0) return in.fail();
  order_.clear();
  phase_.reset();
  adam_ = train::CloudAdam(cloud_.size(), cloud_.sh_degree, options_.adam);
  adam_.read(in);
  position_gradients_.reset(cloud_.size());
  in.read_all(std::span(position_gradients_.sum));
  in.read_all(std::span(position_gradients_.views));
}

FitQuality quality_on(const scene::GaussianCloud& cloud, std::span<const Photo> photos, Vec3 background,
                      std::size_t max_views) {
  assert(!photos.empty() && max_views >= 1);
  const std::size_t count = std::min(photos.size(), max_views);
  FitQuality mean;
  render::Workspace workspace;
  render::Rendering rendering;
  optim::LossWorkspace loss_workspace;
  scene::Image photo, ignored;
  mean.worst_psnr_db = identical_db;
  for (std::size_t k = 0; k < count; ++k) {
    const Photo& wanted = photos[k * photos.size() / count];
    render::forward(cloud, wanted.camera, {.background = background}, {}, workspace, rendering);
    for (float& value : rendering.color.data) value = std::clamp(value, 0.0f, 1.0f);
    to_image(wanted, photo);
    const double db = std::min(scene::psnr(rendering.color, photo), identical_db);
    ignored = scene::Image(photo.width, photo.height, 3);
    const double dissimilarity = optim::ssim_loss(optim::view(rendering.color), optim::view(photo), {}, photo.pixels(),
                                                  0.0, loss_workspace, optim::view(ignored));
    mean.psnr_db += db / double(count);
    mean.ssim += (1 - dissimilarity) / double(count);
    if (db <= mean.worst_psnr_db) mean.worst_psnr_db = db, mean.worst_view = wanted.camera.name;
  }
  return mean;
}

std::size_t visible_count(const scene::GaussianCloud& cloud, std::span<const Photo> photos) {
  std::vector<float> weight(cloud.size(), 0.0f);
  render::Workspace workspace;
  for (const Photo& photo : photos) render::raise_to_largest_weights(cloud, photo.camera, workspace, weight);
  return std::size_t(std::count_if(weight.begin(), weight.end(), [](float w) { return w > 0; }));
}

}  // namespace engine::fit
