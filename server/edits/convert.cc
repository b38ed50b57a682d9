#include "server/edits/convert.h"

#include <utility>

#include "engine/correct/scene_corrector.h"
#include "engine/edit/handles.h"
#include "server/edits/points.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;

static_assert(proto::max_handles == edit::max_handles && proto::max_coordinate == edit::max_coordinate);

edit::Mode to_engine(proto::Mode mode) { return mode == proto::Mode::extend ? edit::Mode::extend : edit::Mode::move; }

edit::Rotation to_engine(proto::Rotation rotation) {
  switch (rotation) {
    case proto::Rotation::paper:
      return edit::Rotation::paper;
    case proto::Rotation::none:
      return edit::Rotation::none;
    case proto::Rotation::shortest_arc:
      break;
  }
  return edit::Rotation::shortest_arc;
}

proto::Rotation to_wire(edit::Rotation rotation) {
  switch (rotation) {
    case edit::Rotation::paper:
      return proto::Rotation::paper;
    case edit::Rotation::none:
      return proto::Rotation::none;
    case edit::Rotation::shortest_arc:
      break;
  }
  return proto::Rotation::shortest_arc;
}

edit::Interpolation to_engine(proto::Interpolation interpolation) {
  switch (interpolation) {
    case proto::Interpolation::smooth:
      return edit::Interpolation::smooth;
    case proto::Interpolation::rigid:
      return edit::Interpolation::rigid;
    case proto::Interpolation::paper:
      break;
  }
  return edit::Interpolation::paper;
}

proto::Interpolation to_wire(edit::Interpolation interpolation) {
  switch (interpolation) {
    case edit::Interpolation::smooth:
      return proto::Interpolation::smooth;
    case edit::Interpolation::rigid:
      return proto::Interpolation::rigid;
    case edit::Interpolation::paper:
      break;
  }
  return proto::Interpolation::paper;
}

edit::Params to_engine(const proto::Params& given, proto::Preset preset, const edit::Request& drag) {
  edit::Params params = preset_params(preset, drag);
  if (given.views) params.views = *given.views;
  if (given.exclude_views) params.exclude_views = *given.exclude_views;
  if (given.iterations) params.iterations = *given.iterations;
  if (given.annealing_steps) params.annealing_steps = *given.annealing_steps;
  if (given.strength_initial) params.strength_initial = *given.strength_initial;
  if (given.strength_final) params.strength_final = *given.strength_final;
  if (given.annealing)
    params.annealing = *given.annealing == proto::Annealing::paper ? edit::Annealing::paper : edit::Annealing::linear;
  if (given.max_image_side) params.max_image_side = *given.max_image_side;
  if (given.rotation) params.rotation = to_engine(*given.rotation);
  if (given.interpolation) params.interpolation = to_engine(*given.interpolation);
  if (given.rotate_sh) params.rotate_sh = *given.rotate_sh;
  if (given.seed) params.seed = *given.seed;
  edit::Request settled = drag;
  settled.params = params;
  params.intervals = given.intervals.value_or(preset_intervals(preset, settled));
  return params;
}

}  // namespace

int preset_intervals(proto::Preset preset, const edit::Request& drag) {
  // A part that is drawn out leaves its trail where its intervals end: as many as the length of the drag asks for.
  constexpr int by_length = 0;
  const bool extends = drag.mode == edit::Mode::extend;
  switch (preset) {
    case proto::Preset::preview:
      break;
    case proto::Preset::draft:
      return extends ? by_length : 1;
    case proto::Preset::standard:
      return extends ? by_length : edit::one_interval_is_exact(drag) ? 1 : 4;
    case proto::Preset::paper:
      return 5;
  }
  return by_length;
}

edit::Params preset_params(proto::Preset preset, const edit::Request& drag) {
  edit::Params params;
  if (preset != proto::Preset::paper) params.interpolation = edit::Interpolation::rigid;
  switch (preset) {
    case proto::Preset::preview:
      params.iterations = 0;
      break;
    case proto::Preset::draft:
      params.annealing_steps = 1, params.iterations = 200;
      params.views = 24, params.max_image_side = 384;
      break;
    case proto::Preset::standard:
      params.annealing_steps = 1, params.iterations = 500;
      params.views = 50, params.max_image_side = 512;
      break;
    case proto::Preset::paper:
      params.annealing_steps = 4, params.iterations = 500;
      params.views = 50, params.max_image_side = 512;
      break;
  }
  edit::Request settled = drag;
  settled.params = params;
  params.intervals = preset_intervals(preset, settled);
  return params;
}

proto::Preset preset_of(const proto::EditRequest& request) { return request.preset.value_or(proto::Preset::standard); }

proto::Corrector corrector_of(const proto::EditRequest& request) {
  return request.params.corrector.value_or(preset_of(request) == proto::Preset::preview ? proto::Corrector::none
                                                                                        : proto::Corrector::scene);
}

bool corrects(const proto::EditRequest& request, const edit::Params& params) {
  return params.iterations > 0 && corrector_of(request) != proto::Corrector::none;
}

std::unique_ptr<engine::correct::Corrector> make_corrector(const proto::EditRequest& request) {
  if (corrector_of(request) == proto::Corrector::scene) return std::make_unique<engine::correct::SceneCorrector>();
  return nullptr;
}

engine::Result<edit::Request> to_engine(const proto::EditRequest& request) {
  if (corrector_of(request) == proto::Corrector::sd)
    return engine::fail(engine::ErrorCode::unsupported,
                        "this build has no corrector \"sd\"; available: \"scene\", which is the default, and \"none\"",
                        "params.corrector");
  if (request.params.perceptual == proto::Perceptual::lpips)
    return engine::fail(engine::ErrorCode::unsupported,
                        "this build has no perceptual loss \"lpips\"; available: \"msssim\", which is the default",
                        "params.perceptual");
  if (request.params.background == proto::Background::photo)
    return engine::fail(
        engine::ErrorCode::unsupported,
        "this build does not hold the background to photos; available: \"render\", which is the default",
        "params.background");
  edit::Request out;
  out.mode = to_engine(request.mode);
  for (const proto::Handle& handle : request.handles) {
    edit::Handle& made = out.handles.emplace_back();
    made.source = to_vec(handle.source);
    if (handle.target) made.target = to_vec(*handle.target);
    made.radius = handle.radius;
    made.group = handle.group;
  }
  if (request.region) out.region = {to_vec(request.region->center), to_vec(request.region->size)};
  out.params = to_engine(request.params, preset_of(request), out);
  return out;
}

proto::EditRequest resolved(const proto::EditRequest& asked, const edit::Params& used) {
  proto::EditRequest out = asked;
  out.preset = preset_of(asked);
  out.params.intervals = used.intervals;
  out.params.iterations = used.iterations;
  out.params.annealing_steps = used.annealing_steps;
  out.params.strength_initial = used.strength_initial;
  out.params.strength_final = used.strength_final;
  out.params.annealing = used.annealing == edit::Annealing::paper ? proto::Annealing::paper : proto::Annealing::linear;
  out.params.perceptual = proto::Perceptual::msssim;
  out.params.background = proto::Background::render;
  out.params.views = used.views;
  out.params.exclude_views = used.exclude_views;
  out.params.max_image_side = used.max_image_side;
  out.params.corrector = corrector_of(asked);
  out.params.rotation = to_wire(used.rotation);
  out.params.interpolation = to_wire(used.interpolation);
  out.params.rotate_sh = used.rotate_sh;
  out.params.seed = used.seed;
  return out;
}

std::vector<std::string> fields_without_effect(const proto::EditRequest& request) {
  std::vector<std::string> fields;
  const auto note = [&](bool given, const char* field) {
    if (given) fields.emplace_back(field);
  };
  note(request.prompt.has_value(), "prompt");  // no corrector of this build reads
  const proto::Params& params = request.params;
  if (!corrects(request, to_engine(params, preset_of(request), {}))) {
    note(params.strength_initial.has_value(), "params.strength_initial");
    note(params.strength_final.has_value(), "params.strength_final");
    note(params.annealing.has_value(), "params.annealing");
    note(params.corrector.value_or(proto::Corrector::none) != proto::Corrector::none, "params.corrector");
  }
  return fields;
}

std::vector<std::string> warnings_about(const proto::EditRequest& request) {
  const auto unused = fields_without_effect(request);
  if (unused.empty()) return {};
  std::string warning = "without effect on this edit:";
  for (const std::string& field : unused) warning += " " + field;
  return {std::move(warning)};
}

}  // namespace server::edits
