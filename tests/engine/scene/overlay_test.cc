#include "engine/scene/overlay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/engine/scene/random_cloud.h"
#include "tests/engine/scene/random_overlay.h"

namespace engine::scene {
namespace {

constexpr std::size_t extra_stride = 3;

GaussianCloud cloud_of(std::size_t n, std::uint64_t seed, int degree = 1) {
  return random_cloud(n, degree, seed, extra_stride);
}

Overlay overlay_for(std::size_t base_rows, std::size_t added, std::uint64_t seed) {
  return random_overlay(base_rows, added, seed, [](std::size_t n, std::uint64_t s) { return cloud_of(n, s); });
}

/// What flatten() is to give, row by row.
GaussianCloud flattened_slowly(const GaussianCloud& base, const Overlay& overlay) {
  GaussianCloud out = no_change(base).rows;
  const auto append = [&](const GaussianCloud& from, std::size_t row) {
    append_rows(out, from, std::vector<std::uint32_t>{std::uint32_t(row)});
  };
  for (std::uint32_t i = 0; i < base.size(); ++i) {
    const auto changed = std::find(overlay.changed.begin(), overlay.changed.end(), i);
    if (std::count(overlay.removed.begin(), overlay.removed.end(), i) > 0) continue;
    if (changed != overlay.changed.end())
      append(overlay.rows, std::size_t(changed - overlay.changed.begin()));
    else
      append(base, i);
  }
  for (std::size_t j = overlay.changed.size(); j < overlay.rows.size(); ++j) append(overlay.rows, j);
  return out;
}

LayeredCloud layered(const GaussianCloud& base, const Overlay& overlay) {
  return {std::make_shared<GaussianCloud>(base), std::make_shared<Overlay>(overlay)};
}

TEST(Overlay, FlattenRemovesReplacesAndAppends) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const GaussianCloud base = cloud_of(seed, 100 + seed);
    const Overlay overlay = overlay_for(base.size(), seed % 7, seed);
    ASSERT_TRUE(validate(overlay, base));
    const GaussianCloud flat = flatten(base, overlay);
    EXPECT_EQ(flat, flattened_slowly(base, overlay));
    EXPECT_EQ(layered(base, overlay).size(), flat.size());
    EXPECT_EQ(flatten(layered(base, overlay)), flat);
  }
}

TEST(Overlay, AnOverlayOfNothingGivesTheBase) {
  const GaussianCloud base = cloud_of(30, 1);
  const LayeredCloud alone{std::make_shared<GaussianCloud>(base), nullptr};
  for (const LayeredCloud& cloud : {alone, layered(base, no_change(base))}) {
    EXPECT_EQ(cloud.size(), 30u);
    EXPECT_EQ(flatten(cloud), base);
    EXPECT_EQ(means(cloud), base.mean);
    const std::vector<std::uint32_t> rows{29, 0, 7};
    GaussianCloud expected = no_change(base).rows;
    append_rows(expected, base, rows);
    EXPECT_EQ(gather(cloud, rows), expected);
  }
  EXPECT_TRUE(validate(no_change(base), base));
}

TEST(Overlay, MayRemoveEverythingAndAddEverything) {
  const GaussianCloud base = cloud_of(5, 2);
  Overlay overlay;
  overlay.removed = {0, 1, 2, 3, 4};
  overlay.rows = cloud_of(2, 3);
  ASSERT_TRUE(validate(overlay, base));
  EXPECT_EQ(flatten(base, overlay), overlay.rows);
  overlay.rows = cloud_of(0, 3);
  EXPECT_EQ(flatten(base, overlay).size(), 0u);
}

TEST(Overlay, ComposeIsOneOverlayForAWholeChain) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    const GaussianCloud base = cloud_of(seed % 37, 200 + seed);
    GaussianCloud flat = base;
    Overlay all = no_change(base);
    for (std::uint64_t link = 0; link < 4; ++link) {
      const Overlay next = overlay_for(flat.size(), (seed + link) % 5, 1000 * seed + link);
      flat = flatten(flat, next);
      all = compose(base.size(), all, next);
      ASSERT_TRUE(validate(all, base)) << link << ": " << validate(all, base).error().where;
      EXPECT_EQ(flatten(base, all), flat) << link;
    }
  }
}

TEST(Overlay, ComposeWithNothingChangesNothing) {
  const GaussianCloud base = cloud_of(40, 4);
  const Overlay overlay = overlay_for(base.size(), 6, 4);
  const GaussianCloud flat = flatten(base, overlay);
  EXPECT_EQ(compose(base.size(), overlay, no_change(flat)), overlay);
  EXPECT_EQ(compose(base.size(), no_change(base), overlay), overlay);
}

TEST(Overlay, GatherAndMeansSeeTheResult) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    const GaussianCloud base = cloud_of(50, 300 + seed, 3);
    const Overlay overlay =
        random_overlay(50, seed % 4, seed, [](std::size_t n, std::uint64_t s) { return cloud_of(n, s, 3); });
    const LayeredCloud cloud = layered(base, overlay);
    const GaussianCloud flat = flatten(cloud);
    EXPECT_EQ(means(cloud), flat.mean);
    std::vector<std::uint32_t> rows(flat.size());
    std::iota(rows.begin(), rows.end(), 0u);
    EXPECT_EQ(gather(cloud, rows), flat);
    Rng rng(seed);
    for (std::size_t i = rows.size(); i > 1; --i) std::swap(rows[i - 1], rows[rng.below(std::uint32_t(i))]);
    rows.push_back(rows.front());  // a row may be asked for twice
    GaussianCloud expected = no_change(base).rows;
    append_rows(expected, flat, rows);
    EXPECT_EQ(gather(cloud, rows), expected);
    EXPECT_EQ(gather(cloud, {}), no_change(base).rows);
  }
}

TEST(Overlay, CountsMeansWithinARadiusStrictly) {
  const GaussianCloud base = cloud_of(400, 5);
  const Overlay overlay = overlay_for(base.size(), 50, 5);
  const LayeredCloud cloud = layered(base, overlay);
  const GaussianCloud flat = flatten(cloud);
  for (const double radius : {0.0, 0.5, 1.0, 2.0, 100.0}) {
    std::size_t expected = 0;
    for (std::size_t i = 0; i < flat.size(); ++i) expected += glm::length(DVec3(flat.mean.get(i))) < radius;
    EXPECT_EQ(count_within(cloud, DVec3(0), radius), expected) << radius;
  }
  GaussianCloud one = cloud_of(1, 6);
  one.mean.set(0, {3, 4, 0});
  EXPECT_EQ(count_within({std::make_shared<GaussianCloud>(one), nullptr}, DVec3(0), 5.0), 0u);
  EXPECT_EQ(count_within({std::make_shared<GaussianCloud>(one), nullptr}, DVec3(0), 5.0000001), 1u);
}

TEST(Overlay, ValidateNamesEachBrokenInvariant) {
  const GaussianCloud base = cloud_of(10, 7);
  Overlay good;
  good.removed = {2, 5};
  good.changed = {3, 8};
  good.rows = cloud_of(4, 8);
  ASSERT_TRUE(validate(good, base));
  const auto expect_refused = [&](auto&& spoil, const std::string& where) {
    Overlay bad = good;
    spoil(bad);
    const auto valid = validate(bad, base);
    ASSERT_FALSE(valid) << where;
    EXPECT_EQ(valid.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(valid.error().where, where) << valid.error().message;
  };
  expect_refused([](Overlay& o) { o.removed = {5, 2}; }, "removed[1]");
  expect_refused([](Overlay& o) { o.removed = {2, 2}; }, "removed[1]");
  expect_refused([](Overlay& o) { o.removed = {10}; }, "removed[0]");
  expect_refused([](Overlay& o) { o.changed = {3, 10}; }, "changed[1]");
  expect_refused([](Overlay& o) { o.changed = {8, 3}; }, "changed[1]");
  expect_refused([](Overlay& o) { o.changed = {3, 5}; }, "changed[1]");  // also removed
  expect_refused([](Overlay& o) { o.rows = cloud_of(1, 8); }, "rows");
  expect_refused([](Overlay& o) { o.rows = cloud_of(4, 8, 2); }, "rows");
  expect_refused([](Overlay& o) { o.rows = random_cloud(4, 1, 8, extra_stride + 1); }, "rows");
  expect_refused([](Overlay& o) { o.rows.mean.y.pop_back(); }, "rows");
  expect_refused([](Overlay& o) { o.rows.sh.pop_back(); }, "rows");
  expect_refused([](Overlay& o) { o.rows.extra.pop_back(); }, "rows");
}

TEST(MemoryBytes, CountsEveryArray) {
  GaussianCloud cloud;
  cloud.sh_degree = 2;
  cloud.extra_stride = 5;
  cloud.resize(100);
  EXPECT_EQ(memory_bytes(cloud), 100u * (4 * (11 + 27) + 5));
  Overlay overlay;
  overlay.removed.reserve(7);
  overlay.rows = cloud;
  EXPECT_GE(memory_bytes(overlay), 7 * 4 + memory_bytes(cloud));
}

}  // namespace
}  // namespace engine::scene
