#include "engine/evaluate/studio.h"

#include "engine/procedural/objects.h"

namespace engine::evaluate {

procedural::Light studio_light() {
  procedural::Light light;
  light.to_sun = glm::normalize(Vec3(-0.5f, -0.8f, -0.6f));
  light.sun = 1.6f * Vec3(1.0f, 0.95f, 0.88f);
  light.sky_up = 0.9f * Vec3(0.95f, 0.98f, 1.0f);
  light.sky_level = 0.75f * Vec3(1.0f, 1.0f, 1.0f);
  light.sky_down = 0.45f * Vec3(1.0f, 0.95f, 0.9f);
  light.window = {
      .middle = {0, 0, 0}, .columns = 1, .rows = 1, .pane_width = 200, .pane_height = 200, .bar = 0, .softness = 0.1f};
  return light;
}

std::vector<procedural::Object> furnished_room() {
  constexpr Vec3 left_print(-0.95f, -0.85f, 1.40f), right_print(0.95f, -0.85f, 1.40f);
  return {procedural::make_room(-1.5f), procedural::make_table({}, {3.7f, 1.5f, 2.1f}),
          procedural::make_framed_print({left_print, 0}, 1.5f, 1.1f),
          procedural::make_framed_print({right_print, 0}, 1.5f, 1.1f)};
}

}  // namespace engine::evaluate
