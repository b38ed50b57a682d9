// What a segmentation tool that never errs would answer, and what a person means who looks at photos.
#pragma once

#include <span>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::captures {

/// The true outlines of what the edit is to move, before it: in each picture the pixels that it is most of.
[[nodiscard]] std::vector<scene::Mask> true_outlines(const CapturedCase& the_case,
                                                     std::span<const scene::Camera> cameras);

}  // namespace engine::captures
