#include "engine/select/contact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

scene::LayeredCloud shared(scene::GaussianCloud cloud) {
  return {std::make_shared<const scene::GaussianCloud>(std::move(cloud)), nullptr};
}

std::vector<std::uint32_t> rows_where_x(const scene::GaussianCloud& cloud, float from) {
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x > from) rows.push_back(row);
  return rows;
}

std::size_t count(const std::vector<Touch>& touches, Touch touch) {
  return std::size_t(std::ranges::count(touches, touch));
}

TEST(ContactOf, GrowsOutAcrossTheMiddleOfAWall) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 24, 0.1f, {0.5f, 0.4f, 0.3f});
  const auto rows = rows_where_x(cloud, 0);
  const auto touches = contact_of(shared(cloud), rows, rows);
  ASSERT_EQ(touches.size(), rows.size());
  EXPECT_GE(count(touches, Touch::grows_out), 24u);  // and two at the wall's ends, whose neighbours are farther away
  EXPECT_LE(count(touches, Touch::grows_out), 26u);
  EXPECT_EQ(count(touches, Touch::stands), 0u);
  for (std::size_t k = 0; k < rows.size(); ++k)
    EXPECT_TRUE(touches[k] == Touch::nothing || cloud.mean.get(rows[k]).x < 0.2f) << k;
}

TEST(ContactOf, StandsWhereTheRestLooksOtherwise) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-1.2f, 0, 0}, 24, 0.1f, {0.9f, 0.9f, 0.9f});
  add_sheet(cloud, {1.2f, 0, 0}, 24, 0.1f, {0.1f, 0.2f, 0.5f});
  const auto rows = rows_where_x(cloud, 0);
  const auto touches = contact_of(shared(cloud), rows, rows);
  EXPECT_EQ(count(touches, Touch::grows_out), 0u);
  EXPECT_GE(count(touches, Touch::stands), 24u);
}

TEST(ContactOf, StandsWhereItsOwnBorderLiesWithinWhatIsSelected) {
  scene::GaussianCloud cloud;  // a thing, and what it lies on, of which a strip is selected with it
  add_sheet(cloud, {-1.2f, 0, 0}, 24, 0.1f, {0.9f, 0.9f, 0.9f});
  add_sheet(cloud, {1.2f, 0, 0}, 24, 0.1f, {0.1f, 0.2f, 0.5f});
  const auto rows = rows_where_x(cloud, -0.4f);
  const auto touches = contact_of(shared(cloud), rows, rows);
  EXPECT_EQ(count(touches, Touch::grows_out), 0u);
  EXPECT_GE(count(touches, Touch::stands), 24u);
}

TEST(ContactOf, TouchesNothingAcrossAGapNorWhatIsSelectedToo) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-3, 0, 0}, 24, 0.1f, {0.5f, 0.4f, 0.3f});
  add_sheet(cloud, {0, 0, 0}, 24, 0.1f, {0.5f, 0.4f, 0.3f});
  const auto right = rows_where_x(cloud, 0), both = rows_where_x(cloud, -1.5f);
  EXPECT_EQ(count(contact_of(shared(cloud), both, both), Touch::nothing), both.size());
  EXPECT_EQ(count(contact_of(shared(cloud), right, both), Touch::nothing), right.size());
}

TEST(ContactOf, OfASceneOfOneRowIsNone) {
  const auto touches =
      contact_of(shared(cloud_at({{1, 2, 3}})), std::vector<std::uint32_t>{0}, std::vector<std::uint32_t>{0});
  EXPECT_EQ(touches, std::vector<Touch>{Touch::nothing});
}

}  // namespace
}  // namespace engine::select
