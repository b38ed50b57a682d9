#include "engine/deform/body.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::deform {
namespace {

using std::numbers::pi;

/// A round bar along x from `from`, of that many rings of 16 Gaussians.
void add_bar(scene::GaussianCloud& cloud, DVec3 from, int rings, double step, double radius) {
  Rng rng(7, 0);
  for (int ring = 0; ring < rings; ++ring)
    for (int k = 0; k < 16; ++k) {
      const std::size_t row = cloud.size();
      cloud.resize(row + 1);
      const double angle = 2 * pi * (k + 0.5 * (ring % 2)) / 16;
      const DVec3 jitter = 0.05 * step * DVec3(rng.normal(), rng.normal(), rng.normal());
      cloud.mean.set(row, Vec3(from + jitter + DVec3(ring * step, radius * std::cos(angle), radius * std::sin(angle))));
      cloud.log_scale.set(row, Vec3(float(std::log(0.5 * step))));
      cloud.rotation.set(row, {1, 0, 0, 0});
    }
}

scene::GaussianCloud bar(DVec3 from = DVec3(0.0), double size = 1) {
  scene::GaussianCloud cloud;
  add_bar(cloud, from, 60, 0.1 * size, 0.25 * size);
  return cloud;
}

std::vector<std::uint32_t> all_rows(const scene::GaussianCloud& cloud) {
  std::vector<std::uint32_t> rows(cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

std::vector<std::uint8_t> held_left_of(const scene::GaussianCloud& cloud, double x) {
  std::vector<std::uint8_t> held;
  for (std::size_t row = 0; row < cloud.size(); ++row) held.push_back(double(cloud.mean.get(row).x) < x);
  return held;
}

/// The bar's left end held, its right end dragged.
Deformation bent(const scene::GaussianCloud& cloud, Drag drag, double held_to = 0.25) {
  const auto rows = all_rows(cloud);
  return Body(cloud, rows, std::vector{drag}, held_left_of(cloud, held_to)).follow(cloud, std::vector{drag});
}

const DVec3 tip(5.9, 0.25, 0);

TEST(Body, HoldsWhatIsHeldToTheBitAndTakesTheHandleToItsTarget) {
  const auto cloud = bar();
  const DVec3 target(4.5, 3, 0);
  const Deformation found = bent(cloud, {.source = tip, .target = target});
  std::size_t held = 0, near_tip = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    const Vec3 mean = cloud.mean.get(row);
    if (mean.x < 0.25f) {
      EXPECT_EQ(found.mean.get(row), mean) << row;
      EXPECT_EQ(found.moves[row], 0) << row;
      ++held;
    }
    if (glm::distance(DVec3(mean), tip) > 0.1) continue;
    EXPECT_LT(glm::distance(DVec3(found.mean.get(row)), target), 0.15);
    ++near_tip;
  }
  EXPECT_GT(held, 0u);
  EXPECT_GT(near_tip, 0u);
}

TEST(Body, OfFewRowsHoldsThemToTheBit) {
  scene::GaussianCloud cloud;
  add_bar(cloud, DVec3(0.0), 20, 0.1, 0.25);
  const Deformation found = bent(cloud, {.source = DVec3(1.9, 0.25, 0), .target = DVec3(1.4, 1, 0)});
  std::size_t held = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x < 0.25f) {
      ++held;
      EXPECT_EQ(found.mean.get(row), cloud.mean.get(row)) << row;
    }
  EXPECT_GT(held, 30u);
}

TEST(Body, TakesEveryHandleToItsTargetHoweverFarAnotherGrips) {
  const auto cloud = bar();
  const auto rows = all_rows(cloud);
  std::vector<Drag> drags{{.source = tip, .target = tip + DVec3(0, 1, 0), .grip = 2},
                          {.source = tip - DVec3(0.6, 0, 0), .target = tip + DVec3(-0.6, -0.5, 0), .grip = 0.05}};
  for (int order = 0; order < 2; ++order) {
    const Deformation found = Body(cloud, rows, drags, held_left_of(cloud, 0.25)).follow(cloud, drags);
    for (const Drag& drag : drags) {
      double nearest = 1e9;
      DVec3 went(0.0);
      for (std::size_t row = 0; row < cloud.size(); ++row)
        if (const double d = glm::distance(DVec3(cloud.mean.get(row)), drag.source); d < nearest)
          nearest = d, went = DVec3(found.mean.get(row)) - DVec3(cloud.mean.get(row));
      EXPECT_LT(glm::distance(went, drag.target - drag.source), 0.25) << order;
    }
    std::swap(drags[0], drags[1]);
  }
}

TEST(Body, TearsNowhere) {
  const auto cloud = bar();
  const Deformation found = bent(cloud, {.source = tip, .target = DVec3(4.5, 3, 0)});
  for (std::size_t row = 16; row < cloud.size(); ++row) {  // to the same place of the ring before
    const double before = glm::distance(DVec3(cloud.mean.get(row)), DVec3(cloud.mean.get(row - 16)));
    const double now = glm::distance(DVec3(found.mean.get(row)), DVec3(found.mean.get(row - 16)));
    EXPECT_LT(now, 1.8 * before) << row;
    EXPECT_GT(now, 0.4 * before) << row;
  }
}

TEST(Body, ThatNothingHoldsGoesAsOnePiece) {
  const auto cloud = bar();
  const Drag drag{.source = tip, .target = tip + DVec3(1, 2, 3)};
  const Deformation found = bent(cloud, drag, -1);
  for (std::size_t row = 0; row < cloud.size(); ++row)
    EXPECT_LT(glm::distance(DVec3(found.mean.get(row)) - DVec3(cloud.mean.get(row)), DVec3(1, 2, 3)), 1e-4) << row;
}

TEST(Body, TurnsByMoreThanHalfATurn) {
  const auto cloud = bar();
  const double angle = 1.5 * pi;
  Drag drag{.source = DVec3(5.9, 0, 0), .target = DVec3(5.9, 0, 0)};
  drag.turn = DQuat(std::cos(angle / 2), std::sin(angle / 2), 0, 0);
  drag.grip = 0.6;
  const Deformation found = bent(cloud, drag);
  // Each ring is turned the long way, by its share: at a third of the bar by about 90 degrees, and not by -30.
  double sum = 0;
  for (std::size_t row = 20 * 16; row < 21 * 16; ++row) {
    const DVec3 before(cloud.mean.get(row)), now(found.mean.get(row));
    sum += std::remainder(std::atan2(now.z, now.y) - std::atan2(before.z, before.y), 2 * pi) / 16;
  }
  EXPECT_GT(sum, 0.25 * pi);
  EXPECT_LT(sum, 0.75 * pi);
}

TEST(Body, StretchesItsGaussiansWithItself) {
  const auto cloud = bar();
  const Deformation found = bent(cloud, {.source = tip, .target = tip + DVec3(3, 0, 0), .grip = 0.3});
  std::size_t longer = 0;
  scene::GaussianCloud moved = cloud;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    apply(found, row, true, moved, row);
    const Vec3 scale = moved.log_scale.get(row);
    longer += std::max({scale.x, scale.y, scale.z}) > cloud.log_scale.get(row).x + std::log(1.2f);
  }
  EXPECT_GT(longer, cloud.size() / 2);
}

TEST(Body, TakesPiecesWithoutAHandleAlong) {
  auto cloud = bar();
  const std::size_t first = cloud.size();
  add_bar(cloud, DVec3(0, 1.2, 0), 60, 0.1, 0.25);
  const Drag drag{.source = tip, .target = tip + DVec3(0, 0, 2)};
  const Deformation found = bent(cloud, drag, -1);
  for (std::size_t row = first; row < cloud.size(); ++row)
    EXPECT_LT(glm::distance(DVec3(found.mean.get(row)) - DVec3(cloud.mean.get(row)), DVec3(0, 0, 2)), 0.02) << row;
}

TEST(Body, OfFewGaussiansStillMoves) {
  for (const std::uint32_t n : {1u, 2u, 5u}) {
    SCOPED_TRACE(n);
    const auto cloud = bar();
    std::vector<std::uint32_t> rows(n);
    std::iota(rows.begin(), rows.end(), 0u);
    const DVec3 at(cloud.mean.get(0));
    const std::vector<Drag> drags{{.source = at, .target = at + DVec3(1, 0, 0)}};
    const Deformation found = Body(cloud, rows, drags, std::vector<std::uint8_t>(n, 0)).follow(cloud, drags);
    for (std::uint32_t k = 0; k < n; ++k)
      EXPECT_LT(glm::distance(DVec3(found.mean.get(k)) - DVec3(cloud.mean.get(k)), DVec3(1, 0, 0)), 1e-4) << k;
  }
}

TEST(Body, TakesHandlesInOnePlace) {
  const auto cloud = bar();
  const auto rows = all_rows(cloud);
  const std::vector<Drag> drags{{.source = tip, .target = tip + DVec3(0, 1, 0)},
                                {.source = tip, .target = tip + DVec3(0, 0, 1)}};
  const Deformation found = Body(cloud, rows, drags, held_left_of(cloud, 0.25)).follow(cloud, drags);
  for (std::size_t row = 0; row < cloud.size(); ++row) EXPECT_TRUE(std::isfinite(found.mean.get(row).x)) << row;
}

TEST(Body, HoldsAtAnySizeAndFarFromTheOrigin) {
  for (const double size : {1e-3, 1.0, 1e3}) {
    SCOPED_TRACE(size);
    const auto cloud = bar(DVec3(0.0), size);
    const Deformation found = bent(cloud, {.source = size * tip, .target = size * DVec3(4.5, 3, 0)}, 0.25 * size);
    const auto one = bent(bar(), {.source = tip, .target = DVec3(4.5, 3, 0)});
    for (std::size_t row = 0; row < cloud.size(); row += 97)
      EXPECT_LT(glm::distance(DVec3(found.mean.get(row)), size * DVec3(one.mean.get(row))), 0.02 * size) << row;
  }
  const DVec3 far(1e6, -1e6, 1e6);  // where floats are 0.06 apart
  const auto cloud = bar(far, 1e3), near = bar(DVec3(0.0), 1e3);
  const auto moved = [](const scene::GaussianCloud& of, DVec3 origin) {
    return bent(of, {.source = origin + 1e3 * tip, .target = origin + 1e3 * DVec3(4.5, 3, 0)}, origin.x + 250);
  };
  const Deformation there = moved(cloud, far), here = moved(near, DVec3(0.0));
  for (std::size_t row = 0; row < cloud.size(); row += 97)
    EXPECT_LT(glm::distance(DVec3(there.mean.get(row)) - far, DVec3(here.mean.get(row))), 30) << row;
}

TEST(Body, GrowsAndShrinksByALot) {
  const auto cloud = bar();
  for (const double scale : {1e-3, 1e3}) {
    SCOPED_TRACE(scale);
    Drag drag{.source = tip, .target = tip};
    drag.scale = scale, drag.grip = 0.5;
    const Deformation found = bent(cloud, drag);
    scene::GaussianCloud moved = cloud;
    for (std::size_t row = 0; row < cloud.size(); ++row) {
      apply(found, row, true, moved, row);
      EXPECT_TRUE(std::isfinite(glm::length(moved.mean.get(row)))) << row;
      EXPECT_TRUE(std::isfinite(glm::length(moved.log_scale.get(row)))) << row;
      EXPECT_NEAR(glm::length(moved.rotation.get(row)), 1, 1e-4) << row;
    }
  }
}

/// The bar with its left end held, its right end pulled.
Deformation drawn_out(const scene::GaussianCloud& cloud, DVec3 pull, double held_to = 0.25) {
  const std::vector<Drag> drags{{.source = tip, .target = tip + pull}};
  return Body(cloud, all_rows(cloud), drags, held_left_of(cloud, held_to)).draw_out(cloud, drags, pull);
}

TEST(DrawOut, StretchesBetweenWhatIsHeldAndTheHandle) {
  const auto cloud = bar();
  const DVec3 pull(3, 0, 0);
  const Deformation found = drawn_out(cloud, pull);
  scene::GaussianCloud moved = cloud;
  std::size_t stretched = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    const DVec3 before(cloud.mean.get(row)), after(found.mean.get(row));
    EXPECT_NEAR(after.y, before.y, 0.02) << row;
    EXPECT_NEAR(after.z, before.z, 0.02) << row;
    if (before.x < 0.25) {
      EXPECT_EQ(after, before) << row;
    } else if (before.x > 5.9) {
      EXPECT_NEAR(after.x, before.x + pull.x, 0.06) << row;
    } else {  // by its share of the way, as nodes see it
      EXPECT_NEAR(after.x - before.x, pull.x * (before.x - 0.25) / 5.65, 0.25) << row;
    }
    if (before.x < 1 || before.x > 5) continue;
    apply(found, row, true, moved, row);
    const Vec3 grown = moved.log_scale.get(row) - cloud.log_scale.get(row);
    const float most = std::max({grown.x, grown.y, grown.z});
    EXPECT_GT(most, 0.2f) << row;
    EXPECT_LT(most, 0.7f) << row;
    ++stretched;
  }
  EXPECT_GT(stretched, 500u);
}

TEST(DrawOut, TakesAllAlongIfNothingIsHeld) {
  const auto cloud = bar();
  const Deformation found = drawn_out(cloud, {3, 1, 0}, -1);
  for (std::size_t row = 0; row < cloud.size(); ++row)
    EXPECT_LT(glm::distance(DVec3(found.mean.get(row)), DVec3(cloud.mean.get(row)) + DVec3(3, 1, 0)), 1e-5) << row;
}

TEST(DrawOut, OfRowsInOnePlaceIsFinite) {
  scene::GaussianCloud cloud;
  add_bar(cloud, tip, 2, 0, 0);
  const auto found = drawn_out(cloud, {1e6, 0, 0}, 100);
  for (std::size_t row = 0; row < cloud.size(); ++row) EXPECT_TRUE(std::isfinite(found.mean.get(row).x)) << row;
}

TEST(Body, GivesTheSameBytesForAnyNumberOfThreads) {
  const auto cloud = bar();
  const auto with = [&](int threads) {
    Deformation found;
    WorkArena(threads).run([&] { found = bent(cloud, {.source = tip, .target = DVec3(4.5, 3, 0)}); });
    return found;
  };
  const Deformation one = with(1), three = with(3);
  EXPECT_EQ(one.mean, three.mean);
  EXPECT_EQ(one.rotation, three.rotation);
  EXPECT_EQ(one.map, three.map);
  EXPECT_EQ(one.moves, three.moves);
}

TEST(Body, TurnsAboutAnAnchorAsOnAHinge) {
  const auto cloud = bar();
  const auto rows = all_rows(cloud);
  const DVec3 hinge(0, 0, 0);
  const std::vector<Drag> drags{{.source = tip, .target = glm::angleAxis(0.8, DVec3(0, 0, 1)) * tip},
                                {.source = hinge, .target = hinge, .group = 0, .anchor = true}};
  const Deformation found = Body(cloud, rows, drags, std::vector<std::uint8_t>(rows.size(), 0)).follow(cloud, drags);
  for (std::size_t row = 0; row < cloud.size(); row += 13)
    EXPECT_LT(
        glm::distance(DVec3(found.mean.get(row)), glm::angleAxis(0.8, DVec3(0, 0, 1)) * DVec3(cloud.mean.get(row))),
        0.3)
        << row;
}

}  // namespace
}  // namespace engine::deform
