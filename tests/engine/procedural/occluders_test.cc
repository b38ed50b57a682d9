#include "engine/procedural/occluders.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/rng.h"
#include "engine/procedural/materials.h"

namespace engine::procedural {
namespace {

const Material gray = plain(Vec3(0.5f));

TEST(Occluders, FindTheNearestWallAndNameItsPatch) {
  const std::vector<Object> objects{
      {"far", {}, {quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, gray, 1)}},
      {"near", {}, {quad({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}, gray, 1), quad({5, 5, 5}, {1, 0, 0}, {0, 1, 0}, gray, 1)}}};
  const Occluders occluders(objects);
  const auto hit = occluders.nearest({0.1f, 0.2f, 0}, {0, 0, 1}, 10);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->patch, 1u);
  EXPECT_FLOAT_EQ(hit->distance, 1);
  EXPECT_FALSE(occluders.nearest({0.1f, 0.2f, 0}, {0, 0, 1}, 0.9f));
  EXPECT_FALSE(occluders.any({0.1f, 0.2f, 0}, {0, 0, -1}, 10));
  EXPECT_TRUE(occluders.any({0.1f, 0.2f, 3}, {0, 0, -1}, 10)) << "seen from behind";
  EXPECT_FALSE(occluders.any({1.5f, 0, 0}, {0, 0, 1}, 10)) << "beside it";
}

TEST(Occluders, AgreeWithTheFormulaOfABall) {
  constexpr float radius = 0.7f;
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= 64; ++i) {
    const float a = 3.14159265f * float(i) / 64;
    profile.push_back({radius * std::sin(a), -radius * std::cos(a)});
  }
  const std::vector<Object> objects{{"ball", {{0.3f, -0.2f, 0.1f}, 0.4f}, {lathe(profile, gray, 1, 128)}}};
  const Occluders occluders(objects);
  Rng rng(3);
  int hits = 0;
  for (int i = 0; i < 2000; ++i) {
    SCOPED_TRACE(i);
    const Vec3 origin = 3.0f * glm::normalize(Vec3(rng.normal(), rng.normal(), rng.normal()));
    const Vec3 direction = glm::normalize(Vec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)) - origin);
    const Vec3 to_middle = Vec3(0.3f, -0.2f, 0.1f) - origin;
    const float along = glm::dot(to_middle, direction);
    const float miss = glm::length(to_middle - along * direction);
    if (std::abs(miss - radius) < 0.01f) continue;  // grazing: the mesh is a little inside the ball
    const auto hit = occluders.nearest(origin, direction, 100);
    ASSERT_EQ(hit.has_value(), miss < radius);
    EXPECT_EQ(occluders.any(origin, direction, 100), hit.has_value());
    if (!hit) continue;
    ++hits;
    EXPECT_NEAR(hit->distance, along - std::sqrt(radius * radius - miss * miss), 0.02f);
  }
  EXPECT_GT(hits, 200);
}

TEST(Occluders, SeeNothingInAnEmptyScene) {
  const Occluders occluders(std::vector<Object>{});
  EXPECT_FALSE(occluders.any({0, 0, 0}, {0, 0, 1}, 10));
}

}  // namespace
}  // namespace engine::procedural
