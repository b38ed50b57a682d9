#include "engine/repair/tinged.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/repair/relight.h"
#include "engine/scene/base_color.h"
#include "engine/scene/sh.h"
#include "tests/engine/edit/backed.h"
#include "tests/engine/edit/interrupted.h"

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
    const Tinged found = tinged_among(wall.cloud, wall.rows, wall.known, false);
    ASSERT_EQ(found.rows, Rows{wall.rows[0]});
    for (const std::uint32_t like : found.like[0])
      EXPECT_LT(glm::distance(scene::base_color(wall.cloud, like), gray), 1e-6f)
          << "which is nearer to cyan than a rose";
  }
}

TEST(Tinged, IsNothingWhereNothingIsKnown) {
  const Wall wall;
  EXPECT_TRUE(tinged_among(wall.cloud, wall.rows, {}, false).rows.empty());
  EXPECT_TRUE(tinged_among(wall.cloud, wall.rows, std::span(wall.known).first(colors_alike - 1), false).rows.empty());
  EXPECT_TRUE(tinged_among(wall.cloud, {}, wall.known, false).rows.empty());
  EXPECT_EQ(tinged_among(wall.cloud, wall.rows, std::span(wall.known).last(colors_alike), false).rows.size(), 2u);
}

TEST(Tinged, IsNotWhatIsOnlyDarkerWhereShadeStays) {
  Wall wall;
  constexpr Vec3 black{0, 0, 0};
  for (const Vec3 color : {0.4f * gray, 0.5f * rose, 1.6f * gray, black}) {
    wall.add(DVec3(0.25, 0.26, 0), color, 0.3f);
    wall.rows.push_back(std::uint32_t(wall.cloud.size() - 1));
  }
  const Rows& rows = wall.rows;
  EXPECT_EQ(tinged_among(wall.cloud, rows, wall.known, false).rows,
            (Rows{rows[0], rows[3], rows[4], rows[5], rows[6]}));
  EXPECT_EQ(tinged_among(wall.cloud, rows, wall.known, true).rows, (Rows{rows[0], rows[5]})) << "cyan, and too light";

  Wall shadowed;  // in part, where a row of it is redder
  for (const std::uint32_t row : shadowed.known)
    if (shadowed.cloud.mean.get(row).x < 0.45f)
      for (std::size_t c = 0; c < 3; ++c)
        shadowed.cloud.sh_row(row)[c * scene::sh_coefficients(1)] = (0.25f - 0.5f) / float(scene::sh_c0);
  shadowed.add(DVec3(0.42, 0.55, 0), {0.5f, 0.25f, 0.25f}, 0);
  const Tinged red = tinged_among(shadowed.cloud, Rows{std::uint32_t(shadowed.cloud.size() - 1)}, shadowed.known, true);
  ASSERT_EQ(red.rows.size(), 1u);
  for (const std::uint32_t like : red.like[0])
    EXPECT_NEAR(scene::base_color(shadowed.cloud, like).x, 0.25f, 1e-6f) << "it stays in the shadow";

  Wall dark;  // of black there is no less
  for (const std::uint32_t row : dark.known) std::ranges::fill(dark.cloud.sh_row(row), 0.0f);
  for (const std::uint32_t row : dark.known)
    for (std::size_t c = 0; c < 3; ++c)
      dark.cloud.sh_row(row)[c * scene::sh_coefficients(1)] = -0.5f / float(scene::sh_c0);
  EXPECT_EQ(tinged_among(dark.cloud, dark.rows, dark.known, true).rows, dark.rows);
}

TEST(Tinged, IsTheSameForAnyNumberOfThreads) {
  Wall wall;
  for (int i = 0; i < 300; ++i) {  // several chunks of queries, many of them alike
    wall.add(DVec3(0.003 * (i % 100), 0.26, 0), i % 3 == 0 ? gray : cyan, 0.3f);
    wall.rows.push_back(std::uint32_t(wall.cloud.size() - 1));
  }
  Tinged one, many;
  WorkArena(1).run([&] { one = tinged_among(wall.cloud, wall.rows, wall.known, false); });
  WorkArena(3).run([&] { many = tinged_among(wall.cloud, wall.rows, wall.known, false); });
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

TEST(Recolour, TakesColorsInTheNewLightOnce) {
  const Wall wall;
  WorkingScene working(wall.cloud, {}, working::HandleColumn(wall.cloud.size()));
  const Like like{5, 15, 25, 35};  // gray
  // Both lay in a shadow that goes.
  relight(working, {{5, 15, 25, 35, wall.rows[0]}, std::vector<Vec3>(5, Vec3(1.5f))});
  recolour(working, {{wall.rows[0]}, {like}});
  EXPECT_LT(glm::distance(scene::base_color(working.cloud(), wall.rows[0]), 1.5f * gray), 1e-5f);
  EXPECT_EQ(working.role()[wall.rows[0]], working::Role::relit);
}

/// A red thing, beside which a part of the white wall has another colour. Once it has it elsewhere, too.
struct Outlined : edit::BackedThing {
  std::uint32_t ring = 0;  ///< The first of the three rows.
  Vec3 color;
  explicit Outlined(bool is_drawn = false, Vec3 of_ring = cyan) : color(of_ring) {
    ring = std::uint32_t(cloud.size());
    for (int i = -1; i <= 1; ++i)
      edit::add_gaussian(cloud, {-0.40f, 0.07f * float(i), 0.39f}, {0.035f, 0.035f, 0.004f}, 4, color);
    for (int i = -2; is_drawn && i <= 2; ++i)
      edit::add_gaussian(cloud, {-0.55f, 0.07f * float(i), 0.39f}, {0.035f, 0.035f, 0.004f}, 4, color);
  }
  /// The ring's once the thing has gone; `color` where the edit has left it alone.
  [[nodiscard]] Vec3 color_after() const {
    correct::SceneCorrector corrector;
    const auto outcome = edit::run(cloud, cameras, request, {.corrector = &corrector});
    if (!outcome) {
      ADD_FAILURE() << outcome.error().message;
      return Vec3(0);
    }
    const scene::Overlay& overlay = outcome->overlay;
    const auto found = std::ranges::lower_bound(overlay.changed, ring);
    const bool is_changed = found != overlay.changed.end() && *found == ring;
    return is_changed ? scene::base_color(overlay.rows, std::size_t(found - overlay.changed.begin()))
                      : scene::base_color(cloud, ring);
  }
  /// How much bluer than red that is; 0.4 as it was.
  [[nodiscard]] float hue_after() const {
    const Vec3 after = color_after();
    return after.z - after.x;
  }
};

TEST(Tinged, AroundAThingThatLeavesGetsTheColorOfTheWall) {
  Outlined outlined;
  EXPECT_LT(outlined.hue_after(), 0.1f);
  outlined.request.params.intervals = 2;
  EXPECT_LT(outlined.hue_after(), 0.1f);
  outlined.request.mode = edit::Mode::remove;
  outlined.request.handles[0].target.reset();
  outlined.request.params.intervals = 1;
  EXPECT_LT(outlined.hue_after(), 0.1f);
}

TEST(Tinged, StaysWhereItIsAskedFor) {
  Outlined outlined;
  outlined.request.crumbs = edit::Crumbs::keep;
  EXPECT_NEAR(outlined.hue_after(), 0.4f, 0.05f);
  outlined.request.crumbs = edit::Crumbs::move;
  outlined.request.region = edit::Region{DVec3(0, 0, 0), DVec3(2, 2, 0.6)};
  EXPECT_NEAR(outlined.hue_after(), 0.4f, 0.05f) << "outside of the region";
}

TEST(Tinged, IsNotAShadowThatIsToStay) {
  Outlined outlined(false, Vec3{0.4f, 0.4f, 0.375f});
  EXPECT_NEAR(outlined.color_after().x, 0.8f, 0.05f);
  outlined.request.shadow = edit::ShadowOfPart::keep;
  EXPECT_NEAR(outlined.color_after().x, 0.4f, 0.05f);
}

TEST(Tinged, IsNotWhatIsDrawnOnTheWall) { EXPECT_GT(Outlined(true).hue_after(), 0.3f); }

TEST(Tinged, TakesNoColorFromWhatIsHealed) {
  Outlined outlined(true);  // stained by the same colour elsewhere
  for (std::uint32_t row = outlined.ring + 3; row < outlined.cloud.size(); ++row)
    outlined.request.healed.push_back(row);
  EXPECT_LT(outlined.hue_after(), 0.1f);
}

TEST(Tinged, IsTheSameAfterAnInterruption) { edit::expect_same_after_an_interruption(Outlined()); }

}  // namespace
}  // namespace engine::repair
