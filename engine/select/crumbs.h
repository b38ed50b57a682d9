// What a selection has left out of the part that it means.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/overlay.h"

namespace engine::select {

/// Crumbs: rows that are not selected, and belong to the part nevertheless. A corner of another colour, fringe in the
/// air. They come in small pieces, each of which hangs together by its looks, by its looks with nothing that stays, and
/// which touches the selection with a good deal of its border. Rows larger than those of the part are none: what a
/// trainer blew up covers more than the part.
/// As long as contact_of(), and half as long again.
///   selected  ascending, of the scene; with none there are no crumbs
///   returns   ascending
[[nodiscard]] std::vector<std::uint32_t> crumbs_of(const scene::LayeredCloud& scene,
                                                   std::span<const std::uint32_t> selected);

}  // namespace engine::select
