#include "engine/correct/patch_field.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "tests/engine/correct/samples.h"

namespace engine::correct {
namespace {

/// All patches of a target, looked up in sources.
struct Lookup {
  Planes target;
  std::vector<float> weight;
  std::vector<Pixel> centres;
  std::vector<std::uint32_t> number;
  std::vector<PatchSource> sources;

  Lookup(const scene::Image& picture, std::vector<PatchSource> from) : target(picture), sources(std::move(from)) {
    weight.assign(target.pixels() + Planes::spare, 1.0f);
    number.assign(target.pixels(), no_centre);
    for (int y = patch_radius; y < picture.height - patch_radius; ++y)
      for (int x = patch_radius; x < picture.width - patch_radius; ++x) {
        number[target.index(x, y)] = std::uint32_t(centres.size());
        centres.push_back({std::int16_t(x), std::int16_t(y)});
      }
  }
  [[nodiscard]] PatchQuery query() const { return {&target, weight, centres, number, sources}; }

  /// The field after so many passes.
  [[nodiscard]] std::vector<PatchMatch> searched(int passes, std::uint64_t seed = 1) const {
    std::vector<PatchMatch> field = random_field(query(), seed), next(field.size());
    for (int pass = 0; pass < passes; ++pass) {
      improve(query(), field, 1 << pass % 3, seed + std::uint64_t(pass) + 1, next);
      field.swap(next);
    }
    return field;
  }
  /// What PatchMatch::distance is, pixel by pixel.
  [[nodiscard]] double distance(std::size_t k, const PatchMatch& match) const {
    const Planes& source = sources[match.source].picture;
    double sum = 0, weights = 0;
    for (int dy = -patch_radius; dy <= patch_radius; ++dy)
      for (int dx = -patch_radius; dx <= patch_radius; ++dx) {
        const std::size_t here = target.index(centres[k].x + dx, centres[k].y + dy),
                          there = source.index(match.centre.x + dx, match.centre.y + dy);
        weights += double(weight[here]);
        for (std::size_t c = 0; c < 3; ++c)
          sum += double(weight[here]) * std::pow(double(target.data[c * target.pixels() + here]) -
                                                     double(source.data[c * source.pixels() + there]),
                                                 2);
      }
    return sum / weights;
  }
};

scene::Mask mostly_allowed(int width, int height, std::uint64_t seed) {
  scene::Mask allowed(width, height);
  Rng rng(seed);
  for (std::uint8_t& flag : allowed.data) flag = rng.below(60) != 0;
  return allowed;
}

Lookup of_noise() {
  Lookup lookup(noise(31, 26, 1), {patch_source(noise(40, 33, 2), mostly_allowed(40, 33, 3)),
                                   patch_source(noise(28, 37, 4), mostly_allowed(28, 37, 5))});
  Rng rng(6);
  for (std::size_t i = 0; i < lookup.target.pixels(); ++i) lookup.weight[i] = rng.uniform(0.1f, 2.0f);
  return lookup;
}

bool same_bytes(const std::vector<PatchMatch>& a, const std::vector<PatchMatch>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const PatchMatch& m, const PatchMatch& n) {
    return m.source == n.source && m.centre.x == n.centre.x && m.centre.y == n.centre.y && m.distance == n.distance;
  });
}

TEST(PatchSource, AllowsPatchesWithoutAnExcludedPixel) {
  for (const auto& [width, height] : {std::pair{23, 19}, {7, 7}, {7, 30}}) {
    const scene::Mask allowed = mostly_allowed(width, height, std::uint64_t(width));
    const PatchSource source = patch_source(noise(width, height, 1), allowed);
    std::vector<std::uint32_t> expected;
    for (int y = patch_radius; y < height - patch_radius; ++y)
      for (int x = patch_radius; x < width - patch_radius; ++x) {
        bool whole = true;
        for (int dy = -patch_radius; dy <= patch_radius; ++dy)
          for (int dx = -patch_radius; dx <= patch_radius; ++dx) whole = whole && allowed.at(x + dx, y + dy) != 0;
        if (whole) expected.push_back(std::uint32_t(y * width + x));
      }
    EXPECT_EQ(source.centres, expected) << width;
    EXPECT_EQ(source.centre_allowed.area(), expected.size());
    for (const std::uint32_t place : source.centres) EXPECT_EQ(source.centre_allowed.data[place], 1);
  }
}

TEST(PatchSource, OfAPictureSmallerThanAPatchHasNone) {
  EXPECT_TRUE(patch_source(noise(6, 40, 1), all_set(6, 40)).centres.empty());
  EXPECT_TRUE(patch_source(noise(40, 6, 1), all_set(40, 6)).centres.empty());
  EXPECT_EQ(patch_source(noise(7, 7, 1), all_set(7, 7)).centres, (std::vector<std::uint32_t>{24}));
}

TEST(RandomField, ComesFromAllowedPlacesOfAllSources) {
  const Lookup lookup = of_noise();
  const auto field = random_field(lookup.query(), 3);
  ASSERT_EQ(field.size(), lookup.centres.size());
  std::size_t of_first = 0;
  for (const PatchMatch& match : field) {
    ASSERT_LT(match.source, 2u);
    ASSERT_EQ(lookup.sources[match.source].centre_allowed.at(match.centre.x, match.centre.y), 1);
    of_first += match.source == 0;
  }
  const double share = double(lookup.sources[0].centres.size()) /
                       double(lookup.sources[0].centres.size() + lookup.sources[1].centres.size());
  EXPECT_NEAR(double(of_first) / double(field.size()), share, 0.1) << "each place is as likely";
  EXPECT_TRUE(same_bytes(random_field(lookup.query(), 3), field));
  EXPECT_FALSE(same_bytes(random_field(lookup.query(), 4), field));
}

TEST(RandomField, PassesOverSourcesWithoutAPlace) {
  const Lookup lookup(noise(12, 12, 1),
                      {patch_source(noise(12, 12, 2), scene::Mask(12, 12)),
                       patch_source(noise(12, 12, 3), all_set(12, 12)), patch_source(noise(3, 3, 4), all_set(3, 3))});
  for (const PatchMatch& match : lookup.searched(4)) EXPECT_EQ(match.source, 1u);
}

TEST(DoubledField, CarriesOverWhatWasFoundWhereThatIsAllowed) {
  const Lookup lookup = of_noise();
  Lookup small(noise(16, 13, 1), {patch_source(noise(20, 17, 2), mostly_allowed(20, 17, 3)),
                                  patch_source(noise(14, 19, 4), mostly_allowed(14, 19, 5))});
  const PatchField coarse{16, small.number, small.searched(2)};
  const auto field = double_size_field(lookup.query(), coarse, 3);
  const auto drawn = random_field(lookup.query(), 3);
  ASSERT_EQ(field.size(), lookup.centres.size());
  std::size_t carried = 0, not_allowed = 0, beyond = 0;
  for (std::size_t k = 0; k < field.size(); ++k) {
    const Pixel here = lookup.centres[k];
    const scene::Mask& allowed = lookup.sources[field[k].source].centre_allowed;
    EXPECT_EQ(allowed.at(field[k].centre.x, field[k].centre.y), 1);
    const std::uint32_t number = small.number[small.target.index(here.x / 2, here.y / 2)];
    if (number == no_centre) {
      EXPECT_TRUE(same_bytes({field[k]}, {drawn[k]})) << "the coarse rim has no patches";
      ++beyond;
      continue;
    }
    const PatchMatch& found = coarse.matches[number];
    const Pixel there{std::int16_t(2 * found.centre.x + here.x % 2), std::int16_t(2 * found.centre.y + here.y % 2)};
    if (lookup.sources[found.source].centre_allowed.at(there.x, there.y) == 0) {
      EXPECT_TRUE(same_bytes({field[k]}, {drawn[k]}));
      ++not_allowed;
      continue;
    }
    EXPECT_EQ(field[k].source, found.source);
    EXPECT_EQ(field[k].centre.x, there.x);
    EXPECT_EQ(field[k].centre.y, there.y);
    ++carried;
  }
  EXPECT_GT(carried, 20u);
  EXPECT_GT(not_allowed, 20u);
  EXPECT_GT(beyond, 20u);
}

TEST(Improve, FindsPatchesThatAreThere) {
  // The target is a part of the second source.
  const scene::Image whole = noise(64, 48, 7);
  const Lookup lookup(scene::cut_out(whole, {20, 10, 60, 40}),
                      {patch_source(noise(50, 50, 8), all_set(50, 50)), patch_source(whole, all_set(64, 48))});
  std::size_t found = 0;
  const auto field = lookup.searched(20);
  for (std::size_t k = 0; k < field.size(); ++k) {
    const PatchMatch& match = field[k];
    const bool there =
        match.source == 1 && match.centre.x == lookup.centres[k].x + 20 && match.centre.y == lookup.centres[k].y + 10;
    found += there;
    EXPECT_EQ(there, match.distance == 0) << k;
  }
  EXPECT_GT(double(found), 0.99 * double(field.size()));
}

TEST(Improve, NeverMakesAMatchWorseNorTakesWhatIsNotAllowed) {
  const Lookup lookup = of_noise();
  std::vector<PatchMatch> field = random_field(lookup.query(), 1), next(field.size());
  for (std::uint64_t pass = 0; pass < 8; ++pass) {
    std::size_t better = 0;
    improve(lookup.query(), field, 1 + int(pass % 4), pass, next);
    for (std::size_t k = 0; k < field.size(); ++k) {
      ASSERT_EQ(lookup.sources[next[k].source].centre_allowed.at(next[k].centre.x, next[k].centre.y), 1) << k;
      ASSERT_LE(lookup.distance(k, next[k]), lookup.distance(k, field[k]) + 1e-6) << k << ", pass " << pass;
      better += next[k].distance < float(lookup.distance(k, field[k])) - 1e-4f;
    }
    EXPECT_GT(better, 0u) << pass;
    field.swap(next);
  }
}

TEST(Improve, MeasuresTheWeightedMeanOfSquaredDifferencesWithEveryInstructionSet) {
  const Lookup lookup = of_noise();
  for (const std::int64_t instruction_set : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(instruction_set));
    hwy::GetChosenTarget().Update(instruction_set);
    const auto field = lookup.searched(2);
    for (std::size_t k = 0; k < field.size(); ++k)
      ASSERT_NEAR(field[k].distance, lookup.distance(k, field[k]), 1e-6) << k;
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(Improve, PixelsThatCountNothingDoNotMatter) {
  Lookup lookup = of_noise();
  Lookup other = lookup;
  for (std::size_t i = 0; i < lookup.target.pixels(); i += 3) {
    lookup.weight[i] = other.weight[i] = 0;
    for (std::size_t c = 0; c < 3; ++c) other.target.data[c * other.target.pixels() + i] = 50;
  }
  EXPECT_TRUE(same_bytes(lookup.searched(3), other.searched(3)));
  std::fill(lookup.weight.begin(), lookup.weight.end(), 0.0f);
  for (const PatchMatch& match : lookup.searched(2)) ASSERT_EQ(match.distance, 0) << "nothing counts";
}

TEST(Improve, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::Image picture = noise(70, 60, 1);
  std::vector<PatchMatch> first;
  for (const int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const Lookup lookup(picture, {patch_source(noise(80, 50, 2), mostly_allowed(80, 50, 3))});
      const auto field = lookup.searched(4);
      if (first.empty()) first = field;
      EXPECT_TRUE(same_bytes(field, first)) << threads;
      EXPECT_FALSE(same_bytes(lookup.searched(4, 99), first)) << "another seed";
    });
  }
}

}  // namespace
}  // namespace engine::correct
