#include "engine/procedural/objects.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "engine/core/rng.h"
#include "engine/procedural/materials.h"

namespace engine::procedural {
namespace {

constexpr float pi = std::numbers::pi_v<float>;
// Gaussians per area, relative to the table top.
constexpr float on_things = 2.2f, on_leaves = 2.0f, on_wall = 0.10f, on_floor = 0.12f;

void append(std::vector<Patch>& to, std::vector<Patch> more) {
  for (Patch& patch : more) to.push_back(std::move(patch));
}

/// Bezier curve of three points.
Vec3 bend(Vec3 a, Vec3 b, Vec3 c, float t) { return (1 - t) * (1 - t) * a + 2 * t * (1 - t) * b + t * t * c; }

Vec3 at(float x, float height, float z) { return {x, -height, z}; }

}  // namespace

Object make_room(float floor_height) {
  constexpr float half_width = 4.6f, front = -5.2f, back = 1.45f, wall_height = 5.4f;
  const float f = floor_height, w = 2 * half_width, d = back - front;
  const Material wall = plaster(srgb(206, 196, 178)), side = plaster(srgb(190, 196, 188));
  const Vec3 up = at(0, wall_height, 0);
  Object room{"room", {}, {}};
  room.patches = {quad(at(-half_width, f, front), {w, 0, 0}, {0, 0, d}, floorboards(), on_floor),
                  quad(at(-half_width, f, back), {w, 0, 0}, up, wall, on_wall),
                  quad(at(-half_width, f, front), {0, 0, d}, up, side, 0.6f * on_wall),
                  quad(at(half_width, f, front), up, {0, 0, d}, side, 0.6f * on_wall)};
  append(room.patches, box(at(0, f, back - 0.03f), {w, 0.22f, 0.06f}, plain(srgb(226, 220, 206), 0.1f), 0.5f));
  return room;
}

Object make_table(Placement placement, Vec3 size) {
  constexpr float thickness = 0.11f, leg = 0.15f, inset = 0.14f;
  Object table{"table", placement, {}};
  const Material top = wood(srgb(206, 158, 108), srgb(132, 82, 46), 0.42f);
  table.patches = box(at(0, -thickness, 0), {size.x, thickness, size.z}, top, 1);
  for (const float x : {-1.0f, 1.0f})
    for (const float z : {-1.0f, 1.0f})
      append(table.patches, box(at(x * (0.5f * size.x - inset), -size.y, z * (0.5f * size.z - inset)),
                                {leg, size.y - thickness, leg}, plain(srgb(104, 76, 54), 0.1f), 0.4f));
  return table;
}

Object make_framed_print(Placement middle, float width, float height) {
  constexpr float border = 0.07f, mount = 0.10f, depth = 0.06f;
  const float w = 0.5f * width, h = 0.5f * height;
  Object print{"print", middle, {}};
  const Material frame = wood(srgb(92, 62, 42), srgb(52, 34, 24), 0.3f);
  for (const float side : {-1.0f, 1.0f}) {
    append(print.patches, box(at(0, side * h - 0.5f * border, 0), {width + border, border, depth}, frame, 1));
    append(print.patches, box(at(side * w, -h, 0), {border, height, depth}, frame, 1));
  }
  const Material card = plain(srgb(240, 236, 224));
  for (const float side : {-1.0f, 1.0f}) {
    append(print.patches, box(at(0, side * (h - 0.5f * mount) - 0.5f * mount, 0), {width, mount, 0.01f}, card, 0.6f));
    append(print.patches, box(at(side * (w - 0.5f * mount), -h, 0), {mount, height, 0.01f}, card, 0.6f));
  }
  // v runs downwards on the print itself, so that its picture stands upright.
  const float x = w - mount, y = h - mount;
  Patch picture = quad(at(-x, y, 0), {2 * x, 0, 0}, at(0, -2 * y, 0), landscape_print(), 1.6f);
  picture.two_sided = true;
  print.patches.push_back(std::move(picture));
  return print;
}

Object make_ball(Placement placement, float radius, Vec3 glaze, Vec3 stripe) {
  std::vector<ProfilePoint> profile;
  constexpr int n = 24;
  for (int i = 0; i <= n; ++i) {
    const float a = pi * float(i) / n;
    profile.push_back({radius * std::sin(a), radius * (1 - std::cos(a))});
  }
  return {"ball", placement, {lathe(profile, striped_ceramic(glaze, stripe, radius), 1.2f * on_things, 64)}};
}

Object make_mug(Placement placement) {
  const Material glaze = two_tone_glaze(srgb(196, 172, 140), srgb(58, 104, 122), 0.13f);
  Object mug{"mug", placement, {}};
  mug.patches.push_back(lathe({{0, 0},
                               {0.150f, 0},
                               {0.168f, 0.025f},
                               {0.178f, 0.10f},
                               {0.180f, 0.40f},
                               {0.174f, 0.412f},
                               {0.166f, 0.40f},
                               {0.160f, 0.10f},
                               {0.140f, 0.04f},
                               {0, 0.04f}},
                              glaze, on_things));
  mug.patches.push_back(lathe({{0.163f, 0.33f}, {0, 0.33f}}, plain(srgb(112, 58, 24), 0.9f), on_things));
  mug.patches.push_back(
      tube([](float v) { return at(0.172f + 0.13f * std::sin(pi * v), 0.215f + 0.115f * std::cos(pi * v), 0); },
           [](float) { return 0.024f; }, glaze, on_things, 12, 24));
  return mug;
}

Object make_apple(Placement placement, float radius) {
  std::vector<ProfilePoint> profile;
  constexpr int n = 28;
  for (int i = 0; i <= n; ++i) {
    const float a = pi * float(i) / n;
    const float r = std::sin(a) * (1 - 0.10f * std::cos(a + 0.5f));  // widest above its middle
    const float dimple = a > pi / 2 ? -0.42f * std::exp(-9 * r * r) : 0.16f * std::exp(-12 * r * r);
    profile.push_back({radius * r, radius * (0.88f - 0.95f * std::cos(a) + dimple)});
  }
  Object apple{"apple", placement, {}};
  apple.patches.push_back(lathe(profile, apple_skin(), 1.2f * on_things));
  apple.patches.push_back(tube(
      [radius](float v) {
        return bend(at(0, 1.35f * radius, 0), at(0, 1.8f * radius, 0), at(0.25f * radius, 2.0f * radius, 0), v);
      },
      [radius](float v) { return radius * (0.05f + 0.03f * v); }, plain(srgb(86, 60, 36)), 2 * on_things));
  return apple;
}

Object make_book(Placement placement, Vec3 size, Vec3 cover) {
  constexpr float board = 0.018f, overhang = 0.02f;
  const Material cloth = cloth_cover(cover);
  Object book{"book", placement, {}};
  const Vec3 boards(size.x, board, size.z);
  append(book.patches, box(at(0, 0, 0), boards, cloth, on_things));
  append(book.patches, box(at(0, size.y - board, 0), boards, cloth, on_things));
  // The spine is towards the viewer.
  append(book.patches, box(at(0, 0, 0.5f * (board - size.z)), {size.x, size.y, board}, cloth, on_things));
  append(book.patches, box(at(0, board, 0), {size.x - 2 * overhang, size.y - 2 * board, size.z - 2 * overhang},
                           page_edges(), on_things));
  const Material gilt = plain(srgb(222, 184, 112), 0.4f);
  const float z = -0.5f * size.z - 0.002f, line = 0.1f * size.y;
  for (const float x : {-0.36f, 0.36f})
    for (const float offset : {-0.018f, 0.018f})
      book.patches.push_back(
          quad(at((x + offset) * size.x, line, z), {0.014f, 0, 0}, at(0, size.y - 2 * line, 0), gilt, 2 * on_things));
  return book;
}

Object make_pot(Placement placement) {
  Object pot{"pot", placement, {}};
  const Material clay = terracotta(0.235f, 0.385f);
  pot.patches.push_back(lathe({{0, 0.03f},
                               {0.27f, 0.03f},
                               {0.395f, 0.475f},
                               {0.435f, 0.48f},
                               {0.445f, 0.49f},
                               {0.452f, 0.60f},
                               {0.442f, 0.612f},
                               {0.412f, 0.612f},
                               {0.402f, 0.60f},
                               {0.385f, 0.45f}},
                              clay, on_things, 72));
  pot.patches.push_back(
      lathe({{0, 0}, {0.33f, 0}, {0.40f, 0.055f}, {0.39f, 0.065f}, {0.375f, 0.06f}, {0.31f, 0.025f}, {0, 0.025f}},
            plain(srgb(44, 84, 98), 0.6f), on_things, 64));
  pot.patches.push_back(lathe({{0.395f, soil_height}, {0, soil_height + 0.03f}}, soil(), on_things));
  return pot;
}

Plant make_plant(Placement placement, int leaves, std::uint64_t seed) {
  Plant plant{{"plant", placement, {}}, {}};
  const float golden_angle = pi * (3 - std::sqrt(5.0f));
  for (int i = 0; i < leaves; ++i) {
    Rng rng(seed, std::uint64_t(i));
    auto about = [&](float value, float spread) { return value + rng.uniform(-spread, spread); };
    const float t = (float(i) + 0.5f) / float(leaves);  // 0 the oldest, outermost leaf; 1 the newest, upright
    const float turn = golden_angle * float(i) + about(0.0f, 0.22f);
    const Vec3 out(std::cos(turn), 0, std::sin(turn)), up(0, -1, 0);
    auto from_soil = [=](float radial, float height) { return at(0, soil_height, 0) + radial * out + height * up; };

    const float reach = about(0.30f - 0.20f * t, 0.03f), rise = about(0.20f + 0.52f * t, 0.06f);
    const Vec3 foot = from_soil(0.05f * (1 - t), 0), base = from_soil(reach, rise);
    const Vec3 knee = from_soil(0.35f * reach, 0.75f * rise);
    const float length = about(0.66f - 0.16f * t, 0.06f);
    const float leave = (about(34, 8) + 42 * t) * pi / 180, droop = (about(-14, 10) + 66 * t) * pi / 180;
    const Vec3 middle = base + 0.55f * length * (std::cos(leave) * out + std::sin(leave) * up);
    const Vec3 tip = base + length * (std::cos(droop) * out + std::sin(droop) * up);

    Blade blade;
    blade.midrib = [=](float v) { return bend(base, middle, tip, v); };
    const float roll = about(0.0f, 0.35f);
    const Vec3 level = glm::cross(out, up), across = glm::cross(level, out);
    blade.side = glm::normalize(std::cos(roll) * level + std::sin(roll) * across);
    blade.half_width = about(0.24f, 0.025f) * length;
    blade.cup = about(0.22f, 0.12f);
    blade.ripple = about(0.06f, 0.03f);
    plant.object.patches.push_back(leaf(blade, foliage(about(0.85f - 0.75f * t, 0.15f)), on_leaves));
    plant.object.patches.push_back(tube([=](float v) { return bend(foot, knee, base, v); },
                                        [](float v) { return 0.017f - 0.006f * v; }, stalk(), on_leaves, 8, 12));
    plant.blades.push_back(std::move(blade));
  }
  return plant;
}

}  // namespace engine::procedural
