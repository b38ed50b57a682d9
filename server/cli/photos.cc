#include "server/cli/photos.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/io/image_file.h"
#include "engine/scene/camera.h"

namespace server::cli {
namespace {

namespace fit = engine::fit;
namespace io = engine::io;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;

Result<fit::Photo> load(const io::View& view, int max_side) {
  auto picture = io::load_photo(view);
  if (!picture) return propagate(picture);
  const engine::scene::Camera camera = engine::scene::fit_within(view.camera, max_side);
  if (camera.width != picture->width || camera.height != picture->height) {
    picture = io::resized(*picture, camera.width, camera.height);
    if (!picture) return propagate(picture);
  }
  return fit::to_photo(camera, *picture);
}

}  // namespace

Result<std::vector<fit::Photo>> load_photos(const io::Dataset& dataset, int max_side) {
  const std::vector<io::View>& views = dataset.views;
  if (const auto bare = std::ranges::find_if(views, [](const io::View& v) { return v.photo.empty(); });
      bare != views.end())
    return fail(ErrorCode::not_found, "this dataset has no photos, and a scene is fitted to photos", bare->camera.name);
  std::vector<std::optional<Result<fit::Photo>>> loaded(views.size());
  engine::parallel_for(views.size(), 1, [&](std::size_t i, std::size_t) { loaded[i] = load(views[i], max_side); });
  std::vector<fit::Photo> photos;
  photos.reserve(views.size());
  for (auto& photo : loaded) {
    if (!*photo) return propagate(*photo);
    photos.push_back(std::move(**photo));
  }
  return photos;
}

Result<std::vector<fit::ColoredPoint>> sparse_points_of(const io::Dataset& dataset) {
  std::vector<fit::ColoredPoint> points;
  points.reserve(dataset.points.size());
  for (const io::Point& point : dataset.points) {
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(point.position[axis]) > fit::max_coordinate)
        return fail(ErrorCode::corrupt_data, "this sparse point lies beyond all measure; remove it",
                    "points3D[" + std::to_string(points.size()) + "]." + "xyz"[axis]);
    points.push_back({point.position, point.rgb});
  }
  return points;
}

}  // namespace server::cli
