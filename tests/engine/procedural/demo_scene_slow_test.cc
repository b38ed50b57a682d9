#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/parallel.h"
#include "engine/procedural/demo_scene.h"

namespace engine::procedural {
namespace {

constexpr DemoOptions small{.gaussians = 2500, .views = 4, .width = 160, .height = 120};

TEST(DemoSceneOfAnySize, HasAboutTheNumberOfGaussiansAskedForAndAllAreFinite) {
  for (const std::size_t count : {2000, 20'000, 60'000}) {
    const DemoScene demo = make_demo_scene({.gaussians = count});
    EXPECT_NEAR(double(demo.cloud.size()), double(count), 0.01 * double(count));
    EXPECT_EQ(scene::first_not_finite(demo.cloud), std::nullopt);
    EXPECT_EQ(demo.object.size(), demo.cloud.size());
  }
}

TEST(DemoSceneOfAnySize, IsTheSameForAnyNumberOfThreadsAndAnotherForAnotherSeed) {
  const DemoScene demo = make_demo_scene(small);
  for (const int threads : {1, 4}) {
    DemoScene again;
    WorkArena(threads).run([&] { again = make_demo_scene(small); });
    EXPECT_TRUE(demo.cloud == again.cloud) << threads << " threads";
    EXPECT_EQ(demo.object, again.object);
  }
  DemoOptions other = small;
  other.seed = 1;
  EXPECT_FALSE(demo.cloud == make_demo_scene(other).cloud);
}

TEST(DemoSceneOfFullSize, HoldsItsNumberAndLeavesOutWhatIsHidden) {
  const DemoScene demo = make_demo_scene();
  EXPECT_NEAR(double(demo.cloud.size()), 150'000, 1'500);
  EXPECT_EQ(scene::first_not_finite(demo.cloud), std::nullopt);
  const auto& ball = demo.drags.front().handles.front();
  std::size_t near_contact = 0, ball_below = 0;
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    const Vec3 p = demo.cloud.mean.get(i);
    const double from_contact = std::hypot(double(p.x) - ball.source.x, double(p.z) - ball.source.z);
    near_contact += std::abs(p.y) < 0.01f && from_contact < 0.2 * ball.radius;
    ball_below += demo.object_names[demo.object[i]] == "ball" && p.y > -0.002f;  // seen from 10 degrees up at most
  }
  EXPECT_EQ(near_contact, 0u) << "the table right under the ball";
  EXPECT_EQ(ball_below, 0u) << "the foot of the ball";
}

}  // namespace
}  // namespace engine::procedural
