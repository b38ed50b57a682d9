// The state of an edit, written down: what it takes to go on after a restart.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/edit/state.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::edit {

/// Magic, version, contents, checksum. Of the scene the rows of M alone: the frozen ones are the input's. Masks are
/// packed, one bit a pixel. Of the history the edited pictures alone: the others are the input's.
[[nodiscard]] std::string encode(const State& state);

/// The state that encode() was given, of an edit of this very scene by this very request.
/// A bit that was lost is found, and no length is believed before it is checked.
///   errors  corrupt_data; unsupported: the version of another program; invalid_argument: the state of another edit or
///           scene. `where` is "checkpoint"
[[nodiscard]] Result<State> decode(std::string_view bytes, const scene::GaussianCloud& input, const Request& request);

}  // namespace engine::edit
