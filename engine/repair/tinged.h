// Rows that a part has tinged: around its blurred outline every picture shows a mixture, and a trainer makes up for it
// in the colours of what is behind. Beside a red can cloth is cyan, which shows as a ring where the can has gone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/gaussian_cloud.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::WorkingScene;

/// A tinged row takes on the mean colour of so many: a choice. The mean of 10 or 20 blurs what is drawn on a wall.
constexpr std::size_t colors_alike = 4;

/// Rows around a row whose colours are nearest to its own.
using Like = std::array<std::uint32_t, colors_alike>;

struct Tinged {
  std::vector<std::uint32_t> rows;  ///< Ascending.
  std::vector<Like> like;           ///< [rows]
};

/// Those of some rows whose colour nothing around them has. What is drawn on a wall it has elsewhere, too.
///   rows         that may be tinged, ascending
///   known        that are not: nothing is found where these are fewer than `colors_alike`
///   shade_stays  what has a colour of those around it, but darker, is not tinged either
[[nodiscard]] Tinged tinged_among(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows,
                                  std::span<const std::uint32_t> known, bool shade_stays);

/// Each of these rows that stays gets the mean of its like's colours as they are by now, all bands (Role::relit).
void recolour(WorkingScene& working, const Tinged& tinged);

}  // namespace engine::repair
