// What an edit says to its user, wherever it is said. In sentences handles count from 1, as on the page; in addresses
// (`where`) from 0, as in the request.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/edit/parts.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"

namespace engine::edit {

[[nodiscard]] std::string nothing_moves();
[[nodiscard]] std::string no_view_sees_it();
[[nodiscard]] std::string no_view_to_exclude(const std::string& name);
[[nodiscard]] std::string handle_lost(std::size_t handle, int interval);  ///< handle: from 0
[[nodiscard]] std::string outskirts_go(std::size_t backing, std::size_t buried);
[[nodiscard]] std::string faint_left_out(std::size_t copies);
/// unprocessable, `where` is "handles".
[[nodiscard]] Error leaves_nothing();

/// What could not be completed of what a part has left. Empty: hardly anything.
[[nodiscard]] std::string left_open(std::span<const Uncovered> views);

/// What people should know of the parts before they move: anchors that hold nothing, handles far from all that they
/// move, and parts that come off what they grow out of.
[[nodiscard]] std::vector<std::string> warnings_of(const Parts& parts);

/// Handles of parts that are held which end farther from their targets than anyone overlooks, in parts of the longest
/// way of their group: what is held stretches only so far. Those that turn or scale are passed over.
///   positions  of the handles at the end, world units
[[nodiscard]] std::vector<std::string> handles_stop_short(const Request& request, const Parts& parts,
                                                          std::span<const DVec3> positions);

}  // namespace engine::edit
