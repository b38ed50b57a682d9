// Conversion between the edit request on the wire and the one that the engine runs: for the program and the service
// alike.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/correct/repainter.h"
#include "engine/edit/edit.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"
#include "engine/optim/perceptual.h"
#include "proto/edit_request.h"
#include "proto/edit_status.h"
#include "server/models/models.h"

namespace server::edits {

/// Every parameter: what is given, else what the preset says (engine/params/params.h).
///   drag          its mode and handles, on which intervals and interpolation depend; its own parameters do not count
///   is_selection  a selection says what moves, whether or not the drag has its rows already
[[nodiscard]] engine::edit::Params filled_in(const proto::Params& given, proto::Preset preset,
                                             const engine::edit::Request& drag, bool is_selection);
/// The parameters that a preset alone stands for.
[[nodiscard]] engine::edit::Params preset_params(proto::Preset preset, const engine::edit::Request& drag = {});

/// The preset of a request: `standard` if it names none.
[[nodiscard]] proto::Preset preset_of(const proto::EditRequest& request);

/// The corrector of a request: that of its preset if it names none.
[[nodiscard]] proto::Corrector corrector_of(const proto::EditRequest& request);

/// Does this edit use a corrector? A corrector works for the optimisation only.
[[nodiscard]] bool uses_corrector(const engine::edit::Params& params);

/// Is that a diffusion model?
[[nodiscard]] bool uses_diffusion(const engine::edit::Params& params);

/// Does its loss compare pictures by a network?
[[nodiscard]] bool uses_lpips(const engine::edit::Params& params);

/// What one edit works with, by its request.
struct Toolbox {
  std::unique_ptr<engine::correct::Corrector> corrector;      ///< Null: `none`.
  std::unique_ptr<engine::correct::Repainter> repainter;      ///< Null: the corrector corrects.
  std::unique_ptr<engine::optim::PerceptualLoss> perceptual;  ///< Null: the engine's own.
  engine::edit::RepaintTime repaint_time = {};
  double perceptual_pixel_seconds = 0;

  [[nodiscard]] engine::edit::Tools tools() const;
};

/// Makes what the request names.
///   params  of to_engine(request)
///   models  null: there are none
///   errors  as available(); those of Models, where a model cannot be used after all
[[nodiscard]] engine::Result<Toolbox> make_toolbox(const proto::EditRequest& request,
                                                   const engine::edit::Params& params, const models::Models* models);

/// What the models that the request names take.
///   params  of to_engine(request)
///   models  null: there are none
[[nodiscard]] models::Costs costs_of(const proto::EditRequest& request, const engine::edit::Params& params,
                                     const models::Models* models);
/// How long a repainter takes, for plans.
[[nodiscard]] engine::edit::RepaintTime repaint_time_of(const models::RepainterCost& cost);

/// Are the corrector, its adapter and the perceptual loss that the request names to be had?
///   params  of to_engine(request)
///   models  null: there are none
///   errors  unsupported: no (`where` is "params.corrector", say), and what it takes
[[nodiscard]] engine::Result<void> available(const proto::EditRequest& request, const engine::edit::Params& params,
                                             const models::Models* models);

/// The engine's request, with what was left open filled in from the preset. Of a selection it says nothing yet, and
/// radii that are left to one are 0: see hand_over(). Whether models that it names are there says available().
///   errors  unsupported: a background that this build has not
[[nodiscard]] engine::Result<engine::edit::Request> to_engine(const proto::EditRequest& request);

/// The request as it was carried out: `request` with every parameter that the edit used filled in, and the radius of
/// every handle. Parameters of a diffusion model are there if it uses one.
///   handles  those used, if they are known; a radius of 0 is not
[[nodiscard]] proto::EditRequest resolved(const proto::EditRequest& request, const engine::edit::Params& used,
                                          const std::vector<engine::edit::Handle>& handles = {});

/// How each group moves, for clients.
[[nodiscard]] std::vector<proto::Part> to_parts(const std::vector<engine::edit::Attachment>& attachments);

/// What views show of the place that a part has left, for clients.
[[nodiscard]] std::vector<proto::Uncovered> to_uncovered(const std::vector<engine::edit::Uncovered>& views);

/// Fields of the request that are given, but without effect on this edit.
[[nodiscard]] std::vector<std::string> fields_without_effect(const proto::EditRequest& request);

/// What a user should know about the request itself, one sentence each: that it has such fields.
[[nodiscard]] std::vector<std::string> warnings_about(const proto::EditRequest& request);

}  // namespace server::edits
