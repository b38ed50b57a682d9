#include "engine/repair/survey.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>

#include "engine/correct/corrector.h"
#include "engine/mask/mask.h"
#include "engine/repair/seed.h"
#include "engine/working/footprint.h"

namespace engine::repair {
namespace {

// Share of the part in a pixel from which on its rim may blur what shows there.
constexpr float trace = 0.02f;
constexpr double outlying = 0.01;  // share of rows on either side that may be astray

}  // namespace

std::vector<SpaceView> survey(const render::Layers& now, const scene::GaussianCloud& original,
                              std::span<const std::uint32_t> left, const Witnesses& witnesses,
                              render::Workspace& workspace) {
  const std::vector<scene::Camera>& cameras = witnesses.cameras();
  const std::size_t count = std::min(cameras.size(), most_surveyors);
  render::ForwardOptions options;
  options.depth = true;
  std::vector<SpaceView> views;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t w = k * cameras.size() / count;
    const scene::Camera camera = scene::fit_within(cameras[w], surveyor_side);
    render::Rendering shown;
    render::forward(now, camera, options, {}, workspace, shown);
    const scene::Image share = working::footprint(original, left, camera, workspace);
    SpaceView& view = views.emplace_back(
        SpaceView{camera, scene::Image(camera.width, camera.height, 1), std::move(shown.median_depth),
                  std::move(shown.color), mask::dilate(mask::mask2d(share, trace), mask::blur_radius(camera.height))});
    const scene::Image& before = witnesses.depth()[w];
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        view.before.at(x, y) = before.at(x * before.width / camera.width, y * before.height / camera.height);
        float& depth = view.known.at(x, y);
        // Where the part was, only what another camera has seen beside it is known.
        const bool is_known =
            depth > 0 && shown.alpha.at(x, y) >= correct::trusted &&
            (view.left.at(x, y) == 0 || witnesses.saw(point_at(camera, {x + 0.5, y + 0.5}, 1 / double(depth))));
        if (!is_known) depth = 0;
      }
  }
  return views;
}

Bounds most_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows) {
  assert(!rows.empty());
  Bounds bounds;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const std::uint32_t row : rows) values.push_back(double(cloud.mean.get(row)[axis]));
    const auto last = double(values.size() - 1);
    const auto low = values.begin() + std::ptrdiff_t(outlying * last);
    const auto high = values.begin() + std::ptrdiff_t((1 - outlying) * last);
    std::nth_element(values.begin(), low, values.end());
    bounds.low[axis] = *low;
    std::nth_element(low, high, values.end());
    bounds.high[axis] = *high;
  }
  return bounds;
}

}  // namespace engine::repair
