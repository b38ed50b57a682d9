// Renders held against photos: whether a scene and its cameras share a frame.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/dataset.h"
#include "engine/scene/image.h"

namespace server::pictures {

/// PSNR in dB of a rendering of the view against its photo, which is scaled to the rendering's size.
///   errors  those of io::load_photo()
[[nodiscard]] engine::Result<double> psnr_against_photo(const engine::io::View& view, const engine::scene::Image& color,
                                                        engine::MemoryBudget* memory = nullptr);

// The three are choices, not measurements: 64 photos of this size take a few seconds to compare.
constexpr std::size_t max_compared_photos = 64;
constexpr int max_compared_side = 512;    ///< Pixels, of the longer side.
constexpr double min_believable_db = 15;  ///< PSNR; with less, cameras and scene hardly share a frame.

/// How near renders come to the photos: PSNR over each photo.
struct PhotoComparison {
  std::size_t compared = 0;                 ///< Count of photos.
  std::optional<double> mean_db, worst_db;  ///< None if no photo could be compared.
  std::string worst_view;
  std::vector<std::string> warnings;  ///< What a user should know, one sentence each.
};

/// Compares at most max_compared_photos of the dataset's photos, evenly spread over its views.
///   render  colours through a camera
///   memory  lends what decoding a photo takes; null: nobody counts it
///   errors  those of `render`; a photo that cannot be read is a warning
[[nodiscard]] engine::Result<PhotoComparison> compare_with_photos(
    const engine::io::Dataset& dataset,
    const std::function<engine::Result<engine::scene::Image>(const engine::scene::Camera&)>& render,
    engine::MemoryBudget* memory = nullptr);

}  // namespace server::pictures
