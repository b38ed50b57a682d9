#include "engine/repair/repair.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/core/rows.h"
#include "engine/correct/pyramid.h"
#include "engine/correct/repeats.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/render/weight_sums.h"
#include "engine/repair/chart.h"
#include "engine/repair/seed.h"
#include "engine/repair/spots.h"
#include "engine/repair/surfaces.h"
#include "engine/repair/survey.h"
#include "engine/repair/trust.h"
#include "engine/repair/vacated.h"
#include "engine/repair/veils.h"
#include "engine/repair/view_order.h"
#include "engine/scene/in_picture.h"
#include "engine/train/densify.h"
#include "engine/working/footprint.h"

namespace engine::repair {
namespace {

using working::Role;

// As long as half of what moved was seen, it is better kept than made up.
constexpr float half_seen = 0.5f;
// Share of the dragged part in a pixel from which on it is no longer background, and from which on it no longer shows
// what is behind.
constexpr float covering = 0.1f, trace = 0.02f;
// Part of its light from which on a Gaussian was seen, wherever it lies. What is under a thing shines through the
// thing's blurred rim with up to a third (the captured pouf: with 0.2 what nobody saw stayed, in front of what was
// completed).
constexpr float shows = 0.5f;
// How long what comes before the views takes, in units of what a view then takes: the closure, and looking for the view
// that tells most, at each view. From 6 to 14 and from 0.5 to 0.9 on the ball and the leaf of the demo scene, the ear
// of a fox and a doll: progress and the time that is left go by it.
constexpr double closure_views = 10, telling_views = 0.75;
// Below this opacity of all that is there a pixel shows nothing. A choice: what is faint is no air.
constexpr float nothing = 0.05f;
// Share of seeds in a pixel from which on it shows what the repair has decided.
constexpr float decided = 0.5f;
// Mean share of the part in the pixels that a row is seen in, over the views of the edit, from which on its colour was
// learnt through the part's blurred outline, and makes up for it: beside a red apple the cloth is bluer. From 0.07 to
// 0.15 captured cases are alike. Rows that have less light than a pixel in all views tell nothing.
constexpr double tainting = 0.15, least_light = 1;
// Of the five spots of a row: those on a completed surface of a row that goes there. All of them: clutter -1.2 dB
// where the part was, tiles -0.5; the middle alone: lamp -0.2.
constexpr int most_of_spots = 3;
// Part of the rows of what has left that lay in the surface completed there, from which on it was no body.
constexpr double mostly_flat = 0.5;
// A stain goes so deep, in parts of its distance: the layers of a surface below the one that shows are stained as well.
constexpr double stain_depth = 0.03;
// So deep, in parts of its distance, is the front of a part: nine in ten depths of captures are surer than that.
constexpr double front_depth = 0.002;
// By so much of its distance nearer or farther than a completed surface a row is not on it.
constexpr double off_surface = 0.03;
// What is closed must be as wide as so many blurred outlines: between leaves specks were laid into the air (the
// captured plant: outside -0.12 dB with one, -0.03 with three).
constexpr int closing_blurs = 3;
// What closes a place lies so far behind the front of what has left, in extents of that. A hatch's closure is where the
// hatch was, give or take two nodes of the grid seen at a slant (with 0.05 half of it was closed). From 0.002 to 0.1
// the captured cases were alike before closures bent least, and a removed doll was closed over 81 to 75 % of its place.
constexpr double closing_gap = 0.12;
// What closes a place has the colour of what is around it, as a hint.
constexpr float hint_of_closure = 0.5f;
// Inverse depth of a seed beneath what is seen of the same surface, in parts of that: so far behind that what is seen
// stays in front, and not so far that anybody sees a step. 1 and 0.99 are worse (ADR 45).
constexpr float beneath = 0.997f;
constexpr std::size_t most_examples = 6;  // of the buffer, for each view: its neighbours on either side
// How long it takes to show a view again once all are completed, in units of what one takes to be completed. A choice.
constexpr double shown_views = 0.25;

/// While it lives, what a drawn-out part leaves along its way is as opaque as the part: it was only made half
/// transparent so that the optimisation can choose, and a picture that shows it so is no picture of the scene.
class OpaqueTrail {
 public:
  OpaqueTrail(WorkingScene& working, const scene::GaussianCloud& original, Mode mode) : working_(working) {
    if (mode == Mode::move) return;
    const auto& role = working.role();
    std::vector<float>& logits = working.gaussians().opacity_logit;
    lowered_ = logits;
    const bool has_trail = std::find(role.begin(), role.end(), Role::trail) != role.end();
    for (std::size_t row = 0; row < role.size(); ++row)
      if (role[row] == Role::original || role[row] == Role::trail) {
        const float before = original.opacity_logit[working.parent()[row]];
        logits[row] = std::max(logits[row], has_trail ? train::halved_opacity(before) : before);
      }
  }
  ~OpaqueTrail() { std::copy(lowered_.begin(), lowered_.end(), working_.gaussians().opacity_logit.begin()); }
  OpaqueTrail(const OpaqueTrail&) = delete;
  OpaqueTrail& operator=(const OpaqueTrail&) = delete;

 private:
  WorkingScene& working_;
  std::vector<float> lowered_;  ///< Opacities as they were; seeds appended since have none.
};

/// Pixels by which outlines of what has left are widened: they are blurred.
int rim_px(const scene::Camera& view) { return std::max(1, view.height / 128); }

/// Pixels beside what cannot be relied upon that a chart does without: four times what outlines are blurred by. With
/// twice, what is left of the rim of a part was taken for its surroundings.
int chart_rim_px(const scene::Camera& view) { return 4 * mask::blur_radius(view.height); }

/// "512 x 384 x 3": pixels and channels.
std::string size_text(int width, int height, int channels) {
  return std::to_string(width) + " x " + std::to_string(height) + " x " + std::to_string(channels);
}
std::string size_text(const scene::Image& picture) {
  return size_text(picture.width, picture.height, picture.channels);
}

/// About the share of these rows that lie in the picture, by their means. Never 0, so that views that show no more than
/// rims still compare; 1 where there are no rows.
double share_in_picture(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                        const scene::Camera& view) {
  const auto within = std::ranges::count_if(rows, [&](std::uint32_t row) {
    return pixel_in_picture(view, view.cam_from_world(cloud.mean.get(row))).has_value();
  });
  return double(within + 1) / double(rows.size() + 1);
}

/// What the repainter has made of a picture, within the mask; towards its rim it fades into what was there.
void lay_in(const scene::Image& repainted, const scene::Mask& mask, scene::Image& picture) {
  const std::vector<int> depth = correct::depth_within(mask);
  // Masks are dilated by as much: what was deformed is repainted fully.
  const auto rim = float(mask::dilation_radius(mask.height) + 1);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] == 0) continue;
    const float share = std::min(float(depth[i]) / rim, 1.0f);
    for (int c = 0; c < 3; ++c) {
      float& shown = picture.plane(c)[i];
      shown += share * (repainted.plane(c)[i] - shown);
    }
  }
}

}  // namespace

/// What random choices are made for, in each view of each correction.
enum class Repair::Purpose : std::uint32_t { surfaces, background, view, chart, repaint, tune };

/// What a view shows now, without the rows that are hidden.
struct Repair::ViewNow {
  scene::Image color;          ///< [3]
  scene::Image trust;          ///< [1]
  scene::Image inverse_depth;  ///< [1] Of the first half of the light; 0: nothing.
  scene::Mask empty;           ///< Next to nothing shows.
  scene::Mask reliable;        ///< Trusted and opaque.
  scene::Mask within;          ///< Not seen by anyone, and within what has left.
};

Repair::Repair(scene::GaussianCloud original, std::span<const scene::Camera> observers,
               std::vector<scene::Camera> views, std::span<const std::uint32_t> healed, std::vector<float> arrival,
               Mode mode, std::uint64_t seed, correct::Corrector& corrector)
    : original_(std::move(original)),
      views_(std::move(views)),
      mode_(mode),
      seed_(seed),
      corrector_(corrector),
      witnesses_(original_, mode == Mode::move ? observers : observers.first(0)),
      healed_(healed.begin(), healed.end()),
      arrival_(std::move(arrival)),
      unedited_(render_unedited(original_, views_)) {
  for (std::size_t v = 0; v < views_.size(); ++v)
    buffer_.push_back({std::move(unedited_.color[v]), scene::Mask(views_[v].width, views_[v].height), {}});
  unedited_.color.clear();
  shown_ = shown_rows(original_, observers);
  if (mode == Mode::move)
    for (std::uint32_t row = 0; row < original_.size(); ++row)
      if (shown_[row] < shows && !witnesses_.saw(original_.mean.get(row))) unseen_.push_back(row);
  if (mode == Mode::extend) healed_.clear();
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const scene::Image share = working::footprint(original_, healed_, views_[v], workspace_);
    stained_.push_back(mask::dilate(mask::mask2d(share), rim_px(views_[v])));
  }
  if (mode == Mode::move) originals_.emplace(interleaved(original_.mean), 3);
}

Repair::ViewNow Repair::look(const WorkingScene& working, std::span<const std::uint32_t> hidden, std::size_t v) {
  const scene::Camera& view = views_[v];
  render::Layers layers(working.cloud());
  layers.hidden = hidden;
  render::ForwardOptions options;
  options.depth = true;
  render::Rendering now;
  render::forward(layers, view, options, trust_, workspace_, now);
  ViewNow seen{std::move(now.color),
               std::move(now.weight),
               std::move(now.median_depth),
               scene::Mask(view.width, view.height),
               scene::Mask(view.width, view.height),
               scene::Mask(view.width, view.height)};
  for (std::size_t i = 0; i < now.alpha.data.size(); ++i) {
    float& depth = seen.inverse_depth.data[i];
    depth = depth > 0 ? 1 / depth : 0;
    seen.empty.data[i] = now.alpha.data[i] < nothing;
    seen.reliable.data[i] =
        depth > 0 && seen.trust.data[i] >= correct::trusted && now.alpha.data[i] >= correct::trusted;
  }
  return seen;
}

std::uint64_t Repair::seed_for(Purpose purpose, std::size_t v, const Round& round) const {
  return derived_seed(seed_, {std::uint32_t(purpose), std::uint32_t(v), std::uint32_t(round.interval),
                              std::uint32_t(round.correction)});
}

Result<scene::Image> Repair::ask_corrector(scene::Image picture, const scene::Mask& mask, scene::Image trust,
                                           std::size_t v, std::vector<std::size_t> examples, const Round& round,
                                           Purpose purpose) {
  const correct::CorrectionTask task{std::move(picture), mask, std::move(trust), std::move(examples)};
  auto pictures = corrector_.correct(std::span(&task, 1), round.strength, seed_for(purpose, v, round));
  if (!pictures) return propagate(pictures);
  const std::string due = size_text(mask.width, mask.height, 3);
  const std::string came = pictures->empty() ? "none" : size_text(pictures->front());
  if (pictures->size() != 1 || came != due)
    return fail(ErrorCode::internal,
                "view " + std::to_string(v) + ": the corrector was to give back one picture of " + due + ", and gave " +
                    std::to_string(pictures->size()) + ", the first of " + came,
                "corrector");
  return std::move(pictures->front());
}

ContinuedSurfaces Repair::surfaces_behind(const ViewNow& now, std::size_t v, const Round& round) const {
  const scene::Camera& view = views_[v];
  SurfaceView surface_view{now.inverse_depth, now.reliable, vacated_[v], scene::Mask(view.width, view.height),
                           now.within};
  for (std::size_t i = 0; i < now.trust.data.size(); ++i)
    surface_view.doubtful.data[i] = now.trust.data[i] < correct::trusted;
  const auto is_free_at = [&](DVec2 pixel, double inverse_depth) {
    // Where the part's own front was, nothing else was: what goes on there would close what the part has opened.
    const int x = int(pixel.x), y = int(pixel.y);
    const double front = double(unedited_.median_depth[v].at(x, y));
    if (stained_[v].at(x, y) == 0 && inverse_depth * front > 1 - front_depth) return true;
    // Where a camera looked, there is what it saw, or nothing, whatever hides it from this view.
    const DVec3 point = point_at(view, pixel, inverse_depth);
    return (stained_[v].at(x, y) == 0 && witnesses_.saw(point)) || is_free(point, unedited_, views_);
  };
  return continued_surfaces(surface_view, is_free_at, seed_for(Purpose::surfaces, v, round));
}

void Repair::give_up_healed(WorkingScene& working) const {
  for (const std::uint32_t row : healed_)
    if (working::stays(working.role()[row])) working.give_up(row);
}

void Repair::doubt_unseen(const WorkingScene& working, const Rows& rows, std::size_t v, ViewNow& now) {
  const scene::Camera& view = views_[v];
  render::Layers layers(working.cloud());
  layers.hidden = rows.dragged;
  const std::vector<std::uint32_t> seeds = working.rows_of(Role::seed);
  const scene::Image share = working::footprint(layers, seeds, view, workspace_);
  std::vector<float> through(shown_);
  through.resize(working.size(), 1.0f);  // seeds are as if seen
  const scene::Image light = working::blended(layers, through, scene::bounding_box(vacated_[v]), view, workspace_);
  scene::Mask unseen(view.width, view.height);
  parallel_for(std::size_t(view.height), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < view.width; ++x) {
        const double inverse_depth = double(now.inverse_depth.at(x, y));
        if (vacated_[v].at(x, y) == 0 || !(inverse_depth > 0) || share.at(x, y) >= decided) continue;
        const bool is_under_stain =
            stained_[v].at(x, y) != 0 && inverse_depth * double(unedited_.median_depth[v].at(x, y)) > 1 - stain_depth;
        // Depths of noisy surfaces are farther apart than a point may be behind what a camera shows.
        unseen.at(x, y) = is_under_stain || (light.at(x, y) < shows &&
                                             !witnesses_.saw(point_at(view, {x + 0.5, y + 0.5}, inverse_depth)));
      }
  });
  unseen = mask::dilate(mask::opened(unseen, mask::blur_radius(view.height)), rim_px(view));
  for (std::size_t i = 0; i < unseen.data.size(); ++i) {
    if (unseen.data[i] == 0 || vacated_[v].data[i] == 0) continue;
    now.trust.data[i] = 0, now.reliable.data[i] = 0;
    now.within.data[i] = now.inverse_depth.data[i] * far_side_[v].data[i] >= 1;
  }
}

std::optional<Repair::Completed::Place> Repair::Completed::place_of(DVec3 point) const {
  const DVec3 p = camera.cam_from_world(point);
  const auto pixel = pixel_in_picture(camera, p);
  if (!pixel) return std::nullopt;
  const double inverse_depth = double(surface.at(int(pixel->x), int(pixel->y)));
  if (!(inverse_depth > 0)) return std::nullopt;
  return Place{*pixel, p.z, p.z * inverse_depth};
}

std::vector<std::uint32_t> Repair::unseen_before(const WorkingScene& working, const Completed& completed) const {
  std::vector<std::uint32_t> before;
  for (const std::uint32_t row : unseen_) {
    if (!working::stays(working.role()[row])) continue;
    const auto place = completed.place_of(working.cloud().mean.get(row));
    if (!place || place->relative > 1 + off_surface) continue;
    // What lies where the part was not, and not on the surface either, is the inside of something else.
    if (place->relative >= 1 - off_surface || completed.was_within(place->pixel, place->z)) before.push_back(row);
  }
  return before;
}

std::vector<std::uint32_t> Repair::tainted_on(const WorkingScene& working, const Completed& completed) const {
  if (tainted_.empty()) return {};
  const auto is_on_it = [&](DVec3 spot) {
    const auto place = completed.place_of(spot);
    return place && std::abs(place->relative - 1) <= off_surface;
  };
  // Beside what lay in the surface itself, as a stain does, nothing was seen through it.
  const auto count_of_open = [&](const auto& holds) {
    return double(std::ranges::count_if(open_, [&](std::uint32_t row) { return holds(original_.mean.get(row)); }));
  };
  const double by_it = count_of_open([&](DVec3 mean) { return completed.place_of(mean).has_value(); });
  if (count_of_open(is_on_it) > mostly_flat * by_it) return {};
  // What was seen before it is something else, and what reaches far beyond it would leave a gap there.
  std::vector<std::uint32_t> on_it;
  for (const std::uint32_t row : tainted_) {
    if (!working::stays(working.role()[row])) continue;
    const auto spots = spots_of(working.cloud(), row);
    if (is_on_it(spots[0]) && std::ranges::count_if(spots, is_on_it) >= most_of_spots) on_it.push_back(row);
  }
  return on_it;
}

void Repair::clear_before(WorkingScene& working, Rows& rows, const Completed& completed) const {
  const std::vector<std::uint32_t> leaving = united(unseen_before(working, completed), tainted_on(working, completed));
  for (const std::uint32_t row : leaving) working.give_up(row);
  rows.gone = united(rows.gone, leaving), rows.dragged = united(rows.dragged, leaving);
}

Result<void> Repair::find_tainted(const WorkingScene& working, const Rows& rows,
                                  const std::function<Result<void>()>& looked) {
  tainted_.clear();
  if (mode_ != Mode::move) return {};
  // Of a removal nothing has arrived. What was given up on the way is not the part.
  std::vector<std::uint32_t> part = healed_;
  if (!rows.moved.empty()) part.clear();
  for (const std::uint32_t row : rows.moved) part.push_back(working.parent()[row]);
  std::sort(part.begin(), part.end());
  part.erase(std::unique(part.begin(), part.end()), part.end());
  if (part.empty()) return {};
  std::vector<double> light(original_.size()), on_part(original_.size());
  for (const scene::Camera& view : views_) {
    const scene::Image share = working::footprint(original_, part, view, workspace_);
    render::add_weight_sums(original_, view, share, workspace_, light, on_part);
    if (auto going = looked(); !going) return going;
  }
  for (std::uint32_t row = 0; row < original_.size(); ++row)
    if (light[row] >= least_light && on_part[row] > tainting * light[row] && !std::ranges::binary_search(part, row))
      tainted_.push_back(row);
  return {};
}

void Repair::clear_veils(WorkingScene& working, Rows& rows) {
  veils_ = veils_before(working, original_, rows.vacating, rows.moved, views_, workspace_);
  for (const std::uint32_t row : veils_) working.give_up(row);
  rows.gone = united(rows.gone, veils_), rows.dragged = united(rows.dragged, veils_);
}

Result<Repair::Telling> Repair::most_telling_view(const WorkingScene& working, const Rows& rows, const Round& round,
                                                  const std::function<Result<void>()>& looked) {
  Telling best;
  double most = 0;
  if (rows.gone.empty()) return best;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    ViewNow now = look(working, rows.dragged, v);
    doubt_unseen(working, rows, v, now);
    ContinuedSurfaces surfaces = surfaces_behind(now, v, round);
    const auto shown_by = [](const scene::Image& found) {
      return std::ranges::count_if(found.data, [](float inverse_depth) { return inverse_depth > 0; });
    };
    // Of a picture that shows little else nobody could say how it goes on.
    const double around = 1 - double(vacated_[v].area()) / double(vacated_[v].data.size());
    const scene::Image closed = closing(working, rows, v, surfaces.inverse_depth);
    // Nor of one whose border cuts the place off: what is beyond it says how the other half goes on.
    const double whole = share_in_picture(original_, open_, views_[v]);
    const double shown = whole * around * around * double(shown_by(surfaces.inverse_depth) + shown_by(closed));
    if (shown > most) most = shown, best = {v, std::move(surfaces)};
    if (auto going = looked(); !going) return propagate(going);
  }
  return best;
}

Result<std::size_t> Repair::complete_chart(WorkingScene& working, Rows& rows, const Telling& telling,
                                           const Round& round) {
  if (views_.empty()) return 0;  // nothing that changes is seen
  std::optional<Chart> chart = chart_of(views_[telling.view], telling.surfaces);
  if (!chart) return 0;
  const int untold_px = chart_rim_px(views_[telling.view]);
  scene::Image trust_in_view;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    ViewNow now = look(working, rows.dragged, v);
    doubt_unseen(working, rows, v, now);
    add_view(*chart, views_[v], {now.color, now.inverse_depth, mask::eroded(now.reliable, chart_rim_px(views_[v]))});
    if (v == telling.view) trust_in_view = std::move(now.trust);
  }
  // Where a surface ends, a view that shows what is beyond its edge tells more than a chart, which has the surface
  // alone (the old case `lift` by a chart: 26.7 -> 22.4 dB).
  if (!is_surrounded(*chart, untold_px)) return 0;
  const scene::Mask rim = rim_of(*chart, views_[telling.view], trust_in_view, untold_px);
  const int side = chart->camera.width;
  correct::Example known{picture_of(*chart), scene::Mask(side, side), {0, 0, side, side}};
  scene::Image surface = chart->inverse_depth, below = surface, trust(side, side, 1);
  // What is made up around the hole matters as well: there the rim gets seeds beneath it.
  scene::Mask told(side, side);
  for (std::size_t i = 0; i < told.data.size(); ++i) told.data[i] = chart->weights.data[i] > 0;
  const scene::Mask foretold = correct::continue_repeats(known.picture, told, untold_around(*chart, untold_px));
  for (std::size_t i = 0; i < trust.data.size(); ++i) {
    trust.data[i] = told.data[i] != 0 || foretold.data[i] != 0 ? 1.0f : 0.0f;
    known.excluded.data[i] = told.data[i] == 0;
    if (chart->goes_on.data[i] == 0) surface.data[i] = 0;
    below.data[i] *= rim.data[i] != 0 ? beneath : 0;
  }

  if (auto tuned = corrector_.fine_tune(std::span(&known, 1), 0); !tuned) return propagate(tuned);
  auto picture =
      ask_corrector(known.picture, known.excluded, std::move(trust), telling.view, {0}, round, Purpose::chart);
  if (!picture) return propagate(picture);
  // Apart, so that the step between the two is no slope.
  const std::size_t seeds = add_seeds(working, chart->camera, surface, *picture, *originals_) +
                            add_seeds(working, chart->camera, below, *picture, *originals_);
  for (std::size_t i = 0; i < below.data.size(); ++i) surface.data[i] = std::max(surface.data[i], below.data[i]);
  double front = std::numeric_limits<double>::infinity();  // of what has left
  for (const std::uint32_t row : open_)
    front = std::min(front, chart->camera.cam_from_world(original_.mean.get(row)).z);
  clear_before(working, rows, {chart->camera, surface, [&](DVec2, double z) { return z >= front; }});
  trust_.resize(working.size(), 1.0f);  // what has been decided stays
  return seeds;
}

std::vector<std::uint32_t> Repair::left_out(const Rows& rows) const {
  std::vector<std::uint32_t> hidden;
  std::ranges::set_union(rows.dragged, unseen_, std::back_inserter(hidden));
  return hidden;
}

void Repair::close_place(const WorkingScene& working, const Rows& rows) {
  closure_.reset();
  if (open_.empty()) return;
  const std::vector<std::uint32_t> hidden = left_out(rows);
  render::Layers known(working.cloud());
  known.hidden = hidden;
  closure_.emplace(most_of(original_, open_), survey(known, original_, open_, witnesses_, workspace_));
}

scene::Image Repair::closing(const WorkingScene& working, const Rows& rows, std::size_t v,
                             const scene::Image& surface) {
  const scene::Camera& view = views_[v];
  scene::Image closing(view.width, view.height, 1);
  if (!closure_) return closing;
  ViewNow bare = look(working, left_out(rows), v);
  doubt_unseen(working, rows, v, bare);
  scene::Mask closed(view.width, view.height);
  parallel_for(std::size_t(view.height), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < view.width; ++x) {
        if (vacated_[v].at(x, y) == 0 || bare.reliable.at(x, y) != 0 || surface.at(x, y) > 0) continue;
        const DVec2 pixel(x + 0.5, y + 0.5);
        const double front = double(unedited_.median_depth[v].at(x, y));
        const double inverse_depth = closure_->inverse_depth_at(view, pixel, front * (1 - front_depth));
        // What was opened stays open: the closure of a hatch is about where the hatch was.
        if (inverse_depth * (front + closing_gap * closure_->extent()) > 1) continue;
        // A camera that has looked beyond it knows better.
        if (!(inverse_depth > 0) || witnesses_.saw(point_at(view, pixel, inverse_depth / (1 + off_surface)))) continue;
        closing.at(x, y) = float(inverse_depth);
        closed.at(x, y) = 1;
      }
  });
  const int least = closing_blurs * mask::blur_radius(view.height);
  closed = mask::dilate(mask::opened(closed, least), least);
  for (std::size_t i = 0; i < closed.data.size(); ++i)
    if (closed.data[i] == 0) closing.data[i] = 0;
  return closing;
}

Result<Repair::Background> Repair::complete_background(WorkingScene& working, Rows& rows, std::size_t v,
                                                       const Round& round) {
  const scene::Camera& view = views_[v];
  ViewNow now = look(working, rows.dragged, v);
  doubt_unseen(working, rows, v, now);
  scene::Image surface = surfaces_behind(now, v, round).inverse_depth;
  const scene::Image closing = this->closing(working, rows, v, surface);
  Background background{{}, scene::Mask(view.width, view.height), 0, {}};
  scene::Mask open(view.width, view.height);
  const scene::Mask mere_air = air(now.empty, vacated_[v]);
  bool goes_on = false;
  for (std::size_t i = 0; i < surface.data.size(); ++i) {
    if (closing.data[i] > 0) surface.data[i] = closing.data[i];
    if (surface.data[i] > 0) now.trust.data[i] = 0, goes_on = true;
    if (closing.data[i] > 0) {
      const std::size_t x = i % std::size_t(view.width), y = i / std::size_t(view.width);
      const DVec2 pixel(double(x) + 0.5, double(y) + 0.5);
      const Vec3 color = closure_->color_at(point_at(view, pixel, double(closing.data[i])));
      for (int c = 0; c < 3; ++c) now.color.plane(c)[i] = color[c];
      now.trust.data[i] = hint_of_closure;
    }
    background.filled.data[i] = vacated_[v].data[i] != 0 && now.trust.data[i] < correct::trusted;
    open.data[i] = background.filled.data[i] != 0 && mere_air.data[i] == 0 && !(surface.data[i] > 0);
  }
  background.uncovered = {vacated_[v].area() - mere_air.area(), open.area(), scene::bounding_box(open)};
  auto picture = ask_corrector(std::move(now.color), vacated_[v], std::move(now.trust), v,
                               nearest_views(views_, v, most_examples), round, Purpose::background);
  if (!picture) return propagate(picture);
  background.picture = std::move(*picture);
  if (goes_on) {
    background.seeds = add_seeds(working, view, surface, background.picture, *originals_);
    const auto was_within = [&](DVec2 pixel, double z) {
      const int x = int(pixel.x), y = int(pixel.y);
      return closing.at(x, y) > 0 || z <= double(far_side_[v].at(x, y));
    };
    clear_before(working, rows, {view, surface, was_within});
  }
  trust_.resize(working.size(), 1.0f);  // what has been decided stays
  return background;
}

Repair::ViewNow Repair::completed_view(const WorkingScene& working, const Rows& rows, const Background& background,
                                       std::size_t v) {
  ViewNow now = look(working, rows.gone, v);
  if (rows.gone.empty()) return now;
  const scene::Image share = working::footprint(working.cloud(), rows.moved, views_[v], workspace_);
  for (std::size_t i = 0; i < share.data.size(); ++i) {
    if (background.filled.data[i] == 0) continue;
    // Seeds blur a little what they were made from, so the picture itself counts, but for what stands before it.
    const float behind = std::clamp(1 - share.data[i] / covering, 0.0f, 1.0f);
    for (int c = 0; c < 3; ++c) {
      float& shown = now.color.plane(c)[i];
      shown += behind * (background.picture.plane(c)[i] - shown);
    }
    if (behind > 0) now.trust.data[i] = 1;
  }
  return now;
}

Result<scene::Image> Repair::correct_view(const WorkingScene& working, const Rows& rows, const Background& background,
                                          const scene::Mask& mask, std::size_t v, const Round& round) {
  ViewNow now = completed_view(working, rows, background, v);
  for (float& trust : now.trust.data) trust = std::min(trust / half_seen, 1.0f);
  return ask_corrector(std::move(now.color), mask, std::move(now.trust), v, nearest_views(views_, v, most_examples),
                       round, Purpose::view);
}

Result<Corrected> Repair::correct(WorkingScene& working, std::span<const scene::Mask> masks, const Round& round,
                                  const std::function<Result<void>(double)>& advance) {
  return walk(working, masks, round, Pictures::corrected_in_turn, advance);
}

Result<Corrected> Repair::complete(WorkingScene& working, std::span<const scene::Mask> masks, const Round& round,
                                   const std::function<Result<void>(double)>& advance) {
  auto completed = walk(working, masks, round, Pictures::shown_at_the_end, advance);
  if (completed) completed->trust.clear();
  return completed;
}

Result<void> Repair::repaint(std::vector<scene::Image>& pictures, std::span<const scene::Mask> masks,
                             const Round& round, correct::Repainter& repainter, const correct::Advance& advance) const {
  std::vector<correct::RepaintTask> tasks;
  std::vector<std::size_t> asked;
  for (std::size_t v = 0; v < pictures.size(); ++v)
    if (masks[v].area() > 0) tasks.push_back({pictures[v], masks[v]}), asked.push_back(v);
  if (tasks.empty()) return {};
  const auto repainted = repainter.repaint(tasks, round.strength, seed_for(Purpose::repaint, 0, round), advance);
  if (!repainted) return propagate(repainted);
  if (repainted->size() != tasks.size())
    return fail(ErrorCode::internal,
                "the repainter was given " + std::to_string(tasks.size()) + " pictures and gave back " +
                    std::to_string(repainted->size()),
                "repainter");
  for (std::size_t k = 0; k < tasks.size(); ++k) {
    const scene::Image& picture = (*repainted)[k];
    const std::string due = size_text(tasks[k].picture), view = "view " + std::to_string(asked[k]);
    if (size_text(picture) != due)
      return fail(
          ErrorCode::internal,
          view + ": the repainter was to give back a picture of " + due + ", and gave one of " + size_text(picture),
          "repainter");
    if (first_not_finite(picture.data))
      return fail(ErrorCode::internal, view + ": what the repainter made of it is not finite", "repainter");
    lay_in(picture, masks[asked[k]], pictures[asked[k]]);
  }
  return {};
}

std::uint64_t Repair::tuning_seed(int interval) const { return seed_for(Purpose::tune, 0, {interval, 0, 0}); }

Result<Corrected> Repair::walk(WorkingScene& working, std::span<const scene::Mask> masks, const Round& round,
                               Pictures pictures, const std::function<Result<void>(double)>& advance) {
  const bool in_turn = pictures == Pictures::corrected_in_turn;
  Corrected corrected;
  corrected.pictures.resize(views_.size());
  give_up_healed(working);
  Rows rows = rows_of(working);
  note_vacated(working, rows, masks);
  if (round.arrives && round.correction == 1) clear_veils(working, rows);
  trust_ = trust_of_rows(working, observed_rows(shown_), mode_);
  const OpaqueTrail opaque(working, original_, mode_);
  // Pictures for a repainter show what is painted where nothing can be completed: that is in no scene, and made anew.
  const bool opens =
      !in_turn || (round.correction == 1 && (round.interval == 1 || round.arrives || opens_more(working, rows)));
  const auto views = double(views_.size());
  const double surveyed =
      !opens ? 0 : (open_.empty() ? 0 : closure_views) + (rows.gone.empty() ? 0 : telling_views * views);
  const double all = surveyed + views + (in_turn ? 0 : shown_views * views);
  double done = 0;  // in views
  const auto advance_by = [&](double more) { return advance(std::min((done += more) / all, 1.0)); };
  std::size_t first = 0;
  if (opens) {
    const auto telling = survey_place(working, rows, round, advance_by, corrected.seeds);
    if (!telling) return propagate(telling);
    first = *telling;
    if (!rows.gone.empty()) corrected.uncovered.resize(views_.size());
  }
  if (auto tuned = corrector_.fine_tune(buffer_, 0); !tuned) return propagate(tuned);
  std::vector<Background> backgrounds(views_.size());
  for (const std::size_t v : outward(views_, first)) {
    backgrounds[v].filled = scene::Mask(views_[v].width, views_[v].height);
    if (opens && !rows.gone.empty()) {
      auto completed = complete_background(working, rows, v, round);
      if (!completed) return propagate(completed);
      backgrounds[v] = std::move(*completed);
      corrected.seeds += backgrounds[v].seeds;
      corrected.uncovered[v] = backgrounds[v].uncovered;
    }
    if (in_turn) {
      auto picture = correct_view(working, rows, backgrounds[v], masks[v], v, round);
      if (!picture) return propagate(picture);
      corrected.pictures[v] = std::move(*picture);
      backgrounds[v] = {};
    }
    if (auto going = advance_by(1); !going) return propagate(going);
  }
  for (std::size_t v = 0; v < views_.size() && !in_turn; ++v) {
    corrected.pictures[v] = completed_view(working, rows, backgrounds[v], v).color;
    backgrounds[v] = {};
    if (auto going = advance_by(shown_views); !going) return propagate(going);
  }
  corrected.trust = std::move(trust_);  // seeds, and trails and originals of an extend, are free to change
  for (std::size_t i = 0; i < working.size(); ++i)
    if (!working::is_dragged(working.role()[i]) && working.role()[i] != Role::continued &&
        working.role()[i] != Role::relit && (opens || working.role()[i] != Role::seed))
      corrected.trust[i] = 0;
  return corrected;
}

Result<std::size_t> Repair::survey_place(WorkingScene& working, Rows& rows, const Round& round,
                                         const std::function<Result<void>(double)>& advance_by, std::size_t& seeds) {
  if (auto found = find_tainted(working, rows, [&] { return advance_by(0); }); !found) return propagate(found);
  close_place(working, rows);
  if (!open_.empty())
    if (auto going = advance_by(closure_views); !going) return propagate(going);
  const auto telling = most_telling_view(working, rows, round, [&] { return advance_by(telling_views); });
  if (!telling) return propagate(telling);
  auto charted = complete_chart(working, rows, *telling, round);
  if (!charted) return propagate(charted);
  seeds += *charted;
  return telling->view;
}

std::vector<std::uint32_t> Repair::open_among(std::span<const std::uint32_t> left, const Array3& means,
                                              const Rows& rows) const {
  std::vector<std::uint32_t> open = rows_left_open(original_, left, interleaved(means, rows.moved));
  return arrival_.empty() ? open : united(open, rows_left_open(original_, left, arrival_));
}

bool Repair::opens_more(const WorkingScene& working, const Rows& rows) const {
  std::vector<std::uint32_t> leaving;  // in this interval
  for (const std::uint32_t row : rows.moved)
    if (working.mean_at_deform().get(row) == original_.mean.get(working.parent()[row]))
      leaving.push_back(working.parent()[row]);
  std::sort(leaving.begin(), leaving.end());
  std::vector<std::uint32_t> had_left;
  std::ranges::set_difference(rows.vacating, leaving, std::back_inserter(had_left));
  return !std::ranges::includes(open_among(had_left, working.mean_at_deform(), rows), open_);
}

Repair::Rows Repair::rows_of(const WorkingScene& working) const {
  Rows rows;
  for (std::uint32_t i = 0; i < working.size(); ++i) {
    const bool is_gone = working::has_left(working.role()[i]) && mode_ == Mode::move;
    const bool is_moved = working::has_arrived(working.role()[i]);
    if (is_gone) rows.gone.push_back(i);
    if (is_gone && i < working.input_rows() && !std::ranges::binary_search(veils_, i)) rows.vacating.push_back(i);
    if (is_moved) rows.moved.push_back(i);
    if (is_gone || is_moved) rows.dragged.push_back(i);
  }
  return rows;
}

void Repair::note_vacated(const WorkingScene& working, const Rows& rows, std::span<const scene::Mask> masks) {
  vacated_.resize(views_.size());
  far_side_.resize(views_.size());
  // What is made up from a sliver of its place stays: once the whole is open it would be a stain (ADR 65).
  open_ = open_among(rows.vacating, working.cloud().mean, rows);
  const std::vector<std::uint32_t> relit = working.rows_of(Role::relit);
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const scene::Image share = working::footprint(original_, rows.vacating, views_[v], workspace_);
    const scene::Image open_share = working::footprint(original_, open_, views_[v], workspace_);
    vacated_[v] = mask::dilate(mask::mask2d(open_share), rim_px(views_[v]));
    mask::unite(vacated_[v], stained_[v]);
    far_side_[v] = far_side(original_, open_, views_[v]);
    buffer_[v].excluded = mask::mask2d(share, trace);
    // The pictures show it in the shadow of what has left.
    mask::unite(buffer_[v].excluded, mask::mask2d(working::footprint(original_, relit, views_[v], workspace_)));
    buffer_[v].box = scene::bounding_box(masks[v]);
  }
}

}  // namespace engine::repair
