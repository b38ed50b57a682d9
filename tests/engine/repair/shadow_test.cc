#include "engine/repair/shadow.h"

#include <gtest/gtest.h>

#include "tests/engine/repair/shadowed_block.h"

namespace engine::repair {
namespace {

constexpr DVec3 in_shadow{0.42, 0, 0}, on_other_side{-0.42, 0, 0}, far_away{1.1, 0, 0.2};

float brightness(const Shadow& shadow, DVec3 point) {
  const Vec3 light = shadow.light_at({&point, 1}).front();
  return (light.x + light.y + light.z) / 3;
}

TEST(Shadow, IsWhereAFloorIsDarkerBesideThePartThanFartherAway) {
  const Shadow shadow = ShadowedBlock(beside_block).shadow();
  ASSERT_FALSE(shadow.empty());
  EXPECT_NEAR(brightness(shadow, in_shadow), 0.6f, 0.06f);
  EXPECT_EQ(brightness(shadow, on_other_side), 1);
  EXPECT_EQ(brightness(shadow, far_away), 1);
  EXPECT_EQ(brightness(shadow, in_shadow + DVec3(0, -0.4, 0)), 1) << "nothing is there that it could fall on";
}

TEST(Shadow, IsNoneOnAFloorOfOneColor) {
  EXPECT_TRUE(ShadowedBlock([](float, float) { return 1.0f; }).shadow().empty());
}

TEST(Shadow, IsNotTheTextureOfAFloor) {
  const auto checks = [](float x, float z) {
    return (int(std::floor(x / 0.3f)) + int(std::floor(z / 0.3f))) % 2 == 0 ? 1.0f : 0.6f;
  };
  EXPECT_TRUE(ShadowedBlock(checks).shadow().empty());
}

TEST(Shadow, IsNotAStainThatDoesNotComeFromThePart) {
  const auto stain = [](float x, float z) { return std::hypot(x - 0.8f, z) < 0.25f ? 0.6f : 1.0f; };
  EXPECT_TRUE(ShadowedBlock(stain).shadow().empty());
}

TEST(Shadow, IsNotADarkThingThatThePartIsBeside) {
  const auto board = [](float x, float z) { return x > 0 && x < 1.2f && std::abs(z) < 0.3f ? 0.6f : 1.0f; };
  EXPECT_TRUE(ShadowedBlock(board).shadow().empty());
}

TEST(Shadow, IsNotAStainThatReachesThePartByLittle) {
  const auto stain = [](float x, float z) {
    const bool reaches = x > 0.3f && x < 0.5f && std::abs(z) < 0.07f;
    return std::hypot(x - 0.56f, z) < 0.2f ? 0.5f : reaches ? 0.3f : 1.0f;
  };
  EXPECT_TRUE(ShadowedBlock(stain).shadow().empty());
}

TEST(Shadow, DoesNotDarkenAwayFromThePart) {
  const auto edge_of_a_board = [](float x, float z) {
    return beside_block(x, z) == 1 ? 1.0f : x < 0.4f ? 0.85f : 0.25f;
  };
  EXPECT_TRUE(ShadowedBlock(edge_of_a_board).shadow().empty());
  const auto fading = [](float x, float z) { return beside_block(x, z) == 1 ? 1.0f : x < 0.4f ? 0.25f : 0.85f; };
  EXPECT_FALSE(ShadowedBlock(fading).shadow().empty());
}

TEST(Shadow, IsFoundWhereItRunsIntoAnotherDarkThing) {
  const auto both = [](float x, float z) {
    const bool joins = x > 0.55f && x < 1.3f && std::abs(z) < 0.12f;
    const bool other = x > 1.15f && x < 1.5f;
    return joins || other ? 0.6f : beside_block(x, z);
  };
  const Shadow shadow = ShadowedBlock(both).shadow();
  EXPECT_NEAR(brightness(shadow, in_shadow), 0.6f, 0.06f);
}

TEST(Shadow, IsNotWhatIsBrighter) {
  const auto gleam = [](float x, float z) { return beside_block(x, z) < 1 ? 1.3f : 1.0f; };
  EXPECT_TRUE(ShadowedBlock(gleam).shadow().empty());
}

TEST(Shadow, IsTheSameInScenesOfAnySizeAnywhere) {
  for (const double scale : {0.1, 1e3}) {
    SCOPED_TRACE(scale);
    const Shadow shadow = ShadowedBlock(beside_block).placed(scale, {}).shadow();
    EXPECT_NEAR(brightness(shadow, scale * in_shadow), 0.6f, 0.06f);
    EXPECT_EQ(brightness(shadow, scale * far_away), 1);
  }
  // A float holds a position there to a sixteenth.
  const DVec3 shift(1e6, -1e6, 1e6);
  const Shadow shadow = ShadowedBlock(beside_block).placed(100, shift).shadow();
  EXPECT_NEAR(brightness(shadow, 100.0 * in_shadow + shift), 0.6f, 0.1f);
}

TEST(Shadow, OfAPartWithoutExtentOrThatNobodySeesIsNone) {
  ShadowedBlock scene(beside_block);
  scene.part.resize(1);
  EXPECT_TRUE(scene.shadow().empty());
  scene.part.clear();
  EXPECT_TRUE(scene.shadow().empty());
  ShadowedBlock unseen(beside_block);
  unseen.block.cameras.clear();
  EXPECT_TRUE(unseen.shadow().empty());
  EXPECT_EQ(brightness(unseen.shadow(), in_shadow), 1);
}

TEST(AroundPart, LookingForThemCanBeEnded) {
  const ShadowedBlock scene(beside_block);
  const auto ended = look_around(scene.block.cloud, scene.part, scene.block.cameras, [](double part) {
    return part > 0.5 ? Result<void>(fail(ErrorCode::cancelled, "enough")) : Result<void>();
  });
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::cancelled);
}

}  // namespace
}  // namespace engine::repair
