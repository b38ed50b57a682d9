// Rows that a part has kept the light from, or that it keeps it from where it arrives.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/repair/shadow.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::WorkingScene;

/// Rows in another light.
struct Relit {
  std::vector<std::uint32_t> rows;  ///< Ascending.
  std::vector<Vec3> light;          ///< [rows] Factors of their colours, by channel; above 0.
};

/// The rows that the shadow leaves, and those that it falls on anew where the part takes it along.
/// Not those that are too large to lie in a shadow, or too faint to be seen.
///   scene  that the shadow was found in
///   part   rows that have none, ascending
///   back   where what is at a point around the part as it arrives would have been around it before, world units;
///          empty: the shadow goes, and arrives nowhere
[[nodiscard]] Relit relit_rows(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                               const Shadow& shadow, const std::function<DVec3(DVec3)>& back);

/// Each of these rows that stays gets colours of the new light (Role::relit).
///   returns  how many
std::size_t relight(WorkingScene& working, const Relit& relit);

}  // namespace engine::repair
