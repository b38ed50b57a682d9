#include "engine/select/repeat.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

constexpr double anywhere = std::numeric_limits<double>::infinity();
constexpr float ring = 0.05f;  // distance of one ring of Gaussians to the next

/// Rings of Gaussians around the x axis, the first one at x = 0.
scene::GaussianCloud tube(int rings, const std::function<float(float)>& radius, const std::function<Vec3(float)>& color,
                          DVec3 origin = DVec3(0)) {
  scene::GaussianCloud cloud;
  for (int k = 0; k < rings; ++k)
    for (int a = 0; a < 24; ++a) {
      const float x = ring * float(k), angle = 2 * std::numbers::pi_v<float> * float(a) / 24;
      const Vec3 on_ring(x, radius(x) * std::cos(angle), radius(x) * std::sin(angle));
      add_at(cloud, Vec3(origin) + on_ring, 4, std::log(0.6f * ring), color(x));
    }
  return cloud;
}

float straight(float) { return 0.2f; }
Vec3 grey(float) { return Vec3(0.5f); }
/// Rings of three colours, each two rings wide: 0.3 all in all.
Vec3 stripes(float x) {
  const int stripe = int(std::floor(x / (2 * ring) + 0.25f)) % 3;
  return stripe == 0 ? Vec3(0.9f, 0.1f, 0.1f) : stripe == 1 ? Vec3(0.9f) : Vec3(0.1f, 0.2f, 0.7f);
}

struct Found {
  std::vector<std::uint32_t> part;
  std::optional<Repeat> repeat;
};

/// What is beyond `from` is pulled along x.
Found find_beyond(const scene::GaussianCloud& cloud, float from, DVec3 pull = {1, 0, 0}, double limit = anywhere) {
  const scene::LayeredCloud scene{std::make_shared<const scene::GaussianCloud>(cloud), nullptr};
  Found out;
  for (std::uint32_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x > from) out.part.push_back(row);
  out.repeat = find_repeat(scene, out.part, contact_of(scene, out.part, out.part).touches, pull, limit);
  return out;
}

/// How many of the pattern's lengths the step is.
double patterns(const Repeat& repeat) { return repeat.step.x / 0.3; }

TEST(FindRepeat, FindsThePatternOfAPole) {
  const auto [part, repeat] = find_beyond(tube(60, straight, stripes), 2.02f, {0.4, 0, 0}, 2.2);
  ASSERT_TRUE(repeat);
  EXPECT_NEAR(patterns(*repeat), std::round(patterns(*repeat)), 0.1);
  EXPECT_GE(patterns(*repeat), 0.9);
  EXPECT_EQ(repeat->step.y, 0);
  EXPECT_TRUE(std::ranges::is_sorted(repeat->tile));
  ASSERT_EQ(repeat->tile.size(), repeat->depth.size());
  const auto [least, most] = std::ranges::minmax(repeat->depth);
  EXPECT_GT(least, 0);
  EXPECT_LE(most - least, glm::length(repeat->step));
  // As many rings as the period has room for, whole.
  EXPECT_NEAR(double(repeat->tile.size()), 24 * glm::length(repeat->step) / double(ring), 24.5);
}

TEST(FindRepeat, APlainPoleHasAnyPeriod) { EXPECT_TRUE(find_beyond(tube(60, straight, grey), 2.02f).repeat); }

TEST(FindRepeat, ACutBeyondTheBorderLeavesToTheRestWhatGoesOn) {
  // A red knob at the end of a striped pole, selected with four rings of the pole.
  const auto knob = [](float x) { return x < 2.4f; };
  const auto cloud = tube(
      56, [&](float x) { return knob(x) ? 0.2f : 0.3f; },
      [&](float x) { return knob(x) ? stripes(x) : Vec3(0, 0.6f, 0); });
  const auto [part, repeat] = find_beyond(cloud, 2.18f);
  ASSERT_TRUE(repeat);
  EXPECT_GE(repeat->stays.size(), 2u * 24);  // a slab may reach into the knob
  for (const std::uint32_t row : repeat->stays) {
    EXPECT_TRUE(std::ranges::binary_search(part, row));
    EXPECT_TRUE(knob(cloud.mean.get(row).x)) << row;
  }
}

TEST(FindRepeat, WhatEndsThePoleIsNotRepeated) {
  // A black ring before the knob, of two rings of Gaussians.
  const auto cloud = tube(56, straight, [&](float x) {
    return x < 2.08f ? stripes(x) : x < 2.18f ? Vec3(0) : Vec3(0, 0.6f, 0);
  });
  const auto [part, repeat] = find_beyond(cloud, 2.18f);
  ASSERT_TRUE(repeat);
  EXPECT_TRUE(repeat->stays.empty());
  EXPECT_GE(repeat->tile.size(), 24u * 4);
  for (std::size_t k = 0; k < repeat->tile.size(); ++k) {
    EXPECT_LT(cloud.mean.get(repeat->tile[k]).x, 2.08f + 0.5f * ring) << repeat->tile[k];
    EXPECT_GT(repeat->depth[k], ring);
  }
}

TEST(FindRepeat, TheCutIsNotBeyondTheLimit) {
  const auto cloud = tube(60, straight, stripes);
  const auto [part, repeat] = find_beyond(cloud, 2.02f, {1, 0, 0}, 2.3);
  ASSERT_TRUE(repeat);
  EXPECT_FALSE(repeat->stays.empty());
  for (const std::uint32_t row : repeat->stays) EXPECT_LE(cloud.mean.get(row).x, 2.3f);
}

TEST(FindRepeat, WhatTapersDoesNotRepeat) {
  EXPECT_FALSE(find_beyond(tube(
                               60, [](float x) { return 0.8f - 0.25f * x; }, grey),
                           2.02f)
                   .repeat);
}

TEST(FindRepeat, ColoursThatChangeAllAlongDoNotRepeat) {
  EXPECT_FALSE(find_beyond(tube(60, straight, [](float x) { return Vec3(x / 3, 1 - x / 3, 0.5f); }), 2.02f).repeat);
  const auto changing = [](float x) { return Vec3(x / 3, 1 - x / 3, 0.5f + 0.5f * std::sin(9 * x * x)); };
  EXPECT_FALSE(find_beyond(tube(60, straight, changing), 2.02f).repeat);
}

TEST(FindRepeat, AcrossAPoleNothingRepeats) {
  EXPECT_FALSE(find_beyond(tube(60, straight, stripes), 2.02f, {0, 1, 0}).repeat);
}

TEST(FindRepeat, WhatTouchesNothingGrowsOutOfNothing) {
  scene::GaussianCloud cloud = tube(20, straight, grey);
  add_at(cloud, {50, 0, 0});
  EXPECT_FALSE(find_beyond(cloud, 40).repeat);
}

TEST(FindRepeat, IsTheSameFarFromTheOrigin) {
  // 1024 away floats are 1/8192 apart: a four-hundredth of a ring.
  const auto near = find_beyond(tube(60, straight, stripes), 2.02f).repeat;
  const auto far = find_beyond(tube(60, straight, stripes, DVec3(1024, -1024, 512)), 1026.02f).repeat;
  ASSERT_TRUE(near && far);
  EXPECT_NEAR(near->step.x, far->step.x, 0.01);
  EXPECT_EQ(near->tile.size(), far->tile.size());
}

TEST(FindRepeat, RowsInOnePlaceAreNoSurface) {
  scene::GaussianCloud cloud;
  for (int k = 0; k < 40; ++k) add_at(cloud, {0, 0, 0});
  add_at(cloud, {0.01f, 0, 0});
  EXPECT_FALSE(find_beyond(cloud, 0.005f).repeat);
  scene::GaussianCloud doubled = tube(60, straight, grey);  // and others all along
  for (int k = 0; k < 60 * 24 + 40; ++k) add_at(doubled, {1, 0.2f, 0});
  find_beyond(doubled, 2.02f);  // ends
}

}  // namespace
}  // namespace engine::select
