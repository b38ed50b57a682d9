#include "server/pictures/photo_comparison.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "engine/io/image_file.h"
#include "server/pictures/pictures.h"

namespace server::pictures {
namespace {

namespace io = engine::io;
using engine::propagate;
using engine::Result;

constexpr double identical_db = 100;  // what equal pictures count as: infinity has no mean

std::string in_db(double db) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << db << " dB";
  return text.str();
}

/// Indices of at most max_compared_photos of `count` things, evenly spread, the first and the last among them.
std::vector<std::size_t> sample(std::size_t count) {
  const std::size_t wanted = std::min(count, max_compared_photos);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(wanted == 1 ? 0 : i * (count - 1) / (wanted - 1));
  return chosen;
}

std::vector<std::string> warnings_about(const PhotoComparison& found, std::size_t photos) {
  std::vector<std::string> warnings;
  if (found.mean_db && *found.mean_db < min_believable_db)
    warnings.push_back("renders reach only " + in_db(*found.mean_db) +
                       " against the photos: the cameras hardly belong to this scene, or live in another frame");
  if (found.compared > 0 && found.compared < photos)
    warnings.push_back("the PSNR is that of " + std::to_string(found.compared) + " of " + std::to_string(photos) +
                       " photos, evenly spread");
  return warnings;
}

}  // namespace

Result<double> psnr_against_photo(const io::View& view, const engine::scene::Image& color,
                                  engine::MemoryBudget* memory) {
  const auto share = engine::take_from(memory, io::photo_memory(view), view.camera.name);
  if (!share) return propagate(share);
  auto photo = io::load_photo(view);
  if (!photo) return propagate(photo);
  if (photo->width != color.width || photo->height != color.height) {
    photo = io::resized(*photo, color.width, color.height);
    if (!photo) return propagate(photo);
  }
  return engine::scene::psnr(clamped(color), *photo);
}

Result<PhotoComparison> compare_with_photos(
    const io::Dataset& dataset, const std::function<Result<engine::scene::Image>(const engine::scene::Camera&)>& render,
    engine::MemoryBudget* memory) {
  std::vector<const io::View*> with_photo;
  for (const io::View& view : dataset.views)
    if (!view.photo.empty()) with_photo.push_back(&view);
  PhotoComparison found;
  std::vector<std::string> unreadable;
  double sum = 0;
  for (const std::size_t i : sample(with_photo.size())) {
    const io::View& view = *with_photo[i];
    const auto color = render(engine::scene::fit_within(view.camera, max_compared_side));
    if (!color) return propagate(color);
    const auto psnr = psnr_against_photo(view, *color, memory);
    if (!psnr) {
      unreadable.push_back("the photo " + view.camera.name + " cannot be read: " + psnr.error().message);
      continue;
    }
    const double db = std::min(*psnr, identical_db);
    sum += db;
    ++found.compared;
    if (!found.worst_db || db < *found.worst_db) found.worst_db = db, found.worst_view = view.camera.name;
  }
  if (found.compared > 0) found.mean_db = sum / double(found.compared);
  found.warnings = warnings_about(found, with_photo.size());
  found.warnings.insert(found.warnings.end(), unreadable.begin(), unreadable.end());
  return found;
}

}  // namespace server::pictures
