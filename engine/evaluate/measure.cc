#include "engine/evaluate/measure.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/edit/footprint.h"
#include "engine/mask/mask.h"
#include "engine/neighbours/point_index.h"
#include "engine/optim/losses.h"
#include "engine/optim/picture_view.h"
#include "engine/render/forward.h"

namespace engine::evaluate {
namespace {

constexpr double identical_db = 100;
constexpr int rim_px_at_360 = 4;

scene::Mask shown(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, const scene::Camera& camera) {
  render::Workspace workspace;
  return mask::mask2d(edit::footprint(cloud, rows, camera, workspace));
}

double miss(const Case& the_case, const scene::GaussianCloud& result) {
  if (the_case.part_after.empty() || result.size() == 0) return 0;
  const auto positions = [](const scene::GaussianCloud& cloud, const auto& rows) {
    std::vector<float> out;
    for (const auto row : rows)
      for (int axis = 0; axis < 3; ++axis) out.push_back(cloud.mean.get(row)[axis]);
    return out;
  };
  std::vector<std::uint32_t> all(result.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = std::uint32_t(i);
  const neighbours::PointIndex index(positions(result, all), 3);
  double sum = 0;
  const auto nearest = index.nearest(positions(the_case.truth, the_case.part_after), 1);
  for (const neighbours::Neighbour& neighbour : nearest) sum += std::sqrt(double(neighbour.squared_distance));
  return sum / double(nearest.size());
}

}  // namespace

void LikenessSum::add(const scene::Image& result, const scene::Image& truth, const scene::Mask& counts) {
  const std::size_t area = counts.area();
  if (area == 0) return;
  for (int c = 0; c < 3; ++c) {
    const auto a = result.plane(c), b = truth.plane(c);
    for (std::size_t i = 0; i < a.size(); ++i)
      if (counts.data[i] != 0) squares_ += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i])) / 3;
  }
  const scene::Mask ignored = complement(counts);
  optim::LossWorkspace workspace;
  scene::Image gradient(result.width, result.height, 3);
  // A mean over the whole picture, in which pixels that do not count are alike.
  const std::size_t all = counts.data.size();
  dissimilarity_ += double(all) * optim::ssim_loss(optim::view(result), optim::view(truth), optim::view(ignored), all,
                                                   0, workspace, optim::view(gradient));
  pixels_ += area;
}

Likeness LikenessSum::likeness() const {
  if (pixels_ == 0) return {};
  const double mean = squares_ / double(pixels_);
  return {mean > 0 ? std::min(-10 * std::log10(mean), identical_db) : identical_db,
          1 - dissimilarity_ / double(pixels_), pixels_};
}

scene::Image picture(const scene::GaussianCloud& cloud, const scene::Camera& camera) {
  scene::Image image = render::forward(cloud, camera).color;
  for (float& value : image.data) value = std::clamp(value, 0.0f, 1.0f);
  return image;
}

scene::Mask complement(scene::Mask mask) {
  for (std::uint8_t& flag : mask.data) flag = flag == 0;
  return mask;
}

Kinds kinds_of(const Case& the_case, const scene::Camera& camera) {
  Kinds kinds;
  kinds.arrived = shown(the_case.truth, the_case.part, camera);
  kinds.vacated = shown(the_case.before, the_case.part_before, camera);
  scene::Mask both = kinds.arrived;
  mask::unite(both, kinds.vacated);
  kinds.edited = mask::dilate(both, std::max(1, rim_px_at_360 * camera.height / 360));
  for (std::size_t i = 0; i < kinds.vacated.data.size(); ++i)
    if (kinds.arrived.data[i] != 0) kinds.vacated.data[i] = 0;
  return kinds;
}

Quality judge(const Case& the_case, const scene::GaussianCloud& result) {
  LikenessSum edited, vacated, arrived, outside;
  for (const scene::Camera& camera : the_case.held_out) {
    const Kinds kinds = kinds_of(the_case, camera);
    const scene::Image is = picture(result, camera), should_be = picture(the_case.truth, camera);
    edited.add(is, should_be, kinds.edited);
    vacated.add(is, should_be, kinds.vacated);
    arrived.add(is, should_be, kinds.arrived);
    outside.add(is, should_be, complement(kinds.edited));
  }
  return {edited.likeness(), vacated.likeness(), arrived.likeness(), outside.likeness(), miss(the_case, result)};
}

scene::Image comparison(const Case& the_case, const scene::GaussianCloud& deformed, const scene::GaussianCloud& result,
                        const scene::Camera& camera) {
  const scene::Image truth = picture(the_case.truth, camera), is = picture(result, camera);
  scene::Image difference(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < difference.data.size(); ++i)
    difference.data[i] = std::min(1.0f, 4 * std::abs(is.data[i] - truth.data[i]));
  const std::vector<scene::Image> panels{picture(the_case.before, camera), picture(deformed, camera), is, truth,
                                         difference};
  scene::Image out(camera.width * int(panels.size()), camera.height, 3);
  for (std::size_t p = 0; p < panels.size(); ++p)
    for (int c = 0; c < 3; ++c)
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) out.at(int(p) * camera.width + x, y, c) = panels[p].at(x, y, c);
  return out;
}

}  // namespace engine::evaluate
