#include "engine/edit/repair.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/edit/footprint.h"
#include "engine/edit/seed.h"
#include "engine/edit/surfaces.h"
#include "engine/edit/trust.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/train/densify.h"

namespace engine::edit {
namespace {

constexpr float half_seen = 0.5f;     // as long as half of what moved was seen, it is better kept than made up
constexpr float covering = 0.1f;      // share of the dragged part at which a pixel is no longer background
constexpr float trace = 0.02f;        // share of it at which a pixel no longer shows what is behind
constexpr double seen_behind = 0.01;  // a view that sees by so much farther than a point has looked through it
constexpr int views_to_be_sure = 2;   // that must have done so: one alone may err at an edge
constexpr std::size_t most_examples = 6;

/// S(a) of the paper: from params.strength_initial to params.strength_final.
double strength_of(const Params& params, int a) {
  const int steps = params.annealing_steps;
  const double done = params.annealing == Annealing::paper ? double(a - 1) / steps
                      : steps > 1                          ? double(a - 1) / (steps - 1)
                                                           : 0;
  return params.strength_initial - done * (params.strength_initial - params.strength_final);
}

/// The first view, then always the one that is nearest to one already there.
std::vector<std::size_t> outward(std::span<const scene::Camera> views) {
  std::vector<double> far(views.size(), 1e9);
  std::vector<std::uint8_t> done(views.size(), 0);
  std::vector<std::size_t> order;
  for (std::size_t next = 0; order.size() < views.size();) {
    order.push_back(next);
    done[next] = 1;
    for (std::size_t v = 0; v < views.size(); ++v)
      far[v] = std::min(far[v], glm::distance(views[v].centre(), views[next].centre()));
    double least = 1e300;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (done[v] == 0 && far[v] < least) least = far[v], next = v;
  }
  return order;
}

std::vector<std::size_t> nearest_views(std::span<const scene::Camera> views, std::size_t to) {
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return glm::distance(views[a].centre(), views[to].centre()) < glm::distance(views[b].centre(), views[to].centre());
  });
  order.resize(std::min(order.size(), most_examples));
  return order;
}

/// While it lives, what a drawn-out part leaves along its way is as opaque as the part: it was only made half
/// transparent so that the optimisation can choose, and a picture that shows it so is no picture of the scene.
class Opaque {
 public:
  Opaque(WorkingScene& working, const scene::GaussianCloud& original, Mode mode)
      : working_(working), lowered_(working.cloud.opacity_logit) {
    if (mode == Mode::move) return;
    const bool trails = std::find(working.role.begin(), working.role.end(), Role::trail) != working.role.end();
    for (std::size_t row = 0; row < working.role.size(); ++row)
      if (working.role[row] == Role::original || working.role[row] == Role::trail) {
        float& logit = working.cloud.opacity_logit[row];
        logit = std::max(logit, trails ? train::halved_opacity(original.opacity_logit[working.parent[row]])
                                       : original.opacity_logit[working.parent[row]]);
      }
  }
  ~Opaque() { std::copy(lowered_.begin(), lowered_.end(), working_.cloud.opacity_logit.begin()); }
  Opaque(const Opaque&) = delete;
  Opaque& operator=(const Opaque&) = delete;

 private:
  WorkingScene& working_;
  std::vector<float> lowered_;
};

}  // namespace

/// What a view shows now, without the rows that are hidden.
struct Repair::Seen {
  scene::Image color;          ///< [3]
  scene::Image trust;          ///< [1]
  scene::Image inverse_depth;  ///< [1] Of the first half of the light; 0: nothing.
  scene::Mask reliable;        ///< Trusted and opaque.
};

Repair::Repair(const scene::GaussianCloud& original, std::span<const scene::Camera> observers,
               std::vector<scene::Camera> views, const Params& params, Mode mode, correct::Corrector& corrector)
    : original_(original), views_(std::move(views)), params_(params), mode_(mode), corrector_(corrector) {
  observed_ = observed_rows(original, observers);
  render::ForwardOptions options;
  options.depth = true;
  for (const scene::Camera& view : views_) {
    render::Rendering rendering;
    render::forward(original, view, options, {}, workspace_, rendering);
    depth_before_.push_back(std::move(rendering.median_depth));
    buffer_.push_back({std::move(rendering.color), scene::Mask(view.width, view.height), {}});
  }
}

bool Repair::is_free(DVec3 point) const {
  int seen_through = 0;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const DVec3 p = views_[v].cam_from_world(point);
    if (p.z <= 0) continue;
    const DVec2 pixel = views_[v].pixel_from_cam(p);
    const int x = int(std::floor(pixel.x)), y = int(std::floor(pixel.y));
    if (x < 1 || y < 1 || x >= views_[v].width - 1 || y >= views_[v].height - 1) continue;
    double nearest = 1e300;
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i)
        if (const double depth = double(depth_before_[v].at(i, j)); depth > 0) nearest = std::min(nearest, depth);
    if (nearest > p.z * (1 + seen_behind) && ++seen_through >= views_to_be_sure) return true;
  }
  return false;
}

Repair::Seen Repair::look(const WorkingScene& working, std::span<const std::uint32_t> hidden, std::size_t v) {
  const scene::Camera& view = views_[v];
  render::Layers layers(working.cloud);
  layers.hidden = hidden;
  render::ForwardOptions options;
  options.depth = true;
  render::Rendering now;
  render::forward(layers, view, options, trust_, workspace_, now);
  Seen seen{std::move(now.color), std::move(now.weight), std::move(now.median_depth),
            scene::Mask(view.width, view.height)};
  for (std::size_t i = 0; i < now.alpha.data.size(); ++i) {
    float& depth = seen.inverse_depth.data[i];
    depth = depth > 0 ? 1 / depth : 0;
    seen.reliable.data[i] =
        depth > 0 && seen.trust.data[i] >= correct::trusted && now.alpha.data[i] >= correct::trusted;
  }
  return seen;
}

Result<scene::Image> Repair::corrected(scene::Image picture, const scene::Mask& mask, scene::Image trust, std::size_t v,
                                       double strength, std::uint64_t key) {
  const correct::Flawed flawed{std::move(picture), mask, std::move(trust), nearest_views(views_, v)};
  auto pictures = corrector_.correct(std::span(&flawed, 1), strength, key);
  if (!pictures) return propagate(pictures);
  return std::move(pictures->front());
}

Result<Repair::Background> Repair::complete_background(WorkingScene& working, const Rows& rows, std::size_t v,
                                                       double strength, std::uint64_t key) {
  const scene::Camera& view = views_[v];
  Seen seen = look(working, rows.dragged, v);
  Background background{{}, scene::Mask(view.width, view.height), 0};
  SurfaceView surface_view{std::move(seen.inverse_depth), std::move(seen.reliable), vacated_[v], scene::Mask()};
  surface_view.doubtful = scene::Mask(view.width, view.height);
  for (std::size_t i = 0; i < seen.trust.data.size(); ++i)
    surface_view.doubtful.data[i] = seen.trust.data[i] < correct::trusted;
  const auto is_free_at = [&](DVec2 pixel, double inverse_depth) {
    return is_free(point_at(view, pixel, inverse_depth));
  };
  const scene::Image surface = continued_surfaces(surface_view, is_free_at, key);
  bool goes_on = false;
  for (std::size_t i = 0; i < surface.data.size(); ++i) {
    if (surface.data[i] > 0) seen.trust.data[i] = 0, goes_on = true;
    background.filled.data[i] = vacated_[v].data[i] != 0 && seen.trust.data[i] < correct::trusted;
  }
  auto picture = corrected(std::move(seen.color), vacated_[v], std::move(seen.trust), v, strength, key);
  if (!picture) return propagate(picture);
  background.picture = std::move(*picture);
  if (goes_on) background.seeds = add_seeds(working, view, surface, background.picture, inputs());
  trust_.resize(working.role.size(), 1.0f);  // what has been decided stays
  return background;
}

Result<scene::Image> Repair::correct_view(const WorkingScene& working, const Rows& rows, const Background& background,
                                          const scene::Mask& mask, std::size_t v, double strength, std::uint64_t key) {
  Seen seen = look(working, rows.gone, v);
  if (!rows.gone.empty()) {
    const scene::Image share = footprint(working.cloud, rows.moved, views_[v], workspace_);
    for (std::size_t i = 0; i < share.data.size(); ++i) {
      if (background.filled.data[i] == 0) continue;
      // Seeds blur a little what they were made from, so the picture itself counts, but for what stands before it.
      const float behind = std::clamp(1 - share.data[i] / covering, 0.0f, 1.0f);
      for (int c = 0; c < 3; ++c) {
        float& shown = seen.color.plane(c)[i];
        shown += behind * (background.picture.plane(c)[i] - shown);
      }
      if (behind > 0) seen.trust.data[i] = 1;
    }
  }
  for (float& trust : seen.trust.data) trust = std::min(trust / half_seen, 1.0f);
  return corrected(std::move(seen.color), mask, std::move(seen.trust), v, strength, key);
}

Result<Repair::Outcome> Repair::correct(WorkingScene& working, std::span<const scene::Mask> masks, int u, int a,
                                        const std::function<Result<void>(double)>& advance) {
  Outcome outcome;
  outcome.corrected.pictures.resize(views_.size());
  const Rows rows = rows_of(working);
  note_vacated(rows, masks);
  if (auto tuned = corrector_.fine_tune(buffer_, 0); !tuned) return propagate(tuned);
  const double strength = strength_of(params_, a);
  const std::vector<std::size_t> order = outward(views_);
  trust_ = trust_of_rows(working, observed_, mode_);
  const Opaque opaque(working, original_, mode_);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::size_t v = order[k];
    const std::uint64_t key = params_.seed + std::uint64_t(u) * 0x10001 + std::uint64_t(a) * 0x101 + v * 0x1000003;
    Background background;
    if (!rows.gone.empty()) {
      auto completed = complete_background(working, rows, v, strength, key);
      if (!completed) return propagate(completed);
      background = std::move(*completed);
      outcome.seeds += background.seeds;
    }
    auto picture = correct_view(working, rows, background, masks[v], v, strength, key + 1);
    if (!picture) return propagate(picture);
    outcome.corrected.pictures[v] = std::move(*picture);
    if (auto going = advance(double(k + 1) / double(order.size())); !going) return propagate(going);
  }
  outcome.corrected.trust = std::move(trust_);  // seeds, trails and originals are what the optimisation is to change
  for (std::size_t i = 0; i < working.role.size(); ++i)
    if (working.role[i] != Role::copy && working.role[i] != Role::held) outcome.corrected.trust[i] = 0;
  return outcome;
}

Repair::Rows Repair::rows_of(const WorkingScene& working) const {
  Rows rows;
  for (std::uint32_t i = 0; i < working.role.size(); ++i) {
    const Role role = working.role[i];
    if (role == Role::original && mode_ == Mode::move) rows.gone.push_back(i);
    if (role == Role::copy) rows.moved.push_back(i);
    if (role == Role::copy || (role == Role::original && mode_ == Mode::move)) rows.dragged.push_back(i);
  }
  return rows;
}

void Repair::note_vacated(const Rows& rows, std::span<const scene::Mask> masks) {
  vacated_.resize(views_.size());
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const scene::Image share = footprint(original_, rows.gone, views_[v], workspace_);
    vacated_[v] = mask::dilate(mask::mask2d(share), std::max(1, views_[v].height / 128));
    buffer_[v].excluded = mask::mask2d(share, trace);
    buffer_[v].box = scene::bounding_box(masks[v]);
  }
}

const neighbours::PointIndex& Repair::inputs() {
  if (!inputs_) {
    std::vector<float> points;
    for (std::size_t i = 0; i < original_.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) points.push_back(original_.mean.get(i)[axis]);
    inputs_.emplace(points, 3);
  }
  return *inputs_;
}

}  // namespace engine::edit
