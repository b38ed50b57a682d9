#include "engine/procedural/surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/procedural/materials.h"

namespace engine::procedural {
namespace {

const Material gray = plain(Vec3(0.5f));

TEST(Box, HasItsFacesOutwards) {
  const auto faces = box({1, 0, 2}, {2, 3, 4}, gray, 1);
  ASSERT_EQ(faces.size(), 6u);
  const Vec3 middle(1, -1.5f, 2);
  for (const Patch& face : faces) {
    const Vec3 out = face.position(0.5f, 0.5f) - middle;
    EXPECT_NEAR(glm::dot(normal_at(face, 0.5f, 0.5f), glm::normalize(out)), 1, 1e-5);
  }
}

TEST(Lathe, PointsOutwardsOutsideAndInwardsInside) {
  const Patch bowl = lathe({{0.5f, 0}, {0.5f, 1}, {0.4f, 1}, {0.4f, 0}}, gray, 1);
  for (const float u : {0.0f, 0.3f, 0.77f}) {
    auto radial = [&](float v) {
      const Vec3 p = bowl.position(u, v);
      return glm::dot(normal_at(bowl, u, v), glm::normalize(Vec3(p.x, 0, p.z)));
    };
    EXPECT_NEAR(radial(0.2f), 1, 1e-3);
    EXPECT_NEAR(radial(0.8f), -1, 1e-3);
    EXPECT_NEAR(normal_at(bowl, u, 0.5f).y, -1, 1e-3) << "the rim looks up";
  }
}

TEST(Lathe, HasRingsOfItsMeshAtEveryCorner) {
  const std::vector<ProfilePoint> corners{{0, 0}, {0.33f, 0}, {0.4f, 0.055f}, {0.39f, 0.065f}, {0.31f, 0.025f}};
  const Patch saucer = lathe(corners, gray, 1);
  for (const ProfilePoint& corner : corners) {
    float nearest = 1;
    for (int j = 0; j <= saucer.cells_v; ++j) {
      const Vec3 p = saucer.position(0, float(j) / float(saucer.cells_v));
      nearest = std::min(nearest, std::hypot(p.x - corner.radius, -p.y - corner.height));
    }
    EXPECT_LT(nearest, 1e-5f) << corner.radius << ", " << corner.height;
  }
}

TEST(Lathe, HasANormalAtItsPole) {
  const Patch cone = lathe({{0, 0}, {1, 0}, {0, 1}}, gray, 1);
  EXPECT_NEAR(glm::length(normal_at(cone, 0.4f, 0.0f)), 1, 1e-4);
  EXPECT_NEAR(glm::length(normal_at(cone, 0.4f, 1.0f)), 1, 1e-4);
  EXPECT_GT(normal_at(cone, 0.4f, 0.0f).y, 0.99f) << "its base looks down";
}

TEST(Tube, PointsOutwards) {
  const Patch ring = tube([](float v) { return Vec3(std::cos(6.2831853f * v), 0, std::sin(6.2831853f * v)); },
                          [](float) { return 0.1f; }, gray, 1);
  for (const float u : {0.1f, 0.6f})
    for (const float v : {0.0f, 0.25f, 0.8f}) {
      const Vec3 middle(std::cos(6.2831853f * v), 0, std::sin(6.2831853f * v));
      const Vec3 out = ring.position(u, v) - middle;
      EXPECT_NEAR(glm::length(out), 0.1f, 1e-4);
      EXPECT_NEAR(glm::dot(normal_at(ring, u, v), glm::normalize(out)), 1, 1e-2);
    }
}

TEST(Leaf, EndsInPointsAndIsWidestBetween) {
  EXPECT_NEAR(blade_outline(0), 0, 1e-3);
  EXPECT_NEAR(blade_outline(1), 0, 1e-3);
  EXPECT_NEAR(blade_outline(2), 0, 1e-3);
  EXPECT_GT(blade_outline(0.4f), 0.98f);
  const Patch blade = leaf(
      {.midrib = [](float v) { return Vec3(v, 0, 0); }, .side = {0, 0, -1}, .half_width = 0.2f, .cup = 0, .ripple = 0},
      gray, 1);
  const float width = glm::length(blade.position(1, 0.38f) - blade.position(0, 0.38f));
  EXPECT_NEAR(width, 0.4f * blade_outline(0.38f), 1e-4);
  EXPECT_NEAR(normal_at(blade, 0.5f, 0.4f).y, -1, 1e-3);
}

TEST(Placement, TurnsFromXTowardsZAndMoves) {
  const Placement placement{{1, 2, 3}, 1.5707963f};
  EXPECT_LT(glm::length(placement.world({1, 0.5f, 0}) - Vec3(1, 2.5f, 4)), 1e-6);
}

TEST(Materials, StayWithinWhatASurfaceCanReflect) {
  const std::vector<Material> all{wood(srgb(206, 158, 108), srgb(132, 82, 46), 0.4f),
                                  floorboards(),
                                  plaster(srgb(206, 196, 178)),
                                  terracotta(0.2f, 0.4f),
                                  soil(),
                                  foliage(0.5f),
                                  stalk(),
                                  striped_ceramic(srgb(240, 232, 214), srgb(38, 84, 124), 0.2f),
                                  two_tone_glaze(srgb(196, 172, 140), srgb(58, 104, 122), 0.13f),
                                  apple_skin(),
                                  cloth_cover(srgb(168, 62, 48)),
                                  page_edges(),
                                  landscape_print()};
  for (std::size_t m = 0; m < all.size(); ++m)
    for (float u = 0; u <= 1; u += 0.05f)
      for (float v = 0; v <= 1; v += 0.05f) {
        const Finish finish = all[m]({u, v, Vec3(u, -0.6f * v, 0.7f * u - v)});
        for (int c = 0; c < 3; ++c) {
          ASSERT_GE(finish.albedo[c], 0) << "material " << m << " at " << u << ", " << v;
          ASSERT_LE(finish.albedo[c], 1) << "material " << m << " at " << u << ", " << v;
        }
      }
}

}  // namespace
}  // namespace engine::procedural
