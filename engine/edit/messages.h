// What an edit says to its user, wherever it is said. In sentences handles count from 1, as on the page; in addresses
// (`where`) from 0, as in the request.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/edit/report.h"

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

/// An anchor of an elastic body that grips nothing of it.
[[nodiscard]] std::string anchor_is_idle(std::size_t handle);
/// A handle of one that lies far from all of it.
///   away  world units
[[nodiscard]] std::string handle_is_astray(std::size_t handle, double away);

}  // namespace engine::edit
