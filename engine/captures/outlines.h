// What pictures of a case show of some of its Gaussians: what a person sees, and what a segmentation tool would answer.
#pragma once

#include <cstdint>
#include <span>

#include "engine/captures/captured_case.h"
#include "engine/render/forward.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::captures {

/// The pixels that marked rows are most of.
///   marks  [cloud.size()], 1 for marked ones
[[nodiscard]] scene::Mask shown(const scene::GaussianCloud& cloud, std::span<const std::uint8_t> marks,
                                const scene::Camera& camera, render::Workspace& workspace);

/// The true outline of what the edit is to move, before it.
[[nodiscard]] scene::Mask true_outline(const CapturedCase& the_case, const scene::Camera& camera,
                                       render::Workspace& workspace);

}  // namespace engine::captures
