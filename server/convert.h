// Between the edit request on the wire and the one the engine runs.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/procedural/demo_scene.h"
#include "proto/edit_request.h"

namespace server {

/// The engine's request, with what was left open filled in from the preset, then from the engine's defaults.
///   errors  unsupported: a corrector this build does not have (`where` is "params.corrector")
[[nodiscard]] engine::Result<engine::edit::Request> to_engine(const proto::EditRequest& request);

/// The request as it was carried out: `asked`, with every parameter that the edit used filled in.
[[nodiscard]] proto::EditRequest resolved(const proto::EditRequest& asked, const engine::edit::Params& used);

/// Fields of the request that concern correction and optimisation, which this build does not do: given, but without
/// effect.
[[nodiscard]] std::vector<std::string> fields_without_effect(const proto::EditRequest& request);

/// A suggested drag as the request that carries it out.
[[nodiscard]] proto::EditRequest to_request(const engine::procedural::SuggestedDrag& drag);

}  // namespace server
