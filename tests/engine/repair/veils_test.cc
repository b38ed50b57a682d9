#include "engine/repair/veils.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/engine/edit/block.h"
#include "tests/engine/edit/drags.h"

namespace engine::repair {
namespace {

constexpr float faint = -3.2f;  // logit: of a twenty-fifth; where some overlap, of an eighth

constexpr Vec3 shown_floor_color{0.26f, 0.43f, 0.6f};  // between its Gaussians shines the dark below

/// Logit and height of what floats over an area, and its middle.
struct Haze {
  float logit = faint, height = 0.6f, x = 0.9f;
  Vec3 color = shown_floor_color;
  float extent = 0.05f;
};

/// A block that has moved over a floor before which something floats.
struct Arrival {
  edit::BlockScene block;
  scene::GaussianCloud original;
  WorkingScene working;
  std::vector<std::uint32_t> floating, left, arrived;

  explicit Arrival(const Haze& haze, double way = 0.9) {
    const std::size_t first = block.cloud.size();
    for (int i = -2; i <= 2; ++i)
      for (int k = -2; k <= 2; ++k)
        edit::add_gaussian(block.cloud, {haze.x + 0.06f * float(i), -haze.height, 0.06f * float(k)},
                           {haze.extent, 0.02f, haze.extent}, haze.logit, haze.color);
    floating.resize(block.cloud.size() - first);
    std::iota(floating.begin(), floating.end(), std::uint32_t(first));
    block.request.handles[0].target = block.middle + DVec3(way, 0, 0);
    original = block.cloud;
    working = edit::begun(block.cloud, block.request);
    arrived = edit::carry_out(working, block.request, 1).copies;
    left = working.rows_that_left();
  }
  [[nodiscard]] std::vector<std::uint32_t> veils() const {
    render::Workspace workspace;
    return veils_before(working, original, left, arrived, block.cameras, workspace);
  }
};

TEST(Veils, AreWhatFloatsBeforeTheFloorWhereThePartArrives) {
  const Arrival arrival(Haze{});
  EXPECT_EQ(arrival.veils(), arrival.floating) << "and nothing of the floor";
}

TEST(Veils, AreNoneBesideThePart) { EXPECT_TRUE(Arrival(Haze{.x = -0.9f}).veils().empty()); }

TEST(Veils, AreNoneThatNobodySees) { EXPECT_TRUE(Arrival(Haze{.logit = -5}).veils().empty()); }

TEST(Veils, AreNotWhatHidesThePart) {
  EXPECT_TRUE(Arrival(Haze{.logit = 5}).veils().empty()) << "it is a thing, and stands before the part";
}

TEST(Veils, AreNotWhatIsSeenBeforeTheFloor) {
  EXPECT_TRUE(Arrival(Haze{.color = {0.9f, 0.9f, 0.1f}}).veils().empty()) << "a net, say: people see it";
}

TEST(Veils, AreNotWhatMostlyHangsBesideThePart) {
  EXPECT_TRUE(Arrival(Haze{.logit = -4, .extent = 0.6f}).veils().empty());
}

TEST(Veils, AreNotLayersOfWhatThePartGrowsOutOf) {
  EXPECT_TRUE(Arrival(Haze{.x = 0.05f}, 0.1).veils().empty()) << "they were before the part already";
}

TEST(Veils, OfNothingAreNone) {
  const Arrival arrival(Haze{});
  render::Workspace workspace;
  const auto of = [&](std::span<const std::uint32_t> left, std::span<const std::uint32_t> arrived,
                      std::span<const scene::Camera> views) {
    return veils_before(arrival.working, arrival.original, left, arrived, views, workspace);
  };
  EXPECT_TRUE(of({}, arrival.arrived, arrival.block.cameras).empty());
  EXPECT_TRUE(of(arrival.left, {}, arrival.block.cameras).empty());
  EXPECT_TRUE(of(arrival.left, arrival.arrived, {}).empty()) << "nobody looks";
}

}  // namespace
}  // namespace engine::repair
