#include "engine/procedural/materials.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace engine::procedural {
namespace {

constexpr float pi = std::numbers::pi_v<float>;

float smoothstep(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}
float fraction(float x) { return x - std::floor(x); }
float height_of(const SurfacePoint& point) { return -point.local.y; }

/// A number in [-1, 1] for a lattice point; the mixing step is MurmurHash3's finaliser (public domain).
float lattice(int x, int y, int z) {
  std::uint32_t h = std::uint32_t(x) * 0x8da6b343u ^ std::uint32_t(y) * 0xd8163841u ^ std::uint32_t(z) * 0xcb1ab31fu;
  h ^= h >> 16, h *= 0x85ebca6bu, h ^= h >> 13, h *= 0xc2b2ae35u, h ^= h >> 16;
  return float(h >> 8) * 0x1p-23f - 1.0f;
}

}  // namespace

Vec3 srgb(int red, int green, int blue) {
  auto linear = [](int value) {
    const float c = float(value) / 255;
    return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);  // IEC 61966-2-1
  };
  return {linear(red), linear(green), linear(blue)};
}

float noise(Vec3 p) {
  const Vec3 cell(std::floor(p.x), std::floor(p.y), std::floor(p.z));
  Vec3 t = p - cell;
  t = t * t * (3.0f - 2.0f * t);
  const int x = int(cell.x), y = int(cell.y), z = int(cell.z);
  auto mix = [](float a, float b, float s) { return a + s * (b - a); };
  auto along_x = [&](int j, int k) { return mix(lattice(x, y + j, z + k), lattice(x + 1, y + j, z + k), t.x); };
  return mix(mix(along_x(0, 0), along_x(1, 0), t.y), mix(along_x(0, 1), along_x(1, 1), t.y), t.z);
}

float fractal_noise(Vec3 point, int octaves) {
  float sum = 0, size = 0.6f;
  for (int i = 0; i < octaves; ++i, size *= 0.5f, point = 2.03f * point + Vec3(17.1f, 5.3f, 9.7f))
    sum += size * noise(point);
  return sum;
}

Material plain(Vec3 albedo, float gloss) {
  return [=](const SurfacePoint&) { return Finish{albedo, gloss}; };
}

Material wood(Vec3 light, Vec3 dark, float board_width) {
  return [=](const SurfacePoint& p) {
    const float across = p.local.z / board_width;
    const float board = std::floor(across);
    const float shade = lattice(int(board), 3, 7);
    // Growth rings of a log cut lengthwise: distance from an axis that runs along the board, a little askew.
    const float x = p.local.x + 7 * shade, z = p.local.z - board_width * (board + 0.5f + 0.4f * shade);
    const float wander = fractal_noise(Vec3(0.8f * x, 2 * p.local.y, 3 * z + 31 * shade), 3);
    const float from_heart = std::hypot(z + 0.08f * wander + 0.03f * x, 0.05f + 0.06f * std::abs(shade));
    const float ring = fraction(13 * from_heart + 0.5f * wander);
    const float band = smoothstep(0.0f, 0.8f, ring) * (1 - smoothstep(0.85f, 1.0f, ring));
    const float fibre = fractal_noise(Vec3(2.5f * x, 30 * p.local.y, 45 * z), 2);
    const float mixed = std::clamp(0.30f + 0.34f * band + 0.16f * fibre + 0.20f * shade, 0.0f, 1.0f);
    const float from_joint = board_width * std::min(fraction(across), 1 - fraction(across));
    const float joint = 0.35f + 0.65f * smoothstep(0.002f, 0.012f, from_joint);
    return Finish{(light + mixed * (dark - light)) * joint, 0.25f};
  };
}

Material floorboards() {
  return [](const SurfacePoint& p) {
    const float across = p.local.x / 0.45f;
    const float shade = lattice(int(std::floor(across)), 11, 2);
    const float grain = fractal_noise(Vec3(9 * p.local.x, 0, 0.9f * p.local.z + 13 * shade), 2);
    const float joint = 0.55f + 0.45f * smoothstep(0.0f, 0.05f, std::min(fraction(across), 1 - fraction(across)));
    return Finish{srgb(112, 88, 70) * (1 + 0.16f * shade + 0.2f * grain) * joint, 0};
  };
}

Material plaster(Vec3 albedo) {
  return [=](const SurfacePoint& p) {
    const float cloud = fractal_noise(0.9f * p.local, 4), trowel = fractal_noise(Vec3(3, 5, 3) * p.local, 3);
    return Finish{albedo * (1 + 0.07f * cloud + 0.05f * trowel), 0};
  };
}

Material terracotta(float band_low, float band_high) {
  return [=](const SurfacePoint& p) {
    const float cloud = fractal_noise(4.0f * p.local, 4);
    // Rings that the potter's fingers leave, and a bloom of lime towards the foot.
    const float rings = std::sin(130 * height_of(p) + 2 * cloud);
    Vec3 albedo = srgb(186, 112, 80) * (1 + 0.12f * cloud + 0.035f * rings);
    const float lime = smoothstep(0.25f, -0.05f, height_of(p) + 0.1f * cloud);
    albedo += 0.22f * lime * (srgb(214, 190, 170) - albedo);
    const float t = (height_of(p) - band_low) / (band_high - band_low);
    if (t < 0 || t > 1) return Finish{albedo, 0.05f};
    const float zigzag = 2 * std::abs(fraction(16 * p.u) - 0.5f);
    const float off = std::abs(t - (0.25f + 0.5f * zigzag));
    const float line = 1 - smoothstep(0.10f, 0.15f, off);
    const float rim = std::min(t, 1 - t) < 0.09f ? 1.0f : 0.0f;
    const Vec3 paint = srgb(32, 74, 92), ground = srgb(238, 226, 200);
    return Finish{(ground + std::max(line, rim) * (paint - ground)) * (1 + 0.05f * cloud), 0.15f};
  };
}

Material soil() {
  return [](const SurfacePoint& p) {
    const float crumbs = fractal_noise(28.0f * p.local, 3);
    return Finish{srgb(70, 50, 38) * (1 + 0.6f * crumbs), 0};
  };
}

Material foliage(float age) {
  return [=](const SurfacePoint& p) {
    const float across = std::abs(2 * p.u - 1);
    const Vec3 young = srgb(124, 158, 68), old = srgb(40, 96, 52);
    const float patchy = fractal_noise(6.0f * p.local, 3);
    Vec3 albedo = young + std::clamp(age + 0.2f * patchy, 0.0f, 1.0f) * (old - young);
    albedo *= 1 + 0.12f * patchy - 0.12f * across;
    const float midrib = 1 - smoothstep(0.03f, 0.10f, across);
    // Side veins leave the midrib forwards, in chevrons.
    const float chevron = std::abs(fraction(8 * p.v - 1.6f * across) - 0.5f);
    const float vein = 0.55f * (1 - smoothstep(0.04f, 0.16f, chevron)) * (1 - 0.6f * across);
    const Vec3 pale = srgb(186, 206, 120);
    albedo += 0.6f * std::max(midrib, vein) * (pale - albedo);
    return Finish{albedo, 0.2f};
  };
}

Material stalk() {
  return [](const SurfacePoint& p) {
    return Finish{srgb(118, 146, 66) * (1 + 0.15f * fractal_noise(8.0f * p.local, 2)), 0.1f};
  };
}

Material striped_ceramic(Vec3 glaze, Vec3 stripe, float radius) {
  return [=](const SurfacePoint& p) {
    // Stripes around a tilted axis, so that one sees how the ball lies.
    const Vec3 from_middle = (p.local + Vec3(0, radius, 0)) / radius;
    const float t = glm::dot(from_middle, glm::normalize(Vec3(0.45f, -0.8f, -0.35f)));
    const float wave = std::abs(fraction(2.6f * t + 0.25f) - 0.5f);
    const float painted = smoothstep(0.27f, 0.31f, wave);
    const float cap = smoothstep(0.90f, 0.92f, std::abs(t));
    Vec3 albedo = glaze + std::max(painted, cap) * (stripe - glaze);
    albedo *= 1 + 0.05f * fractal_noise(5.0f * from_middle, 3);
    return Finish{albedo, 1};
  };
}

Material two_tone_glaze(Vec3 lower, Vec3 upper, float height) {
  return [=](const SurfacePoint& p) {
    const float run = 0.05f * fractal_noise(Vec3(7 * p.local.x, 0, 7 * p.local.z), 2);
    const float glazed = smoothstep(-0.012f, 0.012f, height_of(p) - height + run);
    const float speck = smoothstep(0.42f, 0.6f, noise(38.0f * p.local));
    const Vec3 albedo = lower + glazed * (upper - lower);
    return Finish{albedo * (1 - 0.45f * speck) * (1 + 0.05f * fractal_noise(6.0f * p.local, 3)), 0.2f + 0.7f * glazed};
  };
}

Material apple_skin() {
  return [](const SurfacePoint& p) {
    const float angle = 2 * pi * p.u;
    const float streak = fractal_noise(Vec3(5 * std::cos(angle), 5 * std::sin(angle), 1.5f * p.v), 3);
    const float sunny = smoothstep(-1.1f, 0.7f, std::cos(angle - 2.4f) + 0.9f * streak);
    const Vec3 yellow = srgb(222, 190, 84), red = srgb(178, 32, 34);
    Vec3 albedo = yellow + sunny * (red - yellow);
    const float stalk_end = smoothstep(0.86f, 0.98f, p.v + 0.04f * streak);
    albedo += 0.7f * stalk_end * (srgb(150, 160, 70) - albedo);
    const float dot = smoothstep(0.55f, 0.7f, noise(45.0f * p.local));
    return Finish{albedo + 0.2f * dot * (srgb(240, 220, 170) - albedo), 0.7f};
  };
}

Material cloth_cover(Vec3 albedo) {
  return [=](const SurfacePoint& p) {
    const float worn = fractal_noise(9.0f * p.local, 3);
    const float weave = 0.5f * (std::sin(220 * p.local.x) + std::sin(220 * p.local.z));
    return Finish{albedo * (1 + 0.12f * worn + 0.04f * weave), 0.05f};
  };
}

Material page_edges() {
  return [](const SurfacePoint& p) {
    const float sheet = noise(Vec3(2 * p.local.x, 160 * p.local.y, 2 * p.local.z));
    return Finish{srgb(232, 220, 192) * (1 + 0.12f * sheet), 0};
  };
}

Material landscape_print() {
  return [](const SurfacePoint& p) {
    const Vec3 night = srgb(38, 70, 83), sky = srgb(244, 211, 160), sun = srgb(231, 111, 81);
    Vec3 albedo = sky + smoothstep(0.55f, 0.0f, p.v) * 0.5f * (srgb(160, 196, 190) - sky);
    const float to_sun = std::hypot(p.u - 0.62f, 1.3f * (p.v - 0.40f));
    albedo += (1 - smoothstep(0.150f, 0.165f, to_sun)) * (sun - albedo);
    // Hills, each nearer, lower and darker than the last.
    for (int hill = 0; hill < 3; ++hill) {
      const float k = float(hill);
      const float crest = 0.52f + 0.14f * k - 0.09f * std::sin(5 * p.u + 2.1f * k) - 0.04f * std::sin(11 * p.u + k);
      const Vec3 color = srgb(42, 157, 143) + (k / 2) * (night - srgb(42, 157, 143));
      albedo += smoothstep(crest - 0.008f, crest + 0.008f, p.v) * (color - albedo);
    }
    return Finish{albedo, 0.1f};
  };
}

}  // namespace engine::procedural
