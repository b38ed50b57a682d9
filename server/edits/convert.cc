#include "server/edits/convert.h"

#include <algorithm>
#include <utility>

#include "engine/correct/scene_corrector.h"
#include "engine/edit/handles.h"
#include "server/edits/points.h"

namespace server::edits {

namespace edit = engine::edit;

static_assert(proto::max_handles == edit::max_handles && proto::max_coordinate == edit::max_coordinate);

edit::Params filled_in(const proto::Params& given, proto::Preset preset, const edit::Request& drag, bool is_selection) {
  edit::Request settled = drag;
  settled.params = engine::params::filled_in(given, preset);
  engine::params::DragKind kind{.extends = drag.mode == edit::Mode::extend, .selected = is_selection};
  kind.turns = drag.attach != edit::Attach::automatic ||
               std::ranges::any_of(drag.handles, [](const auto& handle) { return handle.rotation || handle.scale; });
  if (!given.interpolation) settled.params.interpolation = engine::params::preset_interpolation(preset, kind);
  kind.one_piece = edit::one_interval_is_exact(settled);
  if (!given.intervals) settled.params.intervals = engine::params::preset_intervals(preset, kind);
  return settled.params;
}

edit::Params preset_params(proto::Preset preset, const edit::Request& drag) {
  return filled_in({}, preset, drag, drag.selected.has_value());
}

proto::Preset preset_of(const proto::EditRequest& request) { return request.preset.value_or(proto::Preset::standard); }

proto::Corrector corrector_of(const proto::EditRequest& request) {
  return engine::params::filled_in(request.params, preset_of(request)).corrector;
}

bool uses_corrector(const edit::Params& params) {
  return params.iterations > 0 && params.corrector != proto::Corrector::none;
}

bool uses_diffusion(const edit::Params& params) {
  return params.iterations > 0 && params.corrector == proto::Corrector::sd;
}

bool uses_lpips(const edit::Params& params) {
  return params.iterations > 0 && params.perceptual == proto::Perceptual::lpips;
}

edit::Tools Toolbox::tools() const {
  return {corrector.get(), perceptual.get(), repainter.get(), repaint_time, perceptual_pixel_seconds};
}

models::Costs costs_of(const proto::EditRequest& request, const edit::Params& params, const models::Models* models) {
  models::Costs costs;
  if (models == nullptr) return costs;
  if (uses_diffusion(params)) costs.repainter = models->cost(params, request.lora.value_or(""));
  if (uses_lpips(params)) costs.perceptual = models->lpips_cost();
  return costs;
}

edit::RepaintTime repaint_time_of(const models::RepainterCost& cost) {
  return {cost.training_step, cost.picture, cost.full_strength};
}

engine::Result<Toolbox> make_toolbox(const proto::EditRequest& request, const edit::Params& params,
                                     const models::Models* models) {
  if (auto all = available(request, params, models); !all) return engine::propagate(all);
  Toolbox box;
  // What a diffusion model repaints is completed by patches before.
  if (params.corrector != proto::Corrector::none) box.corrector = std::make_unique<engine::correct::SceneCorrector>();
  if (uses_diffusion(params)) {
    auto repainter = models->repainter(
        params, {request.prompt.value_or(""), request.negative_prompt.value_or(""), request.lora.value_or("")});
    if (!repainter) return engine::propagate(repainter);
    box.repainter = std::move(*repainter);
  }
  if (uses_lpips(params)) {
    auto loss = models->lpips();
    if (!loss) return engine::propagate(loss);
    box.perceptual = std::move(*loss);
  }
  const models::Costs costs = costs_of(request, params, models);
  if (costs.repainter) box.repaint_time = repaint_time_of(*costs.repainter);
  if (costs.perceptual) box.perceptual_pixel_seconds = costs.perceptual->pixel_seconds;
  return box;
}

engine::Result<void> available(const proto::EditRequest& request, const edit::Params& params,
                               const models::Models* models) {
  const auto unsupported = [](const std::string& message, const char* where) {
    return engine::fail(engine::ErrorCode::unsupported, message, where);
  };
  const models::Models none;
  const models::Models& there_are = models != nullptr ? *models : none;
  if (params.corrector == proto::Corrector::sd && !there_are.no_sd().empty())
    return unsupported("there is no corrector \"sd\" here: " + there_are.no_sd() +
                           "; available: \"scene\", which is the default, and \"none\"",
                       "params.corrector");
  if (uses_diffusion(params) && !request.lora.value_or("").empty()) {
    const std::vector<std::string> loras = there_are.loras();
    if (std::ranges::find(loras, *request.lora) == loras.end()) {
      std::string names;
      for (const std::string& name : loras) names += (names.empty() ? "\"" : ", \"") + name + '"';
      return unsupported("there is no adapter \"" + *request.lora + "\" that can be used here" +
                             (names.empty() ? "" : "; available: " + names) +
                             "; \"splatdrag models\" says which files go where, and what is wrong with them",
                         "lora");
    }
  }
  if (params.perceptual == proto::Perceptual::lpips && !there_are.no_lpips().empty())
    return unsupported("there is no perceptual loss \"lpips\" here: " + there_are.no_lpips() +
                           "; available: \"msssim\", which is the default",
                       "params.perceptual");
  return {};
}

engine::Result<edit::Request> to_engine(const proto::EditRequest& request) {
  edit::Request out;
  out.mode = request.mode;
  for (const proto::Handle& handle : request.handles) {
    edit::Handle& to = out.handles.emplace_back();
    to.source = to_vec(handle.source);
    if (handle.target) to.target = to_vec(*handle.target);
    to.radius = handle.radius.value_or(0);
    to.group = handle.group;
    if (handle.rotation) {
      const auto& [w, x, y, z] = *handle.rotation;
      to.rotation = engine::DQuat(w, x, y, z);
    }
    to.scale = handle.scale;
  }
  out.attach = request.attach.value_or(edit::Attach::automatic);
  out.crumbs = request.crumbs.value_or(edit::Crumbs::move);
  out.shadow = request.shadow.value_or(edit::ShadowOfPart::move);
  out.settle = request.settle.value_or(edit::Settle::automatic);
  if (request.region) out.region = {to_vec(request.region->center), to_vec(request.region->size)};
  out.params = filled_in(request.params, preset_of(request), out, request.selection.has_value());
  if (out.params.background == proto::Background::photo)
    return engine::fail(
        engine::ErrorCode::unsupported,
        "this build does not hold the background to photos; available: \"render\", which is the default",
        "params.background");
  return out;
}

proto::EditRequest resolved(const proto::EditRequest& request, const edit::Params& used,
                            const std::vector<edit::Handle>& handles) {
  proto::EditRequest out = request;
  out.preset = preset_of(request);
  out.params = engine::params::as_given(used);
  if (!uses_diffusion(used))
    engine::params::for_each_parameter([&](const auto& parameter) {
      if (parameter.part == engine::params::Part::diffusion) (out.params.*parameter.given).reset();
    });
  for (std::size_t h = 0; h < std::min(out.handles.size(), handles.size()); ++h)
    if (handles[h].radius > 0) out.handles[h].radius = handles[h].radius;
  return out;
}

std::vector<proto::Part> to_parts(const std::vector<edit::Attachment>& attachments) {
  std::vector<proto::Part> parts;
  for (const edit::Attachment& one : attachments)
    parts.push_back({one.group, std::string(engine::name_of(one.how)), one.why, one.settled});
  return parts;
}

std::vector<proto::Uncovered> to_uncovered(const std::vector<edit::Uncovered>& views) {
  std::vector<proto::Uncovered> out;
  for (const edit::Uncovered& view : views) {
    proto::Uncovered& shown = out.emplace_back(proto::Uncovered{view.view, view.area, view.open, {}});
    if (view.open > 0) shown.open_box = std::array{view.open_from.x, view.open_from.y, view.open_to.x, view.open_to.y};
  }
  return out;
}

std::vector<std::string> fields_without_effect(const proto::EditRequest& request) {
  std::vector<std::string> fields;
  const edit::Params params = engine::params::filled_in(request.params, preset_of(request));
  const bool paints = uses_diffusion(params), corrects = uses_corrector(params);
  if (!paints && request.prompt) fields.emplace_back("prompt");
  if (!paints && request.negative_prompt) fields.emplace_back("negative_prompt");
  if (!paints && request.lora) fields.emplace_back("lora");
  if (request.attach && request.mode == proto::Mode::remove) fields.emplace_back("attach");  // nothing of it stays
  if (!corrects && request.heal) fields.emplace_back("heal");
  proto::Params given = request.params;
  if (given.corrector == proto::Corrector::none) given.corrector.reset();  // that was its effect
  engine::params::for_each_parameter([&](const auto& parameter) {
    const bool is_idle = (parameter.part == engine::params::Part::correction && !corrects) ||
                         (parameter.part == engine::params::Part::diffusion && !paints);
    if (is_idle && given.*parameter.given) fields.push_back("params." + std::string(parameter.name));
  });
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
