#include "engine/procedural/light.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::procedural {
namespace {

constexpr float pi = std::numbers::pi_v<float>;
constexpr int sun_rays = 8, sky_rays = 24;
constexpr float skin = 0.004f;  // rays start this far off a surface: more than its mesh strays from its formula
constexpr float far = 30.0f;    // beyond every made-up scene

struct Basis {
  Vec3 x, y;
};
Basis basis_of(Vec3 normal) {
  const Vec3 axis = std::abs(normal.x) < 0.5f ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
  const Vec3 x = glm::normalize(glm::cross(normal, axis));
  return {x, glm::cross(normal, x)};
}

float smoothstep(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

Vec3 mean_albedo(const Patch& patch) {
  Vec3 sum(0.0f);
  constexpr int n = 6;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const float u = (float(i) + 0.5f) / n, v = (float(j) + 0.5f) / n;
      sum += patch.material({u, v, patch.position(u, v)}).albedo;
    }
  return sum / float(n * n);
}

/// One side of one point.
///   bounced  [patches] radiance over pi
///   turn     0 to 8: rotates the pattern of rays, so that nine neighbours together cast nine times as many
LightMap::Sample gather(const Occluders& occluders, const Light& light, std::span<const Vec3> bounced, Vec3 point,
                        Vec3 normal, int turn) {
  LightMap::Sample sample;
  const Vec3 origin = point + skin * normal;
  const float phase = 2 * pi * float(turn) / 9, golden_angle = pi * (3 - std::sqrt(5.0f));
  if (glm::dot(normal, light.to_sun) > 0) {
    const Basis basis = basis_of(light.to_sun);
    for (int k = 0; k < sun_rays; ++k) {
      const float r = light.sun_radius_rad * std::sqrt((float(k) + 0.5f) / sun_rays);
      const float a = golden_angle * float(k) + phase;
      const Vec3 direction = light.to_sun + r * (std::cos(a) * basis.x + std::sin(a) * basis.y);
      sample.sun += occluders.any(origin, direction, far) ? 0.0f : 1.0f / sun_rays;
    }
  }
  const Basis basis = basis_of(normal);
  for (int k = 0; k < sky_rays; ++k) {  // cosine-weighted: each ray stands for the same part of the irradiance
    const float height2 = 1 - (float(k) + (float(turn) + 0.5f) / 9) / sky_rays;
    const float ring = std::sqrt(1 - height2), a = golden_angle * float(k) + phase;
    const Vec3 direction = std::sqrt(height2) * normal + ring * (std::cos(a) * basis.x + std::sin(a) * basis.y);
    const auto hit = occluders.nearest(origin, direction, far);
    sample.ambient += (hit ? bounced[hit->patch] : light.sky(direction)) / float(sky_rays);
  }
  return sample;
}

float length_of(const Patch& patch, bool along_u) {
  constexpr int steps = 16;
  float longest = 0;
  for (const float other : {0.25f, 0.5f, 0.75f}) {
    auto at = [&](int i) {
      const float t = float(i) / steps;
      return along_u ? patch.position(t, other) : patch.position(other, t);
    };
    float length = 0;
    for (int i = 0; i < steps; ++i) length += glm::length(at(i + 1) - at(i));
    longest = std::max(longest, length);
  }
  return longest;
}

/// Mean over 3 x 3 points: together they cast each ray of the turned patterns once.
void smooth(LightMap& map) {
  const LightMap sharp = map;
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      Vec3 ambient(0.0f);
      float sun = 0;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const int v = std::clamp(y + j, 0, map.height - 1);
          const int u = map.closed_u ? (x + i + map.width) % map.width : std::clamp(x + i, 0, map.width - 1);
          ambient += sharp.ambient[std::size_t(v) * std::size_t(map.width) + std::size_t(u)];
          sun += sharp.sun[std::size_t(v) * std::size_t(map.width) + std::size_t(u)];
        }
      map.ambient[std::size_t(y) * std::size_t(map.width) + std::size_t(x)] = ambient / 9.0f;
      map.sun[std::size_t(y) * std::size_t(map.width) + std::size_t(x)] = sun / 9.0f;
    }
}

}  // namespace

float Light::through_window(Vec3 point) const {
  Vec3 right = glm::cross(to_sun, Vec3(0, 1, 0));
  const float level = glm::length(right);
  right = level > 1e-6f ? right / level : Vec3(1, 0, 0);  // under a sun at the zenith the window lies along x
  const Vec3 up = glm::cross(right, to_sun);
  const float x = glm::dot(point - window.middle, right), y = glm::dot(point - window.middle, up);
  auto lit = [&](float at, int panes, float pane) {
    const float pitch = pane + window.bar;
    const float from_start = at + 0.5f * (float(panes) * pitch - window.bar);
    const float index = std::clamp(std::floor((from_start + 0.5f * window.bar) / pitch), 0.0f, float(panes - 1));
    const float in_pane = from_start - index * pitch;
    return smoothstep(-window.softness, window.softness, in_pane) *
           smoothstep(-window.softness, window.softness, pane - in_pane);
  };
  return lit(x, window.columns, window.pane_width) * lit(y, window.rows, window.pane_height);
}

Vec3 Light::sky(Vec3 direction) const {
  const float height = -direction.y;
  return height > 0 ? sky_level + height * (sky_up - sky_level) : sky_level - height * (sky_down - sky_level);
}

LightMap::Sample LightMap::at(float u, float v) const {
  // Points sit in the middle of their cells.
  const float x = u * float(width) - 0.5f, y = v * float(height) - 0.5f;
  const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
  Sample sample;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const float weight = (i ? x - float(x0) : 1 - x + float(x0)) * (j ? y - float(y0) : 1 - y + float(y0));
      const int column = closed_u ? (x0 + i + width) % width : std::clamp(x0 + i, 0, width - 1);
      const auto index = std::size_t(std::clamp(y0 + j, 0, height - 1) * width + column);
      sample.ambient += weight * ambient[index];
      sample.sun += weight * sun[index];
    }
  return sample;
}

void LightMap::want(float u, float v) {
  // The two points on either side that at() blends, and those next to them that smooth() averages.
  const int x0 = int(std::floor(u * float(width) - 0.5f)), y0 = int(std::floor(v * float(height) - 0.5f));
  for (int y = y0 - 1; y <= y0 + 2; ++y)
    for (int x = x0 - 1; x <= x0 + 2; ++x) {
      const int column = closed_u ? (x + 2 * width) % width : std::clamp(x, 0, width - 1);
      wanted[std::size_t(std::clamp(y, 0, height - 1)) * std::size_t(width) + std::size_t(column)] = 1;
    }
}

std::vector<LightMap> make_light_maps(std::span<const Object> objects, float texel) {
  std::vector<LightMap> maps;
  for (const Object& object : objects)
    for (const Patch& patch : object.patches) {
      const float step = texel / std::sqrt(std::min(patch.density, 1.0f));
      LightMap map;
      map.width = std::clamp(int(length_of(patch, true) / step), 3, 512);
      map.height = std::clamp(int(length_of(patch, false) / step), 3, 512);
      map.closed_u = patch.closed_u;
      map.ambient.resize(std::size_t(map.width) * std::size_t(map.height));
      map.sun.resize(map.ambient.size());
      map.wanted.resize(map.ambient.size());
      maps.push_back(std::move(map));
    }
  return maps;
}

void bake(std::span<const Object> objects, std::span<const Object> shading, const Occluders& occluders,
          const Light& light, std::span<LightMap> maps) {
  struct Row {
    const Object* object;
    const Patch* patch;
    LightMap* map;
    int y;
  };
  std::vector<Vec3> bounced;  // radiance over pi that each patch sends back, roughly
  for (const Object& object : shading)
    for (const Patch& patch : object.patches)
      // An eighth of the sun (most of a room is in shadow) and half of the sky reaches an average surface of a room.
      bounced.push_back(mean_albedo(patch) * (0.12f * light.sun / pi + 0.5f * light.sky_level));
  std::vector<Row> rows;
  auto next_map = maps.begin();
  for (const Object& object : objects)
    for (const Patch& patch : object.patches) {
      LightMap& map = *next_map++;
      for (int y = 0; y < map.height; ++y) rows.push_back({&object, &patch, &map, y});
    }
  parallel_for(rows.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const auto& [object, patch, map, y] = rows[r];
      const Placement turned{Vec3(0.0f), object->placement.turn_rad};
      const float v = (float(y) + 0.5f) / float(map->height);
      for (int x = 0; x < map->width; ++x) {
        if (!map->wanted[std::size_t(y) * std::size_t(map->width) + std::size_t(x)]) continue;
        const float u = (float(x) + 0.5f) / float(map->width);
        const Vec3 point = object->placement.world(patch->position(u, v));
        const Vec3 normal = turned.world(normal_at(*patch, u, v));
        const int turn = x % 3 + 3 * (y % 3);
        LightMap::Sample sample = gather(occluders, light, bounced, point, normal, turn);
        if (patch->two_sided) {
          const LightMap::Sample back = gather(occluders, light, bounced, point, -normal, turn);
          sample.ambient = 0.5f * (sample.ambient + back.ambient);
          sample.sun = std::max(sample.sun, back.sun);
        }
        map->ambient[std::size_t(y) * std::size_t(map->width) + std::size_t(x)] = sample.ambient;
        map->sun[std::size_t(y) * std::size_t(map->width) + std::size_t(x)] = sample.sun;
      }
    }
  });
  for (LightMap& map : maps) smooth(map);
}

Vec3 develop(Vec3 linear) {
  Vec3 shown;
  for (int c = 0; c < 3; ++c) {
    const float x = std::max(0.0f, linear[c]);
    const float film = std::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
    shown[c] = film <= 0.0031308f ? 12.92f * film : 1.055f * std::pow(film, 1 / 2.4f) - 0.055f;
  }
  return shown;
}

}  // namespace engine::procedural
