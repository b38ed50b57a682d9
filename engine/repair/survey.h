// What cameras tell of the space that a part has left.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/forward.h"
#include "engine/repair/closure.h"
#include "engine/repair/witnesses.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::repair {

/// Cameras that are asked at most, an even choice of the witnesses, and pixels of the longer side of their pictures: a
/// choice. Each keeps six numbers a pixel, some 80 MB in all.
constexpr std::size_t most_surveyors = 48;
constexpr int surveyor_side = 320;

/// Two forward passes for each camera.
///   now        the scene without the part, and without what nobody has seen
///   original   the scene with the part
///   left       its rows whose place is empty now
///   witnesses  of the original
[[nodiscard]] std::vector<SpaceView> survey(const render::Layers& now, const scene::GaussianCloud& original,
                                            std::span<const std::uint32_t> left, const Witnesses& witnesses,
                                            render::Workspace& workspace);

/// A box that holds 98 of 100 of these rows along each axis. Precondition: there is one.
[[nodiscard]] Bounds most_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows);

}  // namespace engine::repair
