#include "engine/captures/grasp.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "engine/captures/looking.h"
#include "engine/captures/moving_part.h"
#include "engine/captures/outlines.h"
#include "engine/core/rows.h"
#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/mask/mask.h"
#include "engine/scene/in_picture.h"
#include "engine/select/select.h"

namespace engine::captures {
namespace {

// How a careless person places balls, as a share of the radius that one would choose; choices, and part of the
// definition of the cases. The ball's rim runs through about the middle of the thing: half of it is left out, and
// beyond its outline the ball takes in what it should not.
constexpr double too_large = 1.25, off_centre = 1.2;

// Factors that bare balls are tried with: finer steps than a person would take.
constexpr double least_factor = 0.25, most_factor = 2.0;
constexpr int factors = 25;

constexpr int most_wider = 3;  // times that a person asks for more, or for less: a choice

constexpr int too_wide_px = 5;  // beyond the true outline: what segmentation tools are off by at worst

/// To the right in the first photo.
DVec3 right_of(const CapturedCase& the_case) { return glm::transpose(the_case.cameras.front().rotation)[0]; }

void place_carelessly(const CapturedCase& the_case, edit::Handle& handle) {
  const DVec3 off = off_centre * handle.radius * right_of(the_case);
  handle.source += off;
  if (handle.target) *handle.target += off;
  handle.radius *= too_large;
}

/// A request without what says which Gaussians move.
edit::Request asked_of(const CapturedCase& the_case) {
  edit::Request request;
  request.mode = the_case.mode;
  request.handles = the_case.handles;
  return request;
}

/// The request, and the rows that follow its handles.
Result<Grasp> grasp_of(std::string by, edit::Request request, const scene::GaussianCloud& scene) {
  const auto assigned = edit::assign(scene, request);
  if (!assigned) return propagate(assigned);
  Grasp out{std::move(by), std::move(request), {}};
  // An anchor holds what its ball holds; what is selected is meant to move, and does, however near to an anchor it is.
  out.rows = rows_where(assigned->handle, [&](std::uint16_t handle) {
    return handle > 0 && (out.request.selected || !out.request.handles[handle - 1].is_anchor());
  });
  return out;
}

/// By a selection; each of its rows goes with the nearest handle.
Result<Grasp> grasp_by_selection(std::string by, select::Selection selection, const CapturedCase& the_case,
                                 const scene::GaussianCloud& scene) {
  edit::Request request = asked_of(the_case);
  if (the_case.careless) {
    const scene::Camera& photo = the_case.cameras.front();
    const DVec3 handle = request.handles.front().source;
    const double depth = photo.cam_from_world(handle).z;
    selection.push_back({select::Op::add, select::Expand{the_case.careless->beyond_px * depth / photo.fx}});
    selection.push_back({select::Op::intersect, select::Plane{handle, right_of(the_case)}});
  }
  const auto selected = select::select(scene, selection);
  if (!selected) return propagate(selected);
  request.selected = marked_rows(selected->rows);
  if (request.mode == edit::Mode::move) {  // nobody who has said what moves says how far a handle grips, too
    request.params.interpolation = edit::Interpolation::arap;
    for (edit::Handle& handle : request.handles) handle.radius = 0;
    edit::give_radii(selected->bounds, request);
  }
  if (auto valid = edit::validate(request); !valid) return propagate(valid);
  return grasp_of(std::move(by), std::move(request), scene);
}

/// The harmonic mean of recall and precision.
double f1_of(const Match& match) {
  const double sum = match.recall + match.precision;
  return sum > 0 ? 2 * match.recall * match.precision / sum : 0;
}

/// Are all places that somebody would take hold of within the picture?
bool has_handles(const CapturedCase& the_case, const scene::Camera& camera) {
  return std::ranges::all_of(the_case.handles, [&](const edit::Handle& handle) {
    return scene::pixel_in_picture(camera, camera.cam_from_world(handle.source)).has_value();
  });
}

/// The photos that were taken farthest to the left, in the middle and farthest to the right, of those that it is in.
std::vector<scene::Camera> three_photos(const CapturedCase& the_case) {
  const DVec3 right = right_of(the_case);
  std::vector<scene::Camera> photos;
  std::ranges::copy_if(the_case.cameras, std::back_inserter(photos),
                       [&](const scene::Camera& camera) { return has_handles(the_case, camera); });
  if (photos.empty()) photos = the_case.cameras;
  const auto [left_most, right_most] =
      std::ranges::minmax_element(photos, {}, [&](const scene::Camera& c) { return glm::dot(c.centre(), right); });
  return {*left_most, the_case.cameras.front(), *right_most};
}

Result<Grasp> grasp_by_outlines(std::string by, int beyond_px, const CapturedCase& the_case,
                                const scene::GaussianCloud& scene) {
  const std::vector<scene::Camera> photos = three_photos(the_case);
  const std::vector<scene::Mask> outlines = true_outlines(the_case, photos);
  select::Masks masks;
  for (std::size_t i = 0; i < photos.size(); ++i)
    masks.views.push_back({photos[i], mask::dilate(outlines[i], beyond_px)});
  return grasp_by_selection(std::move(by), {{select::Op::add, std::move(masks)}}, the_case, scene);
}

Result<Grasp> grasp_by_a_look(std::string by, WhenWorse when_worse, const CapturedCase& the_case,
                              const scene::GaussianCloud& scene) {
  auto clicks = clicks_of_a_looking_person(the_case, scene, when_worse);
  if (!clicks) return propagate(clicks);
  return grasp_by_selection(std::move(by), {{select::Op::add, *std::move(clicks)}}, the_case, scene);
}

}  // namespace

Result<Grasp> grasp_by_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  edit::Request request = asked_of(the_case);
  request.region = the_case.region;
  if (the_case.careless)
    for (edit::Handle& handle : request.handles) place_carelessly(the_case, handle);
  return grasp_of("balls", std::move(request), scene);
}

Result<Grasp> grasp_by_bare_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  const auto grasp = [&](double factor) {
    edit::Request request = asked_of(the_case);
    for (edit::Handle& handle : request.handles)
      if (handle.target) handle.radius *= factor;
    return grasp_of("bare", std::move(request), scene);
  };
  const std::vector<double> counts = opacities_times_area(scene);
  double best = 1, best_f1 = -1;
  for (int i = 0; i < factors; ++i) {
    const double factor = least_factor * std::pow(most_factor / least_factor, double(i) / (factors - 1));
    const auto tried = grasp(factor);
    if (!tried) continue;
    const double f1 = f1_of(match(scene, tried->rows, the_case.moving, counts));
    if (f1 > best_f1) best = factor, best_f1 = f1;
  }
  auto out = grasp(best);
  if (!out || !the_case.careless) return out;
  for (edit::Handle& handle : out->request.handles) place_carelessly(the_case, handle);
  return grasp_of("bare", std::move(out->request), scene);
}

Result<Grasp> grasp_by_a_click(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  if (the_case.clicks.inside.empty()) return fail(ErrorCode::invalid_argument, "there is none", "clicks.inside");
  select::Grow click{{the_case.clicks.inside.front()}, {}, {}};
  click.whole = true;
  const std::vector<double> counts = opacities_times_area(scene);
  std::optional<Result<Grasp>> best;
  double best_f1 = -1;
  for (click.wider = -most_wider; click.wider <= most_wider; ++click.wider) {
    auto tried = grasp_by_selection("click", {{select::Op::add, click}}, the_case, scene);
    const double f1 = tried ? f1_of(match(scene, tried->rows, the_case.moving, counts)) : -1;
    if (!best || f1 > best_f1) best = std::move(tried), best_f1 = f1;
  }
  return *std::move(best);
}

Result<Grasp> grasp_by_clicks(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  const select::Grow clicks{the_case.clicks.inside, the_case.clicks.outside, {}};
  return grasp_by_selection("clicks", {{select::Op::add, clicks}}, the_case, scene);
}

Result<Grasp> grasp_by_looking(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  return grasp_by_a_look("looking", WhenWorse::undone, the_case, scene);
}

Result<Grasp> grasp_by_correcting(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  return grasp_by_a_look("correcting", WhenWorse::corrected, the_case, scene);
}

Result<Grasp> grasp_by_masks(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  return grasp_by_outlines("masks", 0, the_case, scene);
}

Result<Grasp> grasp_by_wide_masks(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  return grasp_by_outlines("wide_masks", too_wide_px, the_case, scene);
}

const std::vector<NamedGrasp>& known_grasps() {
  static const std::vector<NamedGrasp> all{{"balls", grasp_by_balls},     {"bare", grasp_by_bare_balls},
                                           {"click", grasp_by_a_click},   {"clicks", grasp_by_clicks},
                                           {"looking", grasp_by_looking}, {"correcting", grasp_by_correcting},
                                           {"masks", grasp_by_masks},     {"wide_masks", grasp_by_wide_masks}};
  return all;
}

}  // namespace engine::captures
