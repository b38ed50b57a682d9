#include "engine/repair/tinged.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/scene/base_color.h"
#include "engine/scene/sh.h"
#include "tests/engine/edit/backed.h"

namespace engine::repair {
namespace {

using Rows = std::vector<std::uint32_t>;

constexpr Vec3 gray{0.5f, 0.5f, 0.5f}, rose{0.8f, 0.4f, 0.5f}, cyan{0.4f, 0.8f, 0.8f};

/// A wall with a rose on it, and three rows of it that may be tinged.
struct Wall {
  scene::GaussianCloud cloud;
  Rows known, rows;
  explicit Wall(DVec3 at = DVec3(0)) {
    cloud.sh_degree = 1;
    for (int i = 0; i < 10; ++i)
      for (int k = 0; k < 10; ++k) {
        const bool is_rose = i < 3 && k < 3;
        add(at + DVec3(0.1 * i, 0.1 * k, 0), is_rose ? rose : gray, 0.01f * float(k));
        known.push_back(std::uint32_t(cloud.size() - 1));
      }
    for (const Vec3 color : {cyan, rose, gray}) {
      add(at + DVec3(0.25, 0.26, 0), color, 0.3f);
      rows.push_back(std::uint32_t(cloud.size() - 1));
    }
  }
  void add(DVec3 mean, Vec3 color, float in_band_1) {
    edit::add_gaussian(cloud, Vec3(mean), {0.05f, 0.05f, 0.01f}, 3, color);
    const std::span<float> sh = cloud.sh_row(cloud.size() - 1);
    for (std::size_t c = 0; c < 3; ++c) sh[c * scene::sh_coefficients(1) + 2] = in_band_1;
  }
};

TEST(Tinged, IsWhatHasAColorThatNothingAroundItHas) {
  for (const DVec3 at : {DVec3(0), DVec3(1e4, -3e4, 1e3)}) {
    const Wall wall(at);
    const Tinged found = tinged_among(wall.cloud, wall.rows, wall.known);
    ASSERT_EQ(found.rows, Rows{wall.rows[0]});
    for (const std::uint32_t like : found.like[0])
      EXPECT_LT(glm::distance(scene::base_color(wall.cloud, like), gray), 1e-6f)
          << "which is nearer to cyan than a rose";
  }
}

TEST(Tinged, IsNothingWhereNothingIsKnown) {
  const Wall wall;
  EXPECT_TRUE(tinged_among(wall.cloud, wall.rows, {}).rows.empty());
  EXPECT_TRUE(tinged_among(wall.cloud, wall.rows, std::span(wall.known).first(colors_alike - 1)).rows.empty());
  EXPECT_TRUE(tinged_among(wall.cloud, {}, wall.known).rows.empty());
  EXPECT_EQ(tinged_among(wall.cloud, wall.rows, std::span(wall.known).last(colors_alike)).rows.size(), 2u);
}

TEST(Tinged, IsTheSameForAnyNumberOfThreads) {
  Wall wall;
  for (int i = 0; i < 300; ++i) {  // several chunks of queries, many of them alike
    wall.add(DVec3(0.003 * (i % 100), 0.26, 0), i % 3 == 0 ? gray : cyan, 0.3f);
    wall.rows.push_back(std::uint32_t(wall.cloud.size() - 1));
  }
  Tinged one, many;
  WorkArena(1).run([&] { one = tinged_among(wall.cloud, wall.rows, wall.known); });
  WorkArena(3).run([&] { many = tinged_among(wall.cloud, wall.rows, wall.known); });
  EXPECT_EQ(one.rows.size(), 201u);
  EXPECT_EQ(one.rows, many.rows);
  EXPECT_EQ(one.like, many.like);
}

TEST(Recolour, TakesTheMeanOfAllBandsAndTouchesNothingThatMoves) {
  const Wall wall;
  working::HandleColumn handle(wall.cloud.size());
  handle[wall.rows[1]] = 1;
  WorkingScene working(wall.cloud, {}, std::move(handle));
  const Like like{0, 1, 2, 3};  // of a rose the first three
  recolour(working, {{wall.rows[0], wall.rows[1]}, {like, like}});
  EXPECT_EQ(working.role()[wall.rows[0]], working::Role::relit);
  const Vec3 color = scene::base_color(working.cloud(), wall.rows[0]);
  EXPECT_LT(glm::distance(color, (3.0f * rose + gray) / 4.0f), 1e-5f);
  const std::size_t bands = scene::sh_coefficients(1);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(working.cloud().sh_row(wall.rows[0])[c * bands + 2], 0.015f, 1e-6f);
  EXPECT_EQ(scene::base_color(working.cloud(), wall.rows[1]), scene::base_color(wall.cloud, wall.rows[1]));
  EXPECT_TRUE(working.check());
}

/// A red thing, beside which a part of the white wall is cyan. Once the wall has a cyan part elsewhere, too.
struct Outlined : edit::BackedThing {
  std::uint32_t ring = 0;  ///< The first of the three rows.
  explicit Outlined(bool is_drawn) {
    ring = std::uint32_t(cloud.size());
    for (int i = -1; i <= 1; ++i)
      edit::add_gaussian(cloud, {-0.40f, 0.07f * float(i), 0.39f}, {0.035f, 0.035f, 0.004f}, 4, cyan);
    for (int i = -2; is_drawn && i <= 2; ++i)
      edit::add_gaussian(cloud, {-0.55f, 0.07f * float(i), 0.39f}, {0.035f, 0.035f, 0.004f}, 4, cyan);
  }
  /// How much bluer than red the ring is once the thing has gone; 0.4 as it was.
  [[nodiscard]] float hue_after(edit::Crumbs crumbs) const {
    edit::Request asked = request;
    asked.crumbs = crumbs;
    correct::SceneCorrector corrector;
    const auto outcome = edit::run(cloud, cameras, asked, {.corrector = &corrector});
    if (!outcome) {
      ADD_FAILURE() << outcome.error().message;
      return 0;
    }
    const scene::Overlay& overlay = outcome->overlay;
    const auto found = std::ranges::lower_bound(overlay.changed, ring);
    const bool is_changed = found != overlay.changed.end() && *found == ring;
    const Vec3 color = is_changed ? scene::base_color(overlay.rows, std::size_t(found - overlay.changed.begin()))
                                  : scene::base_color(cloud, ring);
    return color.z - color.x;
  }
};

TEST(Tinged, AroundAThingThatLeavesGetsTheColorOfTheWall) {
  const Outlined outlined(false);
  EXPECT_LT(outlined.hue_after(edit::Crumbs::move), 0.1f);
  EXPECT_NEAR(outlined.hue_after(edit::Crumbs::keep), 0.4f, 0.05f) << "as asked for";
}

TEST(Tinged, IsNotWhatIsDrawnOnTheWall) { EXPECT_GT(Outlined(true).hue_after(edit::Crumbs::move), 0.3f); }

}  // namespace
}  // namespace engine::repair
