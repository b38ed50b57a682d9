// Between the edit request on the wire and the one the engine runs: for the program and the service alike.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "proto/edit_request.h"

namespace server::edits {

/// The engine's request, with what was left open filled in from the preset, then from the engine's defaults.
///   errors  unsupported: a corrector, perceptual loss or background this build does not have (`where` is
///           "params.corrector")
[[nodiscard]] engine::Result<engine::edit::Request> to_engine(const proto::EditRequest& request);

/// The request as it was carried out: `asked`, with every parameter that the edit used filled in.
[[nodiscard]] proto::EditRequest resolved(const proto::EditRequest& asked, const engine::edit::Params& used);

/// Fields of the request that concern correction, which this build does not do: given, but without
/// effect.
[[nodiscard]] std::vector<std::string> fields_without_effect(const proto::EditRequest& request);

/// What a user should know about the request itself, one sentence each: that it has such fields.
[[nodiscard]] std::vector<std::string> warnings_about(const proto::EditRequest& request);

}  // namespace server::edits
