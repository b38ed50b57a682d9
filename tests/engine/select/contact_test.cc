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
  const auto [touches, shown, firmness] = contact_of(shared(cloud), rows, rows);
  ASSERT_EQ(touches.size(), rows.size());
  EXPECT_EQ(shown, rows.size());
  EXPECT_NEAR(firmness, 1, 0.2);
  EXPECT_GE(count(touches, Touch::goes_on), 24u);  // and two at the wall's ends, whose neighbours are farther away
  EXPECT_LE(count(touches, Touch::goes_on), 26u);
  EXPECT_EQ(count(touches, Touch::stands), 0u);
  for (std::size_t k = 0; k < rows.size(); ++k)
    EXPECT_TRUE(touches[k] == Touch::nothing || cloud.mean.get(rows[k]).x < 0.2f) << k;
}

TEST(ContactOf, StandsWhereTheRestLooksOtherwise) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-1.2f, 0, 0}, 24, 0.1f, {0.9f, 0.9f, 0.9f});
  add_sheet(cloud, {1.2f, 0, 0}, 24, 0.1f, {0.1f, 0.2f, 0.5f});
  const auto rows = rows_where_x(cloud, 0);
  const auto [touches, shown, firmness] = contact_of(shared(cloud), rows, rows);
  EXPECT_EQ(count(touches, Touch::goes_on), 0u);
  EXPECT_LT(firmness, 0.1);
  EXPECT_GE(count(touches, Touch::stands), 24u);
}

TEST(ContactOf, IsNoFirmerThanABorderWithinWhatIsSelected) {
  scene::GaussianCloud cloud;  // a thing, and what it lies on, of which a strip is selected with it
  add_sheet(cloud, {-1.2f, 0, 0}, 24, 0.1f, {0.9f, 0.9f, 0.9f});
  add_sheet(cloud, {1.2f, 0, 0}, 24, 0.1f, {0.1f, 0.2f, 0.5f});
  const auto rows = rows_where_x(cloud, -0.4f);
  const auto [touches, shown, firmness] = contact_of(shared(cloud), rows, rows);
  EXPECT_GE(count(touches, Touch::goes_on), 24u) << "what it lies on goes on";
  EXPECT_LT(firmness, 0.1);
}

TEST(ContactOf, TouchesNothingAcrossAGapNorWhatIsSelectedToo) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-3, 0, 0}, 24, 0.1f, {0.5f, 0.4f, 0.3f});
  add_sheet(cloud, {0, 0, 0}, 24, 0.1f, {0.5f, 0.4f, 0.3f});
  const auto right = rows_where_x(cloud, 0), both = rows_where_x(cloud, -1.5f);
  EXPECT_EQ(count(contact_of(shared(cloud), both, both).touches, Touch::nothing), both.size());
  EXPECT_EQ(count(contact_of(shared(cloud), right, both).touches, Touch::nothing), right.size());
}

TEST(ContactOf, DoesNotAskWhatNobodySeesWithinAThing) {
  // A box on a floor. Within it lies what a trainer leaves there, tufts of the box's colour, of which half is selected.
  constexpr Vec3 color(0.9f, 0.9f, 0.9f);
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0.2f}, 40, 0.1f, {0.1f, 0.2f, 0.5f});
  const auto floor = std::uint32_t(cloud.size());
  for (int face = 0; face < 5; ++face)
    for (int v = 0; v < 16; ++v)
      for (int u = 0; u < 16; ++u) {
        const float a = 0.1f * (float(u) - 7.5f), b = 0.1f * (float(v) - 7.5f), half = 0.8f;
        const Vec3 faces[] = {
            {a, b, -1.6f}, {a, half, b - 0.8f}, {a, -half, b - 0.8f}, {half, a, b - 0.8f}, {-half, a, b - 0.8f}};
        add_at(cloud, faces[face], 6, std::log(0.08f), color);
      }
  const auto box = std::uint32_t(cloud.size());
  for (int z = -10; z <= -1; ++z)
    for (int y = -5; y <= 5; ++y)
      for (int x = -5; x <= 5; ++x) add_at(cloud, 0.14f * Vec3(float(x), float(y), float(z)), 4, std::log(0.1f), color);
  std::vector<std::uint32_t> rows(box - floor);
  std::iota(rows.begin(), rows.end(), floor);
  for (std::uint32_t row = box; row < cloud.size(); ++row)
    if (cloud.mean.get(row).z < -0.8f) rows.push_back(row);
  const auto [touches, shown, firmness] = contact_of(shared(cloud), rows, rows);
  EXPECT_LT(firmness, 0.1);
  EXPECT_LT(shown, rows.size());
  EXPECT_GT(count(touches, Touch::stands), 0u);
}

TEST(ContactOf, OfRowsThatNothingShowsIsNone) {
  scene::GaussianCloud cloud = cloud_at({{0, 0, 0}, {0.1f, 0, 0}, {0.2f, 0, 0}});
  for (float& logit : cloud.opacity_logit) logit = -30;
  const std::vector<std::uint32_t> rows{0, 1};
  const Contact contact = contact_of(shared(cloud), rows, rows);
  EXPECT_EQ(contact.touches, std::vector<Touch>(2, Touch::nothing));
  EXPECT_EQ(contact.shown, 0u);
  EXPECT_EQ(contact.firmness, 0);
}

TEST(ContactOf, StandsWhereNothingSaysHowAlikeItsRowsUsuallyAre) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 12, 0.1f, {0.1f, 0.2f, 0.5f});
  add_at(cloud, {0, 0, -0.1f}, 4, std::log(0.05f), {0.9f, 0.9f, 0.9f});  // one row: it has no neighbour in its part
  const std::vector<std::uint32_t> rows{std::uint32_t(cloud.size() - 1)};
  const Contact contact = contact_of(shared(cloud), rows, rows);
  EXPECT_EQ(contact.touches, std::vector<Touch>{Touch::stands});
  EXPECT_EQ(contact.firmness, 0);
}

TEST(ContactOf, OfASceneOfOneRowIsNone) {
  const auto touches =
      contact_of(shared(cloud_at({{1, 2, 3}})), std::vector<std::uint32_t>{0}, std::vector<std::uint32_t>{0}).touches;
  EXPECT_EQ(touches, std::vector<Touch>{Touch::nothing});
}

}  // namespace
}  // namespace engine::select
