#include "engine/train/trainer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/mask/mask.h"
#include "engine/optim/picture_view.h"
#include "engine/scene/in_picture.h"

namespace engine::train {
namespace {

const Vec3 black(0.0f);
constexpr float free_to_split = 0.5f;         // smallest mobility of a row that may get a child: a choice
constexpr std::size_t rows_per_task = 4'096;  // a choice

/// Largest distance of a mean from their centre.
double radius_of(const scene::GaussianCloud& cloud) {
  DVec3 centre(0.0);
  for (std::size_t i = 0; i < cloud.size(); ++i) centre += DVec3(cloud.mean.get(i));
  centre /= std::max<double>(double(cloud.size()), 1);
  double radius = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    radius = std::max(radius, glm::distance(centre, DVec3(cloud.mean.get(i))));
  return radius;
}

/// The second of three extents: where rows lie side by side, what a needle's neighbour and a disc's is away.
double log_width_of(Vec3 log_scale) {
  const auto [lesser, greater] = std::minmax(log_scale.x, log_scale.y);
  return double(std::clamp(log_scale.z, lesser, greater));
}

void shape_like(const scene::Image& image, scene::Image& out) {
  out.width = image.width, out.height = image.height, out.channels = image.channels;
  out.data.assign(image.data.size(), 0.0f);
}

}  // namespace

Result<void> validate(const DensifyOptions& options) {
  if (options.every < 0)
    return fail(ErrorCode::invalid_argument, "Densification happens every 0 or more iterations.", "every");
  for (const auto& [value, name] : {std::pair{options.until, "until"},
                                    {options.gradient, "gradient"},
                                    {options.dense, "dense"},
                                    {options.most_growth, "most_growth"}})
    if (!(value >= 0 && std::isfinite(value)))
      return fail(ErrorCode::invalid_argument, "An option of densification must be 0 or more.", name);
  return {};
}

Result<void> validate(const TrainOptions& options) {
  if (auto valid = optim::validate(options.rates); !valid) return valid;
  if (auto valid = optim::validate(options.adam); !valid) return valid;
  if (auto valid = optim::validate(options.background); !valid) return valid;
  for (const auto& [value, name] : {std::pair{options.perceptual_weight, "perceptual_weight"},
                                    {options.dead_zone, "dead_zone"},
                                    {options.floater_distance, "floater_distance"}})
    if (!(value >= 0 && std::isfinite(value)))
      return fail(ErrorCode::invalid_argument, "An option of training must be 0 or more.", name);
  return validate(options.densify);
}

Trainer::Trainer(FrozenScene frozen, TrainedRows changeable, double scene_extent, const TrainOptions& options,
                 optim::PerceptualLoss& loss)
    : frozen_(frozen),
      cloud_(std::move(changeable.cloud)),
      name_(std::move(changeable.name)),
      mobility_(std::move(changeable.mobility)),
      options_(options),
      loss_(loss),
      initial_rows_(cloud_.size()),
      radius_(radius_of(cloud_)),
      position_scale_(optim::position_scale(options.rates, scene_extent, radius_)),
      ancestor_(cloud_.size()),
      adam_(cloud_.size(), cloud_.sh_degree, options.adam) {
  assert(validate(options) && cloud_.sh_degree == frozen.base->sh_degree);
  assert(name_.empty() || name_.size() == cloud_.size());
  std::iota(ancestor_.begin(), ancestor_.end(), 0u);
}

bool Trainer::add_view(const scene::Camera& camera, const scene::Mask& mask, const scene::GaussianCloud& original) {
  assert(mask.width == camera.width && mask.height == camera.height);
  const scene::Rect box = scene::bounding_box(mask);
  if (box.empty()) return false;
  scene::Rect reach = union_of(box, frame_.project(cloud_, camera));
  reach = union_of(reach, frame_.project(original, camera));
  views_.push_back({.frozen = render::FrozenView(frozen_.layers(), camera, region_around(reach, camera), black),
                    .mask = mask,
                    .box = box,
                    .background = {},
                    .edited = {},
                    .near_by_tile = {},
                    .nearest = 0,
                    .last_use = 0});
  TrainingView& view = views_.back();
  evict_for(view);
  frame_.merge(view.frozen);  // of `original`, as projected last
  view.background = view.frozen.color();
  frame_.forward(view.frozen, view.background);
  set_edited(views_.size() - 1, render(views_.size() - 1));
  return true;
}

void Trainer::merge_into(TrainingView& view) {
  const scene::Rect reach = frame_.project(cloud_, view.frozen.camera());
  if (!has_room(view.frozen.region(), reach, view.frozen.camera()))
    widen(view, reach, frozen_, black);
  else if (view.frozen.is_let_go())
    view.frozen.restore(frozen_.layers());
  evict_for(view);
  frame_.merge(view.frozen);
}

void Trainer::evict_for(TrainingView& view) {
  view.last_use = ++use_counter_;
  std::size_t bytes = 0;
  std::vector<TrainingView*> evictable;
  for (TrainingView& other : views_) {
    if (other.frozen.is_let_go()) continue;
    bytes += other.frozen.memory_bytes();
    if (&other != &view) evictable.push_back(&other);
  }
  if (bytes <= options_.frozen_memory) return;
  // Every view is used once an epoch: the turn of the one used last is farthest off.
  std::sort(evictable.begin(), evictable.end(),
            [](const TrainingView* a, const TrainingView* b) { return a->last_use > b->last_use; });
  for (TrainingView* const other : evictable) {
    if (bytes <= options_.frozen_memory) return;
    const std::size_t held = other->frozen.memory_bytes();
    other->frozen.let_go();
    bytes -= held - other->frozen.memory_bytes();
  }
}

scene::Image Trainer::render(std::size_t v) {
  TrainingView& view = views_[v];
  merge_into(view);
  scene::Image picture = view.frozen.color();
  frame_.forward(view.frozen, picture);
  return picture;
}

void Trainer::set_edited(std::size_t v, scene::Image picture) {
  const scene::Rect region = views_[v].frozen.region();
  assert(picture.width == region.width() && picture.height == region.height() && picture.channels == 3);
  (void)region;
  quantise(picture);
  views_[v].edited = std::move(picture);
}

void Trainer::note_depths(TrainingView& view) {
  const scene::Camera& camera = view.frozen.camera();
  frame_.project(cloud_, camera);
  view.near_by_tile.assign(
      std::size_t(render::tile_columns(camera.width)) * std::size_t(render::tile_rows(camera.height)), 0.0f);
  view.nearest = 0;
  for (std::size_t i = 0; i < frame_.tiles().size(); ++i) {
    const float depth = frame_.nearest_depth(i);
    view.near_by_tile[frame_.tiles()[i]] = depth;
    view.nearest = view.nearest == 0 ? depth : std::min(view.nearest, depth);
  }
}

void Trainer::begin_correction(const RandomKey& key, int iterations) {
  assert(!views_.empty() && iterations >= 1);
  key_ = key;
  iteration_ = 0, iterations_ = iterations;
  position_gradients_.reset(cloud_.size());
  for (TrainingView& view : views_) note_depths(view);
}

Result<double> Trainer::differentiate(TrainingView& view) {
  merge_into(view);
  const scene::Camera& camera = view.frozen.camera();
  rendered_ = view.frozen.color();
  frame_.forward(view.frozen, rendered_);
  cost_ = {frame_.tiles().size(), frame_.entries(), view.frozen.splats()};

  const scene::Rect region = view.frozen.region(), box = relative_to(view.box, region);
  const std::size_t view_pixels = std::size_t(camera.width) * std::size_t(camera.height);
  shape_like(rendered_, v_rendered_);
  // What is edited is no part of the background, not even of a window of SSIM that reaches into it: a part that has
  // just arrived would be pulled back towards what was there.
  comparable_ = rendered_;
  const auto in_mask = [&](auto&& each) {
    for (int c = 0; c < comparable_.channels; ++c)
      for (int y = box.y0; y < box.y1; ++y)
        for (int x = box.x0; x < box.x1; ++x)
          if (view.mask.at(region.x0 + x, region.y0 + y) != 0) each(x, y, c);
  };
  in_mask([&](int x, int y, int c) { comparable_.at(x, y, c) = view.background.at(x, y, c); });
  const auto background =
      optim::background_loss(optim::view(comparable_), optim::view(view.background), optim::crop(view.mask, region),
                             view_pixels, options_.background, loss_workspace_, optim::view(v_rendered_));
  in_mask([&](int x, int y, int c) { v_rendered_.at(x, y, c) = 0; });
  const auto edit =
      optim::edit_loss(loss_, optim::crop(std::as_const(rendered_), box), optim::crop(std::as_const(view.edited), box),
                       optim::crop(view.mask, view.box), view_pixels, options_.perceptual_weight, edit_workspace_,
                       optim::crop(v_rendered_, box), float(options_.dead_zone));
  if (!edit) return propagate(edit);
  gradients_.reset(cloud_.size(), cloud_.sh_degree);
  frame_.backward(view.frozen, cloud_, v_rendered_, gradients_);
  return background.total + options_.perceptual_weight * *edit;
}

std::span<const float> Trainer::position_mobility() {
  const double log_full_width = std::log(options_.rates.position * position_scale_ / options_.rates.most_widths);
  position_mobility_.resize(cloud_.size());
  parallel_for(cloud_.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const double share = optim::share_of_position(log_width_of(cloud_.log_scale.get(row)), log_full_width);
      position_mobility_[row] = (mobility_.empty() ? 1.0f : mobility_[row]) * float(share);
    }
  });
  return position_mobility_;
}

Result<void> Trainer::adam_step(double decay) {
  const optim::LearningRates& rates = options_.rates;
  auto stepped = adam_.step(cloud_, gradients_,
                            {.position = rates.position * position_scale_ * decay,
                             .sh_dc = rates.sh_dc * decay,
                             .sh_rest = rates.sh_rest * decay,
                             .opacity_logit = rates.opacity_logit * decay,
                             .log_scale = rates.log_scale * decay,
                             .rotation = rates.rotation * decay},
                            {.position = position_mobility(), .others = mobility_});
  if (stepped) return {};
  // "[12].opacity" -> "gaussian[12].opacity", with the name of the row.
  Error error = std::move(stepped.error());
  const std::size_t end = error.where.find(']');
  const std::size_t row = std::stoull(error.where.substr(1, end - 1));
  const std::uint32_t ancestor = ancestor_[row];
  error.where = "gaussian[" + std::to_string(name_.empty() ? ancestor : name_[ancestor]) + error.where.substr(end);
  return tl::make_unexpected(std::move(error));
}

Result<IterationResult> Trainer::step() {
  assert(iteration_ < iterations_);
  const std::size_t in_epoch = std::size_t(iteration_) % views_.size();
  if (in_epoch == 0) order_ = shuffled(views_.size(), key_, std::size_t(iteration_));
  IterationResult done{iteration_, order_[in_epoch], 0};
  TrainingView& view = views_[done.view];
  const auto loss = differentiate(view);
  if (!loss) return propagate(loss);
  done.loss = *loss;
  if (auto stepped = adam_step(optim::decay_within_correction(iteration_, iterations_, options_.rates.last)); !stepped)
    return propagate(stepped);
  if (!std::isfinite(done.loss))
    return fail(ErrorCode::internal, "The loss is not a finite number at iteration " + std::to_string(iteration_) + ".",
                "view[" + view.frozen.camera().name + "].loss");
  ++iteration_;

  const DensifyOptions& densify_options = options_.densify;
  if (densify_options.every > 0) {
    position_gradients_.add(gradients_, view.frozen.camera());
    if (iteration_ % densify_options.every == 0 && iteration_ <= densify_options.until * iterations_) {
      remove_floaters();
      densify();
    }
  }
  if (iteration_ == iterations_) remove_floaters();
  return done;
}

void Trainer::densify() {
  const DensifyOptions& options = options_.densify;
  const std::size_t most = std::size_t(options.most_growth * double(initial_rows_)),
                    there = cloud_.size() - initial_rows_;
  const double loss_weight =
      options_.background.l1_weight + options_.background.ssim_weight + options_.perceptual_weight;
  // A split moves a row at once, whatever its learning rates are: what should hardly change has no children.
  for (std::size_t row = 0; row < mobility_.size(); ++row)
    if (mobility_[row] < free_to_split) position_gradients_.sum[row] = 0;
  const auto rows = rows_to_densify(position_gradients_, options.gradient * loss_weight, most - std::min(most, there));
  Rng rng = stream(key_, Purpose::split, std::size_t(iteration_));
  add_children(cloud_, rows, options.dense * position_scale_, rng);
  for (const std::uint32_t row : rows) {
    ancestor_.push_back(ancestor_[row]);
    if (!mobility_.empty()) mobility_.push_back(mobility_[row]);
  }
  adam_.append_rows(rows.size());
  position_gradients_.reset(cloud_.size());
}

void Trainer::remove_floaters() {
  std::vector<std::uint8_t> keep(cloud_.size(), 1);
  std::size_t removed = 0;
  const double margin = options_.floater_distance * radius_;
  for (std::size_t row = initial_rows_; row < cloud_.size(); ++row) {
    const bool floats = std::any_of(views_.begin(), views_.end(), [&](const TrainingView& view) {
      const scene::Camera& camera = view.frozen.camera();
      const DVec3 p = camera.cam_from_world(DVec3(cloud_.mean.get(row)));
      const auto pixel = scene::pixel_in_picture(camera, p);
      if (!pixel || view.nearest == 0) return false;
      const auto tile =
          std::size_t(int(pixel->y) / render::tile_size) * std::size_t(render::tile_columns(camera.width)) +
          std::size_t(int(pixel->x) / render::tile_size);
      const float near = view.near_by_tile[tile] != 0 ? view.near_by_tile[tile] : view.nearest;
      return p.z < double(near) - margin;
    });
    if (floats) keep[row] = 0, ++removed;
  }
  if (removed == 0) return;
  cloud_ = scene::select(cloud_, keep);
  adam_.keep_rows(keep);
  position_gradients_.keep_rows(keep);
  std::size_t remaining = 0;
  for (std::size_t row = 0; row < keep.size(); ++row)
    if (keep[row] != 0) {
      ancestor_[remaining] = ancestor_[row];
      if (!mobility_.empty()) mobility_[remaining] = mobility_[row];
      ++remaining;
    }
  ancestor_.resize(remaining);
  if (!mobility_.empty()) mobility_.resize(remaining);
  floaters_ += removed;
}

std::size_t Trainer::memory_bytes() const {
  std::size_t bytes = 0;
  for (const TrainingView& view : views_)
    bytes += view.frozen.memory_bytes() + view.mask.data.size() + view.near_by_tile.size() * sizeof(float) +
             (view.background.data.size() + view.edited.data.size()) * sizeof(float);
  return bytes;
}

}  // namespace engine::train
