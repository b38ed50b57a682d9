// Cameras as a COLMAP text model, which splat trainers and viewers read.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace server::cli {

/// Writes cameras.txt, images.txt and points3D.txt into `folder`, which exists. Each view is a PINHOLE camera of its
/// own; poses carry enough digits to come back the same. The points are a sample of the Gaussians, for programs that
/// start from points.
///   errors  those of AtomicFile
[[nodiscard]] engine::Result<void> write_colmap_text(const std::filesystem::path& folder,
                                                     const std::vector<engine::scene::Camera>& views,
                                                     const engine::scene::GaussianCloud& cloud,
                                                     std::size_t max_points = 20'000);

}  // namespace server::cli
