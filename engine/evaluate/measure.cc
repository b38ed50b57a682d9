#include "engine/evaluate/measure.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "engine/mask/mask.h"
#include "engine/neighbours/point_index.h"
#include "engine/optim/losses.h"
#include "engine/optim/picture_view.h"
#include "engine/render/forward.h"
#include "engine/repair/seed.h"
#include "engine/scene/window_sums.h"
#include "engine/working/footprint.h"

namespace engine::evaluate {
namespace {

constexpr double identical_db = 100;  // PSNR that equal pictures count as: infinity has no mean
constexpr int rim_px_at_360 = 4;      // width of the rim around the part at a height of 360 pixels; a choice

scene::Mask shown(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, const scene::Camera& camera) {
  render::Workspace workspace;
  return mask::mask2d(working::footprint(cloud, rows, camera, workspace));
}

double miss(const Case& the_case, const scene::GaussianCloud& result) {
  if (the_case.part_after.empty() || result.size() == 0) return 0;
  const neighbours::PointIndex index(interleaved(result.mean), 3);
  double sum = 0;
  const auto nearest = index.nearest(interleaved(the_case.truth.mean, the_case.part_after), 1);
  for (const neighbours::Neighbour& neighbour : nearest) sum += std::sqrt(double(neighbour.squared_distance));
  return sum / double(nearest.size());
}

/// Sum over these pixels of the squares of what a mean over 3 x 3 pixels has, and one over 9 x 9 has not: single pixels
/// are noise of a camera, and what is larger is no detail.
double fine_structure(const scene::Image& picture, const scene::Mask& counts) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    scene::WindowSums sums(picture.width, picture.height);
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x) sums.add(x, y, double(picture.at(x, y, c)));
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x) {
        if (counts.at(x, y) == 0) continue;
        const double fine = sums.mean_around(x, y, 1) - sums.mean_around(x, y, 4);
        sum += fine * fine;
      }
  }
  return sum;
}

/// 100 where nothing differs.
double psnr_db(double mean_square) {
  return mean_square > 0 ? std::min(-10 * std::log10(mean_square), identical_db) : identical_db;
}

/// What the camera should show.
scene::Image true_picture(const Case& the_case, const scene::Camera& camera) {
  for (const JudgedView& view : the_case.judged)
    if (view.camera.name == camera.name) return view.truth;
  return picture(the_case.truth, camera);
}

/// Depth along the optical axis of what a view shows most of. World units; 0: nothing.
scene::Image true_depth(const scene::GaussianCloud& truth, const scene::Camera& camera) {
  render::ForwardOptions options;
  options.depth = true;
  render::Workspace workspace;
  render::Rendering rendering;
  render::forward(truth, camera, options, {}, workspace, rendering);
  return std::move(rendering.median_depth);
}

DVec3 bilinear(const scene::Image& image, DVec2 pixel) {
  const double x = std::clamp(pixel.x - 0.5, 0.0, image.width - 1.0);
  const double y = std::clamp(pixel.y - 0.5, 0.0, image.height - 1.0);
  const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  DVec3 color;
  for (int c = 0; c < 3; ++c) {
    const double above = std::lerp(double(image.at(x0, y0, c)), double(image.at(x1, y0, c)), x - x0);
    const double below = std::lerp(double(image.at(x0, y1, c)), double(image.at(x1, y1, c)), x - x0);
    color[c] = std::lerp(above, below, y - y0);
  }
  return color;
}

}  // namespace

std::size_t nearest_view(std::span<const scene::Camera> views, std::size_t v) {
  std::size_t nearest = v;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t w = 0; w < views.size(); ++w)
    if (const double far = glm::distance(views[v].centre(), views[w].centre()); far > 0 && far < least)
      least = far, nearest = w;
  return nearest;
}

void RegionQualitySum::add(const scene::Image& result, const scene::Image& truth, const scene::Mask& counts) {
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
  structure_ += fine_structure(result, counts), true_structure_ += fine_structure(truth, counts);
  pixels_ += area;
}

RegionQuality RegionQualitySum::quality() const {
  if (pixels_ == 0) return {};
  RegionQuality quality{psnr_db(squares_ / double(pixels_)), 1 - dissimilarity_ / double(pixels_), pixels_, {}};
  constexpr double one_color = 1e-6;  // over three channels, a seventh of a step of 255 each: what is less is rounding
  if (true_structure_ > one_color * double(pixels_)) quality.detail = std::sqrt(structure_ / true_structure_);
  return quality;
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

JudgedRegions judged_regions(RowsOf before, RowsOf after, const scene::Camera& camera) {
  JudgedRegions kinds;
  kinds.arrived = shown(after.cloud, after.rows, camera);
  kinds.vacated = shown(before.cloud, before.rows, camera);
  scene::Mask both = kinds.arrived;
  mask::unite(both, kinds.vacated);
  kinds.edited = mask::dilate(both, std::max(1, rim_px_at_360 * camera.height / 360));
  for (std::size_t i = 0; i < kinds.vacated.data.size(); ++i)
    if (kinds.arrived.data[i] != 0) kinds.vacated.data[i] = 0;
  kinds.outside = complement(kinds.edited);
  return kinds;
}

JudgedRegions judged_regions(const Case& the_case, const scene::Camera& camera) {
  return judged_regions({the_case.before, the_case.part_before}, {the_case.truth, the_case.part}, camera);
}

JudgedViews::JudgedViews(const Case& the_case) : case_(the_case) {
  if (!the_case.judged.empty()) return;
  for (const scene::Camera& camera : the_case.held_out)
    rendered_.push_back({camera, picture(the_case.truth, camera), judged_regions(the_case, camera)});
}

Quality judge(std::span<const JudgedView> views, const scene::GaussianCloud& result) {
  RegionQualitySum edited, vacated, arrived, outside;
  for (const JudgedView& view : views) {
    const scene::Image is = picture(result, view.camera);
    edited.add(is, view.truth, view.regions.edited);
    vacated.add(is, view.truth, view.regions.vacated);
    arrived.add(is, view.truth, view.regions.arrived);
    outside.add(is, view.truth, view.regions.outside);
  }
  return {edited.quality(), vacated.quality(), arrived.quality(), outside.quality(), 0};
}

Quality judge(const JudgedViews& views, const scene::GaussianCloud& result) {
  Quality quality = judge(views.all(), result);
  quality.miss = miss(views.of(), result);
  return quality;
}

Result<double> perceptual_distance(std::span<const JudgedView> views, const scene::GaussianCloud& result,
                                   optim::PerceptualLoss& loss) {
  double sum = 0;
  std::size_t seen = 0;
  scene::Image unused;
  for (const JudgedView& view : views) {
    const scene::Mask& region = view.regions.edited;
    if (region.area() == 0) continue;
    scene::Image is = picture(result, view.camera);
    for (int c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < region.data.size(); ++i)
        if (region.data[i] == 0) is.plane(c)[i] = view.truth.plane(c)[i];
    const scene::Rect box = scene::bounding_box(region);
    const auto distance = loss.evaluate(scene::cut_out(is, box), scene::cut_out(view.truth, box), unused);
    if (!distance) return distance;
    sum += *distance;
    ++seen;
  }
  return seen > 0 ? sum / double(seen) : 0;
}

Agreement agreement(const Case& the_case, std::span<const scene::Camera> views,
                    std::span<const scene::Image> pictures) {
  constexpr double same_surface = 0.01;  // relative difference of depths; a choice
  if (views.size() < 2) return {};
  std::vector<scene::Image> depth;
  for (const scene::Camera& view : views) depth.push_back(true_depth(the_case.truth, view));
  Agreement out;
  double squares = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::size_t w = nearest_view(views, v);
    const scene::Camera &from = views[v], &to = views[w];
    const scene::Mask vacated = judged_regions(the_case, from).vacated;
    for (int y = 0; y < from.height; ++y)
      for (int x = 0; x < from.width; ++x) {
        const double z = double(depth[v].at(x, y));
        if (vacated.at(x, y) == 0 || z <= 0) continue;
        const DVec3 there = to.cam_from_world(repair::point_at(from, DVec2(x + 0.5, y + 0.5), 1 / z));
        if (there.z <= 0) continue;
        const DVec2 pixel = to.pixel_from_cam(there);
        if (pixel.x < 0 || pixel.y < 0 || pixel.x >= to.width || pixel.y >= to.height) continue;
        if (std::abs(double(depth[w].at(int(pixel.x), int(pixel.y))) - there.z) > same_surface * there.z) continue;
        const DVec3 shown(pictures[v].at(x, y, 0), pictures[v].at(x, y, 1), pictures[v].at(x, y, 2));
        const DVec3 difference = shown - bilinear(pictures[w], pixel);
        squares += glm::dot(difference, difference) / 3;
        ++out.pixels;
      }
  }
  if (out.pixels > 0) out.psnr_db = psnr_db(squares / double(out.pixels));
  return out;
}

scene::Image comparison(const Case& the_case, const scene::GaussianCloud& deformed, const scene::GaussianCloud& result,
                        const scene::Camera& camera) {
  const scene::Image truth = true_picture(the_case, camera), is = picture(result, camera);
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
