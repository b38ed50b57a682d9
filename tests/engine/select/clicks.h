// Clicks on a thing of a made-up scene, as a person makes them: some on it, some around it, and how well what was
// selected is the thing.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "engine/render/pick.h"
#include "engine/render/project.h"
#include "engine/select/operation.h"

namespace engine::select {

/// The pixels of which a camera shows mostly the object.
inline scene::Mask pixels_of(const procedural::DemoScene& demo, std::size_t object, const scene::Camera& camera) {
  std::vector<float> weight(demo.cloud.size());
  for (std::size_t row = 0; row < weight.size(); ++row) weight[row] = demo.object[row] == object ? 1.0f : 0.0f;
  const render::Rendering rendering = render::forward(demo.cloud, camera, {.color = false}, weight);
  scene::Mask mask(camera.width, camera.height);
  for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = rendering.weight.data[i] > 0.5f;
  return mask;
}

/// The pixels around which, `radius` in each direction, all are set.
inline std::vector<DVec2> well_inside(const scene::Mask& mask, int radius) {
  std::vector<DVec2> out;
  for (int y = radius; y + radius < mask.height; ++y)
    for (int x = radius; x + radius < mask.width; ++x) {
      bool all = true;
      for (int v = y - radius; v <= y + radius && all; ++v)
        for (int u = x - radius; u <= x + radius && all; ++u) all = mask.at(u, v) != 0;
      if (all) out.emplace_back(x + 0.5, y + 0.5);
    }
  return out;
}

/// Two clicks on the object, at its left and right, and up to `outside` around it: below, left, right, above.
inline Grow clicks_on(const procedural::DemoScene& demo, std::size_t object, const scene::Camera& camera,
                      std::size_t outside) {
  const scene::Mask mask = pixels_of(demo, object, camera);
  const scene::Rect box = scene::bounding_box(mask);
  const double size = std::sqrt(double(mask.area()));
  Grow grow;
  render::Workspace workspace;
  const auto click = [&](DVec2 at, std::vector<DVec3>& points) {
    if (const auto hit = render::pick(demo.cloud, camera, at, workspace)) points.push_back(hit->point);
  };
  int radius = int(0.15 * size);
  std::vector<DVec2> inner = well_inside(mask, radius);
  while (inner.empty() && radius > 0) inner = well_inside(mask, --radius);
  if (inner.empty()) return grow;
  const auto by_x = [](DVec2 a, DVec2 b) { return a.x < b.x; };
  click(*std::min_element(inner.begin(), inner.end(), by_x), grow.inside);
  click(*std::max_element(inner.begin(), inner.end(), by_x), grow.inside);
  const double beside = 0.2 * size;
  const DVec2 middle(0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1));
  for (const DVec2 at : {DVec2(middle.x, box.y1 + beside), DVec2(box.x0 - beside, middle.y),
                         DVec2(box.x1 + beside, middle.y), DVec2(middle.x, box.y0 - beside)})
    if (grow.outside.size() < outside) click(at, grow.outside);
  return grow;
}

/// One more click, in the middle of the largest patch of pixels that show rows wrongly selected, or wrongly not
/// selected. False where nothing wrong is wider than two pixels.
inline bool correct(const procedural::DemoScene& demo, std::size_t object, const scene::Camera& camera,
                    const std::vector<std::uint8_t>& selected, Grow& grow) {
  const std::vector<float> weight(selected.begin(), selected.end());
  const render::Rendering rendering = render::forward(demo.cloud, camera, {.color = false}, weight);
  const scene::Mask meant = pixels_of(demo, object, camera);
  scene::Mask missed = meant, extra = meant;
  for (std::size_t i = 0; i < meant.data.size(); ++i) {
    const bool is_selected = rendering.weight.data[i] > 0.5f;
    missed.data[i] = meant.data[i] != 0 && !is_selected;
    extra.data[i] = meant.data[i] == 0 && is_selected;
  }
  for (int radius = 40; radius > 0; radius = radius * 2 / 3)
    for (const scene::Mask* wrong : {&extra, &missed}) {
      const std::vector<DVec2> inner = well_inside(*wrong, radius);
      if (inner.empty()) continue;
      render::Workspace workspace;
      const auto hit = render::pick(demo.cloud, camera, inner[inner.size() / 2], workspace);
      if (!hit) return false;
      (wrong == &extra ? grow.outside : grow.inside).push_back(hit->point);
      return true;
    }
  return false;
}

/// What part of the object was selected, and what part of the selection is the object; by opacity times area.
struct Agreement {
  double recall = 0, precision = 0;
};
inline Agreement agreement(const procedural::DemoScene& demo, std::size_t object,
                           const std::vector<std::uint8_t>& selected) {
  double both = 0, thing = 0, chosen = 0;
  for (std::size_t row = 0; row < selected.size(); ++row) {
    Vec3 s = demo.cloud.log_scale.get(row);
    const double area = std::exp(double(s.x + s.y + s.z - std::min({s.x, s.y, s.z})));
    const double counts = area * double(render::opacity<float>(demo.cloud.opacity_logit[row]));
    const bool is_object = demo.object[row] == object;
    if (is_object) thing += counts;
    if (selected[row] != 0) chosen += counts;
    if (is_object && selected[row] != 0) both += counts;
  }
  return {thing > 0 ? both / thing : 0, chosen > 0 ? both / chosen : 0};
}

}  // namespace engine::select
