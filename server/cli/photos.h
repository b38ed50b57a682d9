// Photos of a dataset as fits take them.
#pragma once

#include <vector>

#include "engine/core/result.h"
#include "engine/fit/photo.h"
#include "engine/fit/start.h"
#include "engine/io/dataset.h"

namespace server::cli {

/// The photo of each view, the longer side at most max_side pixels. In order of the views.
///   errors  not_found, `where` is its name: a view without a photo; those of io::load_photo()
[[nodiscard]] engine::Result<std::vector<engine::fit::Photo>> load_photos(const engine::io::Dataset& dataset,
                                                                          int max_side);

/// Its sparse points.
///   errors  corrupt_data, `where` = "points3D[12].x": one lies beyond fit::max_coordinate
[[nodiscard]] engine::Result<std::vector<engine::fit::ColoredPoint>> sparse_points_of(
    const engine::io::Dataset& dataset);

}  // namespace server::cli
