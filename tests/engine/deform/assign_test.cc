#include "engine/deform/assign.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::deform {
namespace {

Array3 points(std::initializer_list<Vec3> list) {
  Array3 out;
  for (const Vec3& p : list) out.push_back(p);
  return out;
}

TEST(Assign, TakesWhatIsStrictlyInsideTheSphere) {
  const float just_inside = std::nextafter(1.0f, 0.0f);
  const auto result =
      assign(points({{0, 0, 0}, {1, 0, 0}, {just_inside, 0, 0}, {2, 0, 0}}), std::vector<Sphere>{{DVec3(0), 1.0}});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->handle, (HandleColumn{1, 0, 1, 0}));
  EXPECT_EQ(result->count, (std::vector<std::size_t>{2}));
}

TEST(Assign, GivesAGaussianInSeveralSpheresToTheNearestHandleThenToTheLowerIndex) {
  const std::vector<Sphere> spheres{{DVec3(0), 3.0}, {DVec3(4, 0, 0), 3.0}};
  const auto result = assign(points({{0, 0, 0}, {1.5f, 0, 0}, {2, 0, 0}, {2.5f, 0, 0}}), spheres);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->handle, (HandleColumn{1, 1, 1, 2}));
}

TEST(Assign, TheNearestHandleCountsOnlyIfItsOwnSphereReaches) {
  const std::vector<Sphere> spheres{{DVec3(0), 5.0}, {DVec3(4, 0, 0), 0.5}};
  const auto result = assign(points({{3, 0, 0}, {4, 0, 0}}), spheres);  // the first is nearer to handle 1, out of reach
  ASSERT_TRUE(result);
  EXPECT_EQ(result->handle, (HandleColumn{1, 2}));
}

TEST(Assign, TheRegionLimitsWhatMayBeDragged) {
  const Box box{DVec3(0), DVec3(1, 10, 10)};
  const auto result =
      assign(points({{0, 0, 0}, {0.5f, 0, 0}, {0.6f, 0, 0}}), std::vector<Sphere>{{DVec3(0), 2.0}}, box);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->handle, (HandleColumn{1, 1, 0}));
}

TEST(Assign, SaysHowFarTheNearestGaussianIs) {
  const auto result =
      assign(points({{0, 0, 0}, {0, 0.061f, 5}}), std::vector<Sphere>{{DVec3(0), 1.0}, {DVec3(0, 0, 5), 0.02}});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(result.error().where, "handles[1].radius");
  EXPECT_EQ(result.error().message,
            "0 Gaussians within 0.02 of handle 2; the nearest is 0.061 away: move the handle's source there, or raise "
            "the radius");
}

TEST(Assign, SaysSoWhenTheRegionOrOtherHandlesTakeThemAll) {
  const Array3 two = points({{0, 0, 0}, {0.1f, 0, 0}});
  const auto by_region = assign(two, std::vector<Sphere>{{DVec3(0), 1.0}}, Box{DVec3(9, 0, 0), DVec3(1)});
  ASSERT_FALSE(by_region);
  EXPECT_EQ(by_region.error().message,
            "2 Gaussians within 1 of handle 1, but all outside the region: enlarge the region or leave it out");
  const auto empty_region = assign(two, std::vector<Sphere>{{DVec3(5), 1.0}}, Box{DVec3(9, 0, 0), DVec3(1)});
  ASSERT_FALSE(empty_region);
  EXPECT_EQ(empty_region.error().message,
            "0 Gaussians within 1 of handle 1: the region holds none; move or enlarge it");
  const auto by_handle = assign(two, std::vector<Sphere>{{DVec3(0), 1.0}, {DVec3(0), 1.0}});
  ASSERT_FALSE(by_handle);
  EXPECT_EQ(by_handle.error().where, "handles[1].radius");
  EXPECT_EQ(by_handle.error().message,
            "2 Gaussians within 1 of handle 2, but each is nearer to another handle: move this handle or leave it out");
  EXPECT_FALSE(assign(Array3{}, std::vector<Sphere>{{DVec3(0), 1.0}}));
}

TEST(Assign, GivesTheSameForAnyNumberOfThreads) {
  Array3 mean;
  Rng rng(3);
  for (int i = 0; i < 100000; ++i) mean.push_back({rng.normal(), rng.normal(), rng.normal()});
  const std::vector<Sphere> spheres{{DVec3(0), 0.7}, {DVec3(0.5, 0, 0), 0.7}, {DVec3(0, 1, 1), 0.4}};
  const auto alone = assign(mean, spheres);
  ASSERT_TRUE(alone);
  for (int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const auto result = assign(mean, spheres);
      ASSERT_TRUE(result);
      EXPECT_EQ(result->handle, alone->handle) << threads;
      EXPECT_EQ(result->count, alone->count) << threads;
    });
  }
}

using Rows = std::vector<std::uint32_t>;

TEST(AssignSelected, EachSelectedRowGoesWithTheNearestHandleHoweverFar) {
  const Array3 mean = points({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {1000, 0, 0}});
  const auto result = assign_selected(mean, Rows{0, 2, 3, 4}, std::vector<DVec3>{DVec3(0), DVec3(4, 0, 0)});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->handle, (HandleColumn{1, 0, 1, 2, 2})) << "a tie goes to the lower index";
  EXPECT_EQ(result->count, (std::vector<std::size_t>{2, 2}));
}

TEST(AssignSelected, TheRegionLimitsTheSelection) {
  const Array3 mean = points({{0, 0, 0}, {0.5f, 0, 0}, {0.6f, 0, 0}});
  const std::vector<DVec3> centers{DVec3(0)};
  const auto result = assign_selected(mean, Rows{0, 1, 2}, centers, Box{DVec3(0), DVec3(1)});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->handle, (HandleColumn{1, 1, 0}));
  const auto nothing = assign_selected(mean, Rows{0, 1}, centers, Box{DVec3(9), DVec3(1)});
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(nothing.error().where, "selection");
  EXPECT_EQ(nothing.error().message,
            "2 Gaussians selected, but all outside the region: enlarge the region or leave it out");
}

TEST(AssignSelected, AHandleMayBeLeftWithoutARow) {
  const auto result = assign_selected(points({{0, 0, 0}, {1, 0, 0}}), Rows{0, 1},
                                      std::vector<DVec3>{DVec3(0), DVec3(1, 0, 0), DVec3(9, 0, 0)});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->count, (std::vector<std::size_t>{1, 1, 0}));
}

TEST(AssignSelected, GivesTheSameForAnyNumberOfThreads) {
  Array3 mean;
  Rng rng(3);
  Rows rows;
  for (std::uint32_t i = 0; i < 100000; ++i) {
    mean.push_back({rng.normal(), rng.normal(), rng.normal()});
    if (i % 3 != 0) rows.push_back(i);
  }
  const std::vector<DVec3> centers{DVec3(0), DVec3(0.5, 0, 0), DVec3(0, 1, 1)};
  const auto alone = assign_selected(mean, rows, centers);
  ASSERT_TRUE(alone);
  for (int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] { EXPECT_EQ(assign_selected(mean, rows, centers)->handle, alone->handle) << threads; });
  }
}

}  // namespace
}  // namespace engine::deform
