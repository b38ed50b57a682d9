#include "engine/select/shown.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

/// Before front_camera(): rows 0 and 1 at pixels (30, 50) and (70, 50); 2 and 3 far behind them, hidden by 4 to 6 and
/// 7 to 9, which lie right behind 0 and 1.
scene::GaussianCloud two_dots() {
  scene::GaussianCloud cloud;
  for (const float z : {2.0f, 4.0f})
    for (const float x : {-0.2f, 0.2f}) {
      add_at(cloud, {x * z, 0, z}, 12, -2.5f);
      for (int i = 1; i < 4 && z < 3; ++i) add_at(cloud, {x * z, 0, z + 0.01f * float(i)}, 12, -2.0f);
    }
  scene::GaussianCloud ordered;
  for (const std::uint32_t row : {0u, 4u, 8u, 9u, 1u, 2u, 3u, 5u, 6u, 7u}) {
    const std::uint32_t one[] = {row};
    scene::append_rows(ordered, cloud, one);
  }
  return ordered;
}

Polygon around(double x, double radius, Depth depth) {
  return {front_camera(), {{x - radius, 35}, {x + radius, 35}, {x + radius, 65}, {x - radius, 65}}, depth};
}

RowList of(const scene::GaussianCloud& cloud, const auto& outline) {
  render::Workspace workspace;
  return rows_of(rows_in(cloud, outline, workspace));
}

bool has(const RowList& rows, std::size_t row) { return std::find(rows.begin(), rows.end(), row) != rows.end(); }

TEST(RowsInAPolygon, AreTheFrontOnesWhereVisible) {
  const RowList rows = of(two_dots(), around(30, 15, Depth::visible));
  EXPECT_TRUE(has(rows, 0));
  EXPECT_FALSE(has(rows, 1)) << "elsewhere";
  EXPECT_FALSE(has(rows, 2)) << "hidden";
  EXPECT_FALSE(has(rows, 3));
}

TEST(RowsInAPolygon, AreAllBehindItWhereThrough) {
  scene::GaussianCloud cloud = two_dots();
  add_at(cloud, {0.4f, 0, -2});      // projects to (30, 50) from behind the camera
  add_at(cloud, {-0.02f, 0, 0.1f});  // before the near plane
  EXPECT_EQ(of(cloud, around(30, 15, Depth::through)), (RowList{0, 2, 4, 5, 6}));
  EXPECT_EQ(of(cloud, around(70, 15, Depth::through)), (RowList{1, 3, 7, 8, 9}));
}

TEST(RowsInAPolygon, NeedMostOfTheirWeightInside) {
  scene::GaussianCloud cloud;
  add_at(cloud, {0, 0, 2}, 12, -2.0f);  // at (50, 50), some 7 pixels wide
  const auto edge_at = [&](double x) {
    return of(cloud, Polygon{front_camera(), {{0, 0}, {x, 0}, {x, 100}, {0, 100}}, Depth::visible});
  };
  EXPECT_TRUE(edge_at(49).empty());
  EXPECT_EQ(edge_at(51), RowList{0});
}

TEST(RowsInAStroke, AreThoseThatItRunsOver) {
  const Stroke over{front_camera(), {{20, 50}, {40, 50}}, 12, Depth::visible};
  EXPECT_TRUE(has(of(two_dots(), over), 0));
  EXPECT_FALSE(has(of(two_dots(), over), 1));
  EXPECT_EQ(of(two_dots(), Stroke{front_camera(), {{70, 50}}, 2, Depth::through}), (RowList{1, 3, 7, 8, 9}));
  EXPECT_TRUE(of(two_dots(), Stroke{front_camera(), {{50, 10}}, 5, Depth::visible}).empty());
}

TEST(RowsInMasks, AreThoseShownMostlyInside) {
  scene::GaussianCloud cloud = two_dots();
  add_at(cloud, {-0.8f, 0, 4}, 12, -5);  // row 10, with four opaque ones before it
  scene::Mask left(100, 100);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 50; ++x) left.at(x, y) = 1;
  render::Workspace workspace;
  const MaskedRows found = rows_in_masks(cloud, {{{front_camera(), left}}}, workspace);
  EXPECT_TRUE(found.inside[0] && found.judged[0]);
  EXPECT_TRUE(!found.inside[1] && found.judged[1]);
  EXPECT_FALSE(found.inside[10] || found.judged[10]) << "no view shows it";
  EXPECT_EQ(found.undecided, 0u);
}

TEST(RowsInMasks, SayNothingOfWhatIsNearTheirBorder) {
  scene::GaussianCloud cloud;
  for (const float x : {0.0f, 0.1f}) add_at(cloud, {x, 0, 2}, 12, -6.0f);  // at pixels 50 and 55, half a pixel wide
  scene::Mask left(100, 100);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 51; ++x) left.at(x, y) = 1;
  render::Workspace workspace;
  const MaskedRows found = rows_in_masks(cloud, {{{front_camera(), left}}}, workspace);
  EXPECT_FALSE(found.judged[0]);
  EXPECT_TRUE(found.judged[1]);
  EXPECT_EQ(found.undecided, 1u);
}

TEST(RowsInMasks, SayNothingOfWhatShinesThrough) {
  const auto judge_behind = [](float alpha) {
    scene::GaussianCloud cloud;
    add_at(cloud, {0, 0, 2}, std::log(alpha / (1 - alpha)), -1.0f);  // wide: as good as even around the middle
    add_at(cloud, {0, 0, 4}, 4, -2.5f);
    scene::Mask all(100, 100);
    std::fill(all.data.begin(), all.data.end(), std::uint8_t(1));
    render::Workspace workspace;
    return rows_in_masks(cloud, {{{front_camera(), all}}}, workspace);
  };
  const MaskedRows behind_much = judge_behind(0.9f), behind_little = judge_behind(0.6f);
  EXPECT_TRUE(behind_much.inside[0]);
  EXPECT_FALSE(behind_much.judged[1]) << "it may as well be a wall";
  EXPECT_TRUE(behind_much.shaded[1]);
  EXPECT_TRUE(behind_little.inside[1] && !behind_little.shaded[1]);
  const MaskedRows behind_all = judge_behind(0.995f);
  EXPECT_FALSE(behind_all.judged[1] || behind_all.shaded[1]) << "where it shows is chance";
}

TEST(RowsInMasks, BelieveThinParts) {
  scene::GaussianCloud cloud;
  add_at(cloud, {0, 0, 2}, 12, -6.0f);     // on the last pixels of a bar
  add_at(cloud, {0.1f, 0, 2}, 12, -6.0f);  // five hundredths of the picture beside it
  constexpr int times = 3;                 // a border of six pixels
  scene::Camera camera = front_camera();
  camera.fx *= times, camera.fy *= times, camera.cx *= times, camera.cy *= times;
  camera.width *= times, camera.height *= times;
  const auto judge = [&](int wide) {
    scene::Mask bar(camera.width, camera.height);
    for (int y = 0; y < bar.height; ++y)
      for (int x = 0; x < bar.width; ++x) bar.at(x, y) = (x >= 152 - wide && x < 152) || x < 90;
    render::Workspace workspace;
    return rows_in_masks(cloud, {{{camera, bar}}}, workspace);
  };
  const MaskedRows thin = judge(8);
  EXPECT_TRUE(thin.inside[0]) << "a leg, all of it near the mask's border";
  EXPECT_TRUE(!thin.inside[1] && thin.judged[1]);
  EXPECT_FALSE(judge(10).judged[0]) << "an opening by four pixels leaves it";
  EXPECT_FALSE(judge(30).judged[0]) << "the rim of what is wide";
}

TEST(RowsInMasks, CountViewsByTheirAreaAndReportWhatIsNearlyEven) {
  scene::GaussianCloud cloud;
  add_at(cloud, {0, 0, 2}, 12, -2.0f);
  scene::Camera twice = front_camera();  // the same view in twice the resolution
  twice.fx *= 2, twice.fy *= 2, twice.cx *= 2, twice.cy *= 2, twice.width *= 2, twice.height *= 2;
  const scene::Mask nothing(200, 200);
  scene::Mask all(100, 100);
  for (std::uint8_t& pixel : all.data) pixel = 1;
  render::Workspace workspace;
  const MaskedView says_yes{front_camera(), all}, says_no{twice, nothing};
  const MaskedRows even = rows_in_masks(cloud, {{says_yes, says_no}}, workspace);
  EXPECT_EQ(even.undecided, 1u) << "one view each way";
  EXPECT_FALSE(even.judged[0]);
  const MaskedRows outvoted = rows_in_masks(cloud, {{says_yes, says_no, says_yes}}, workspace);
  EXPECT_TRUE(outvoted.inside[0]) << "although the other view has more pixels";
  EXPECT_EQ(outvoted.undecided, 0u);
}

TEST(ShownShare, IsThatOfTheWeights) {
  scene::GaussianCloud cloud;
  add_at(cloud, {-0.4f, 0, 2}, 12, -2.5f);
  add_at(cloud, {0.4f, 0, 2}, 12, -2.5f);
  add_at(cloud, {0, 0, -2}, 12, -2.5f);
  render::Workspace workspace;
  const auto share = [&](const RowSet& rows) { return shown_share(cloud, rows, front_camera(), workspace); };
  EXPECT_NEAR(share({1, 0, 0}), 0.5, 1e-3);
  EXPECT_NEAR(share({1, 1, 0}), 1.0, 1e-6);
  EXPECT_EQ(share({0, 0, 1}), 0.0) << "behind the camera";
  EXPECT_EQ(shown_share(cloud_at({{0, 0, -1}}), RowSet{1}, front_camera(), workspace), 0.0) << "nothing shows";
}

}  // namespace
}  // namespace engine::select
