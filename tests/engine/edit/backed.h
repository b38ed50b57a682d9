// A thing before a wall, as trainers make them: faint, backed by what nobody sees whole, and with some of it in the
// wall.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "tests/engine/edit/block.h"

namespace engine::edit {

/// The thing faces cameras on the side z < 0; the wall is z = 0.4.
struct BackedThing {
  scene::GaussianCloud cloud;
  std::vector<std::uint32_t> thing;    ///< Its rows, `in_wall` among them; they are selected.
  std::vector<std::uint32_t> in_wall;  ///< Large, and beside the others.
  std::uint32_t backing = 0;           ///< Large, behind the thing, and of its colour.
  std::uint32_t sticker = 0;           ///< On its front, not selected, and large enough to be no crumb.
  std::vector<scene::Camera> cameras;
  Request request;  ///< Moves the thing by 0.8 to the right.

  ///   backing_logit  of the opacity of what backs it
  explicit BackedThing(float backing_logit = 4) {
    constexpr Vec3 red{0.9f, 0.2f, 0.1f}, white{0.8f, 0.8f, 0.75f}, blue{0.1f, 0.2f, 0.8f};
    for (int i = -24; i <= 24; ++i)
      for (int k = -24; k <= 24; ++k)
        add_gaussian(cloud, {0.08f * float(i), 0.08f * float(k), 0.4f}, {0.05f, 0.05f, 0.004f}, 4, white);
    const auto add = [&](Vec3 mean, Vec3 sigma, float logit, Vec3 color) {
      add_gaussian(cloud, mean, sigma, logit, color);
      return std::uint32_t(cloud.size() - 1);
    };
    for (int i = -5; i <= 5; ++i)
      for (int k = -5; k <= 5; ++k)
        thing.push_back(add({0.06f * float(i), 0.06f * float(k), 0}, {0.035f, 0.035f, 0.01f}, 0, red));
    in_wall.push_back(add({0.2f, -0.45f, 0.47f}, {0.15f, 0.12f, 0.01f}, 4, red));
    in_wall.push_back(add({-0.2f, 0.45f, 0.47f}, {0.15f, 0.12f, 0.01f}, 4, red));
    thing.insert(thing.end(), in_wall.begin(), in_wall.end());
    backing = add({0.05f, 0, 0.1f}, {0.16f, 0.16f, 0.01f}, backing_logit, red);
    sticker = add({0, 0.1f, -0.02f}, {0.09f, 0.06f, 0.005f}, 4, blue);
    for (int i = -3; i <= 3; ++i) {
      const DVec3 eye = 3.0 * DVec3(std::sin(0.15 * i), -0.1, -std::cos(0.15 * i));
      cameras.push_back(scene::look_at(eye, DVec3(0.2, 0, 0.1), DVec3(0, -1, 0), 0.6, 96, 96));
      cameras.back().name = "view_" + std::to_string(i + 3);
    }
    request.handles = {{DVec3(0.0), DVec3(0.8, 0, 0), 0.3, 0}};
    request.selected = thing;
    request.params.interpolation = Interpolation::arap;
    request.params.max_image_side = 96;
    request.params.iterations = 10;
  }
};

}  // namespace engine::edit
