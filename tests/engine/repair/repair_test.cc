#include "engine/repair/repair.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "engine/core/rng.h"
#include "engine/edit/masks.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/block.h"
#include "tests/engine/edit/drags.h"

namespace engine::repair {
namespace {

using edit::add_gaussian, edit::before_rubble, edit::block_side, edit::BlockScene, edit::floor_color,
    edit::without_floor;
using working::Role;

/// Notes what it is asked and gives back what it gets, or something else.
class Recorder final : public correct::Corrector {
 public:
  std::vector<correct::Example> buffer;
  std::vector<correct::CorrectionTask> asked;
  std::vector<double> strengths;
  std::vector<std::uint64_t> seeds;
  std::function<Result<scene::Image>(const correct::CorrectionTask&)> answer =
      [](const correct::CorrectionTask& flawed) { return Result<scene::Image>(flawed.picture); };

  /// What was asked after the chart.
  [[nodiscard]] std::span<const correct::CorrectionTask> of_views() const { return std::span(asked).subspan(1); }

  Result<void> fine_tune(std::span<const correct::Example> examples, int) override {
    buffer.assign(examples.begin(), examples.end());
    return {};
  }
  Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask> views, double strength,
                                            std::uint64_t seed) override {
    std::vector<scene::Image> out;
    for (const correct::CorrectionTask& flawed : views) {
      asked.push_back(flawed), strengths.push_back(strength), seeds.push_back(seed);
      auto picture = answer(flawed);
      if (!picture) return propagate(picture);
      out.push_back(std::move(*picture));
    }
    return out;
  }
};

/// An edit after its deformation, about to be corrected.
struct Moved {
  BlockScene block;
  scene::GaussianCloud original;
  WorkingScene working;
  std::vector<scene::Mask> masks;
  Recorder corrector;

  explicit Moved(float gap = 0, Mode mode = Mode::move) : Moved(BlockScene(gap, mode)) {}
  explicit Moved(BlockScene scene) : block(std::move(scene)), original(block.cloud) {
    working = edit::begun(block.cloud, block.request);
    const auto copies = edit::carry_out(working, block.request, 1).copies;
    for (const scene::Camera& view : block.cameras) masks.emplace_back(view.width, view.height);
    std::vector<std::uint32_t> parents;
    for (const std::uint32_t copy : copies) parents.push_back(working.parent()[copy]);
    const auto go_on = [](double) { return Result<void>{}; };
    EXPECT_TRUE(edit::unite_masks(working, copies, block.cameras, masks, go_on));
    const WorkingScene before = edit::begun(block.cloud, block.request);
    EXPECT_TRUE(edit::unite_masks(before, parents, block.cameras, masks, go_on));
    masks = edit::dilated(masks);
  }
  [[nodiscard]] Repair repair() {
    return {original,
            block.cameras,
            block.cameras,
            block.request.healed,
            /*arrival=*/{},
            block.request.mode,
            block.request.params.seed,
            corrector};
  }
  Result<Corrected> correct(const Round& round = {1, 1, 0.5}) {
    return repair().correct(working, masks, round, [](double) { return Result<void>{}; });
  }
  /// Pixels of view v where the floor below the block is, and the moved block is not.
  [[nodiscard]] scene::Mask uncovered(std::size_t v) const {
    scene::Mask pixels(block.cameras[v].width, block.cameras[v].height);
    for (const DVec3 point : BlockScene::below_block()) {
      const DVec2 at = block.cameras[v].pixel_from_cam(block.cameras[v].cam_from_world(point));
      pixels.at(int(at.x), int(at.y)) = 1;
    }
    return pixels;
  }
};

/// Paints what it is asked for in one colour.
Result<scene::Image> painted(const correct::CorrectionTask& flawed, Vec3 color) {
  scene::Image picture = flawed.picture;
  const scene::Mask flaws = correct::pixels_to_correct(flawed);
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < flaws.data.size(); ++i)
      if (flaws.data[i] != 0) picture.plane(c)[i] = color[c];
  return picture;
}

/// Pictures of twice the size.
void make_finer(BlockScene& block) {
  for (scene::Camera& camera : block.cameras) {
    camera.width *= 2, camera.height *= 2;
    camera.fx *= 2, camera.fy *= 2, camera.cx *= 2, camera.cy *= 2;
  }
}

/// Colours of the floor by the place.
BlockScene with_floor(const std::function<Vec3(Vec3 mean)>& color) {
  BlockScene block;
  const std::size_t coefficients = scene::sh_coefficients(block.cloud.sh_degree);
  for (std::uint32_t row = 0; row < block.floor_rows; ++row) {
    const Vec3 there = color(block.cloud.mean.get(row));
    for (int c = 0; c < 3; ++c)
      block.cloud.sh_row(row)[std::size_t(c) * coefficients] = (there[c] - 0.5f) / float(scene::sh_c0);
  }
  return block;
}

/// The floor has faint spots of chance: nothing in it repeats.
BlockScene on_spotted_floor() {
  Rng rng(4);
  return with_floor([&](Vec3) { return floor_color + Vec3(0.05f * (2 * rng.uniform() - 1)); });
}

scene::Image shown(const WorkingScene& working, const scene::Camera& camera) {
  return render::forward(working.cloud(), camera).color;
}

TEST(Repair, AsksForAChartOfTheFloorFirst) {
  Moved moved(on_spotted_floor());
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  const correct::CorrectionTask& chart = moved.corrector.asked[0];
  EXPECT_EQ(chart.picture.width, chart.picture.height);
  EXPECT_EQ(chart.examples, std::vector<std::size_t>{0}) << "it learns from itself alone";
  std::size_t floor = 0;
  for (std::size_t i = 0; i < chart.mask.data.size(); ++i) {
    EXPECT_EQ(chart.trust.data[i], chart.mask.data[i] != 0 ? 0 : 1) << "known, or to be made up";
    if (chart.mask.data[i] != 0) continue;
    ++floor;
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(chart.picture.plane(c)[i], floor_color[c], 0.06) << i;
  }
  EXPECT_GT(floor, 400u);
  EXPECT_GT(outcome->seeds, 100u);
}

TEST(Repair, WithoutEnoughAroundItThereIsNoChart) {
  BlockScene block;
  for (std::uint32_t row = 0; row < block.floor_rows; ++row) {
    const Vec3 at = block.cloud.mean.get(row);
    if (std::hypot(at.x, at.z) > 0.5f) block.cloud.opacity_logit[row] = -9;  // a small round table
  }
  Moved moved(std::move(block));
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_EQ(moved.corrector.asked.size(), 2 * moved.block.cameras.size());
  EXPECT_GT(outcome->seeds, 20u) << "views complete it";
}

TEST(Repair, AsksForEachViewFirstWhatIsBehindAndThenAll) {
  Moved moved;
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  const Recorder& corrector = moved.corrector;
  EXPECT_EQ(std::set(corrector.seeds.begin(), corrector.seeds.end()).size(), corrector.seeds.size())
      << "each picture has a seed of its own";
  const std::span<const correct::CorrectionTask> asked = corrector.of_views();
  ASSERT_EQ(asked.size(), 2 * moved.block.cameras.size());
  for (std::size_t k = 0; k < asked.size(); ++k) {
    const correct::CorrectionTask& flawed = asked[k];
    const std::size_t v = flawed.examples.at(0);  // the view itself is the most alike
    EXPECT_EQ(flawed.examples.size(), 5u);
    EXPECT_EQ(flawed.picture.width, 64);
    const scene::Mask uncovered = moved.uncovered(v);
    double red = 0, trust = 0;
    for (std::size_t i = 0; i < uncovered.data.size(); ++i) {
      if (uncovered.data[i] == 0) continue;
      EXPECT_EQ(flawed.mask.data[i], 1) << k;
      red += double(flawed.picture.plane(0)[i]), trust += double(flawed.trust.data[i]);
    }
    EXPECT_LT(red / double(uncovered.area()), 0.3) << k << ": the block is not there any more";
    if (k % 2 == 0) {
      EXPECT_GT(trust / double(uncovered.area()), 0.95) << "the chart has decided what is there";
      EXPECT_LT(flawed.mask.area(), moved.masks[v].area());
    } else {
      EXPECT_GT(trust / double(uncovered.area()), 0.95) << "what was filled in is not asked for again";
      EXPECT_EQ(flawed.mask, moved.masks[v]);
    }
  }
}

TEST(Repair, EveryCorrectionHasSeedsOfItsOwn) {
  std::set<std::uint64_t> seeds;
  std::size_t pictures = 0;
  for (const auto& [u, a] : {std::pair{1, 1}, {1, 2}, {2, 1}, {2, 2}}) {
    Moved moved;
    ASSERT_TRUE(moved.correct({u, a, 0.5}));
    seeds.insert(moved.corrector.seeds.begin(), moved.corrector.seeds.end());
    pictures += moved.corrector.seeds.size();
  }
  EXPECT_EQ(seeds.size(), pictures);
  std::uint64_t before = 0;
  for (const std::uint64_t seed : seeds) {  // ascending
    EXPECT_GT(seed - std::exchange(before, seed), 1'000'000u) << "a corrector counts up from the seed it is given";
  }
}

TEST(Repair, TheBufferIsTheUneditedSceneWithoutTheBlockInItsPlace) {
  Moved moved;
  ASSERT_TRUE(moved.correct());
  ASSERT_EQ(moved.corrector.buffer.size(), moved.block.cameras.size());
  for (std::size_t v = 0; v < moved.corrector.buffer.size(); ++v) {
    const correct::Example& example = moved.corrector.buffer[v];
    EXPECT_EQ(example.picture, render::forward(moved.original, moved.block.cameras[v]).color);
    EXPECT_EQ(example.box, scene::bounding_box(moved.masks[v]));
    for (std::size_t i = 0; i < example.excluded.data.size(); ++i)
      if (example.excluded.data[i] == 0) {
        EXPECT_LT(example.picture.plane(0)[i], 0.35f) << v << ": no red that may be learned from";
      }
    EXPECT_LT(example.excluded.area(), example.picture.pixels() / 2);
  }
}

TEST(Repair, LaysWhatTheCorrectorFindsIntoTheSceneSoThatLaterViewsShowIt) {
  Moved moved(on_spotted_floor());
  const Vec3 found{0.1f, 0.9f, 0.2f};
  moved.corrector.answer = [&](const correct::CorrectionTask& flawed) { return painted(flawed, found); };
  const std::size_t rows = moved.working.size();
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_GT(outcome->seeds, 30u);
  ASSERT_EQ(moved.working.size(), rows + outcome->seeds);
  EXPECT_TRUE(moved.working.check());
  for (std::size_t row = rows; row < moved.working.size(); ++row) {
    EXPECT_EQ(moved.working.role()[row], Role::seed);
    EXPECT_NEAR(moved.working.cloud().mean.y[row], 0, 0.1) << "on the floor, to the size of its Gaussians";
  }
  for (std::size_t v = 0; v < moved.block.cameras.size(); ++v) {
    const scene::Image now = shown(moved.working, moved.block.cameras[v]);
    const scene::Mask uncovered = moved.uncovered(v);
    double in_scene = 0, in_picture = 0;
    for (std::size_t i = 0; i < uncovered.data.size(); ++i) {
      if (uncovered.data[i] == 0) continue;
      for (int c = 0; c < 3; ++c) {
        in_scene += double(std::abs(now.plane(c)[i] - found[c])) / 3;
        in_picture += double(std::abs(outcome->pictures[v].plane(c)[i] - found[c])) / 3;
      }
    }
    EXPECT_LT(in_scene / double(uncovered.area()), 0.12) << v << ": what was found shows in the scene";
    EXPECT_LT(in_picture / double(uncovered.area()), 0.08) << v << ": and in the picture";
  }
  // The first view needs most of them; the others see them and add little.
  std::size_t first = 0;
  for (std::size_t i = 0; i < moved.corrector.asked[0].mask.data.size(); ++i)
    first += correct::pixels_to_correct(moved.corrector.asked[0]).data[i];
  EXPECT_LT(outcome->seeds, 3 * first);
}

TEST(Repair, SeedsNothingWhereAllIsKnown) {
  Moved moved(/*gap=*/0.5f);
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->seeds, 0u);
}

TEST(Repair, WhatNobodySawUnderAThingGoesWhereTheFloorGoesOn) {
  // A trainer leaves such grey crumbs under a thing; one on the floor in full view is no crumb.
  BlockScene block;
  const std::size_t first = block.cloud.size();
  for (int i = -2; i <= 2; ++i)
    for (int k = -2; k <= 2; ++k)
      add_gaussian(block.cloud, {0.05f * float(i), -0.01f, 0.05f * float(k)}, Vec3(0.03f), 3, Vec3(0.5f));
  const std::size_t seen = block.cloud.size();
  add_gaussian(block.cloud, {-0.5f, -0.01f, 0}, Vec3(0.03f), 3, Vec3(0.5f));
  const std::size_t crumbs = seen - first;
  block.request.region->size.y = double(block_side) - 0.06;  // the crumbs stay
  block.request.region->center.y = block.middle.y - 0.04;
  Moved moved(std::move(block));
  moved.corrector.answer = [](const correct::CorrectionTask& flawed) { return painted(flawed, floor_color); };
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_GT(outcome->seeds, 0u);
  std::size_t gone = 0;
  for (std::size_t row = first; row < seen; ++row)
    if (moved.working.role()[row] == Role::original) {
      ++gone;
      EXPECT_LE(moved.working.cloud().opacity_logit[row], working::keep_logit(Mode::move));
    }
  EXPECT_GE(gone, crumbs * 9 / 10);
  EXPECT_EQ(moved.working.role()[seen], Role::frozen);
  std::size_t in_view = 0;
  for (std::size_t row = 0; row < moved.block.floor_rows; ++row) {
    if (moved.block.hides(moved.original.mean.get(row))) continue;
    ++in_view;
    EXPECT_EQ(moved.working.role()[row], Role::frozen) << row;
  }
  EXPECT_GT(in_view, 1500u);
  EXPECT_TRUE(moved.working.check());
}

/// A floor of stripes along its depth.
Vec3 striped(Vec3 mean) {
  const float along = mean.x / 0.6f + 0.55f;  // an edge at 0.03, below the block
  const bool dark = along - std::floor(along) < 0.6f;
  return dark ? Vec3(0.1f, 0.2f, 0.3f) : Vec3(0.7f, 0.7f, 0.6f);
}

TEST(Repair, StripesGoOnWhateverTheCorrectorHolds) {
  BlockScene block = with_floor(striped);
  make_finer(block), make_finer(block);
  Moved moved(std::move(block));
  moved.corrector.answer = [](const correct::CorrectionTask& flawed) { return painted(flawed, {0.1f, 0.9f, 0.2f}); };
  ASSERT_TRUE(moved.correct());
  const correct::CorrectionTask& chart = moved.corrector.asked[0];
  std::size_t foretold = 0, wanted = 0;
  for (std::size_t i = 0; i < chart.mask.data.size(); ++i)
    if (chart.mask.data[i] != 0) ++wanted, foretold += chart.trust.data[i] == 1;
  EXPECT_GT(foretold, 500u) << "of " << wanted << ", which are also those beyond the floor's end";
  double off = 0;
  std::size_t count = 0;
  const scene::Camera& camera = moved.block.cameras[2];
  const scene::Image now = shown(moved.working, camera);
  for (const DVec3 point : BlockScene::below_block()) {
    const DVec2 at = camera.pixel_from_cam(camera.cam_from_world(point));
    for (int c = 0; c < 3; ++c)
      off += double(std::abs(now.at(int(at.x), int(at.y), c) - striped(Vec3(point))[c])), ++count;
  }
  EXPECT_LT(off / double(count), 0.15);
}

TEST(Repair, WhatWasSeenThroughTheRimOfAThingGoes) {
  BlockScene block;
  make_finer(block), make_finer(block);
  const std::size_t rim = block.cloud.size();
  // What makes up for the red of the block's blurred foot, and the same where it is seen by itself.
  const Vec3 bluer{0, 0.4f, 1};
  for (int i = -3; i <= 3; ++i)
    add_gaussian(block.cloud, {0.06f * float(i), -0.002f, -0.262f}, {0.03f, 0.005f, 0.012f}, 3, bluer);
  const std::size_t clear = block.cloud.size();
  for (int i = -3; i <= 3; ++i)
    add_gaussian(block.cloud, {0.06f * float(i), -0.002f, -0.5f}, {0.03f, 0.005f, 0.012f}, 3, bluer);
  block.request.region->size.z = double(block_side) - 0.02;  // the rows of the rim are not of the block
  Moved moved(std::move(block));
  moved.corrector.answer = [](const correct::CorrectionTask& flawed) { return painted(flawed, floor_color); };
  ASSERT_TRUE(moved.correct());
  for (std::size_t row = rim; row < clear; ++row) EXPECT_EQ(moved.working.role()[row], Role::original) << row - rim;
  for (std::size_t row = clear; row < moved.original.size(); ++row)
    EXPECT_EQ(moved.working.role()[row], Role::frozen) << row - clear;
  // Nobody becomes tainted by what has gone with the part.
  const std::vector<Role> roles = moved.working.role();
  ASSERT_TRUE(moved.correct({1, 2, 0.5}));
  for (std::size_t row = 0; row < moved.block.floor_rows; ++row)
    if (roles[row] == Role::frozen) {
      EXPECT_EQ(moved.working.role()[row], Role::frozen) << row;
    }
}

TEST(Repair, WhatIsSeenBeforeAThingStays) {
  BlockScene block;
  make_finer(block), make_finer(block);
  // A net between the cameras and the block: all that is seen of it is seen before the block.
  const std::size_t net = block.cloud.size();
  for (int i = -3; i <= 3; ++i)
    for (int k = -3; k <= 3; ++k)
      add_gaussian(block.cloud, {0.06f * float(i), -0.75f, 0.06f * float(k)}, Vec3(0.012f), -1, Vec3(0.1f));
  Moved moved(std::move(block));
  moved.corrector.answer = [](const correct::CorrectionTask& flawed) { return painted(flawed, floor_color); };
  ASSERT_TRUE(moved.correct());
  for (std::size_t row = net; row < moved.original.size(); ++row)
    EXPECT_EQ(moved.working.role()[row], Role::frozen) << row - net;
}

/// A hatch in the floor is lifted off.
BlockScene lifted_hatch() {
  BlockScene block(/*gap=*/0.5f);
  std::vector<std::uint32_t> hatch;
  for (std::uint32_t row = 0; row < block.cloud.size(); ++row) {
    const Vec3 mean = block.cloud.mean.get(row);
    if (row >= block.floor_rows)
      block.cloud.opacity_logit[row] = -12;  // the block is not there
    else if (std::abs(mean.x) < 0.3f && std::abs(mean.z) < 0.3f)
      hatch.push_back(row);
  }
  block.request.selected = hatch;
  block.request.region.reset();
  block.request.handles[0].source = DVec3(0);
  block.request.handles[0].target = DVec3(0.9, -0.3, 0);
  return block;
}

TEST(Repair, WhatIsOpenedIsNotClosedAgain) {
  Moved moved(lifted_hatch());  // the floor around it would go on just where it was
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  std::size_t closing = 0;
  for (std::size_t row = moved.original.size(); row < moved.working.size(); ++row)
    closing += moved.working.role()[row] == Role::seed && moved.working.cloud().mean.y[row] < 0.01f;
  EXPECT_LT(closing, 25u) << "along its outline alone; all of it would be 85. What is deeper leaves a hollow";
}

TEST(Repair, CorrectsAgainAsOneMadeAnewWould) {
  const auto correct = [](Repair& repair, const Moved& moved, WorkingScene& working, int interval) {
    return repair.correct(working, moved.masks, {interval, 1, 0.5}, [](double) { return Result<void>{}; });
  };
  struct Sample {
    BlockScene block;
    bool is_seeded;
  };
  for (auto& [block, is_seeded] : std::array{Sample{BlockScene(/*gap=*/0.5f), false}, Sample{lifted_hatch(), true}}) {
    make_finer(block);
    Moved moved(std::move(block));
    Repair repair = moved.repair();
    ASSERT_TRUE(correct(repair, moved, moved.working, 1));
    const std::vector<std::uint32_t> seeds = moved.working.rows_of(Role::seed);
    EXPECT_EQ(!seeds.empty(), is_seeded);
    const Vec3 eye(moved.block.cameras[0].centre());
    scene::GaussianCloud& gaussians = moved.working.gaussians();
    // Changed as by an optimisation: deeper, and faint, so that they close little.
    for (const std::uint32_t row : seeds) {
      gaussians.mean.set(row, eye + 1.1f * (gaussians.mean.get(row) - eye));
      gaussians.opacity_logit[row] = -2;
    }
    for (const std::uint32_t row : moved.working.rows_of(Role::copy)) gaussians.opacity_logit[row] -= 1;
    WorkingScene working = moved.working;
    const auto again = correct(repair, moved, moved.working, 2);
    Repair another = moved.repair();
    const auto anew = correct(another, moved, working, 2);
    ASSERT_TRUE(again && anew);
    EXPECT_TRUE(again->pictures == anew->pictures) << seeds.size() << " seeds";
    EXPECT_TRUE(working::members_of(moved.working) == working::members_of(working)) << seeds.size() << " seeds";
  }
}

TEST(Repair, LeavesAPitOpenThatViewsHaveLookedInto) {
  // The block hangs before a pit in the floor for the view in the middle; those at the ends see into it past the block.
  BlockScene block(/*gap=*/0.5f);
  const auto in_pit = [](Vec3 mean, float reach) {
    return std::abs(mean.x) < reach && std::abs(mean.z - 0.75f) < reach;
  };
  for (std::size_t row = 0; row < block.floor_rows; ++row)
    if (in_pit(block.cloud.mean.get(row), 0.25f)) block.cloud.mean.y[row] = 0.5f;  // its bottom
  for (int i = -12; i <= 12; ++i)
    for (int k = -12; k <= 12; ++k)
      add_gaussian(block.cloud, {0.15f * float(i), 0.5f, 0.15f * float(k)}, {0.1f, 0.01f, 0.1f}, 4, floor_color);
  make_finer(block);  // so that the rim of the pit is narrow
  Moved moved(std::move(block));
  moved.corrector.answer = [](const correct::CorrectionTask& flawed) { return painted(flawed, {0, 1, 0}); };
  ASSERT_TRUE(moved.correct());
  std::size_t over_pit = 0, beside = 0;
  for (std::size_t row = moved.original.size(); row < moved.working.size(); ++row) {
    if (moved.working.role()[row] != Role::seed || std::abs(moved.working.cloud().mean.y[row]) > 0.15f) continue;
    ++(in_pit(moved.working.cloud().mean.get(row), 0.12f) ? over_pit : beside);
  }
  // Only along the rim, where fewer than two views see past the block into it; else there would be some 45.
  EXPECT_LT(over_pit, 25u) << beside << " beside it";
}

TEST(Repair, ClearsTheVeilBeforeThePartOnlyWhereItStays) {
  BlockScene block;
  const auto first = std::uint32_t(block.cloud.size());
  for (int i = -2; i <= 2; ++i)
    for (int k = -2; k <= 2; ++k)
      add_gaussian(block.cloud, {0.9f + 0.06f * float(i), -0.6f, 0.06f * float(k)}, {0.05f, 0.02f, 0.05f}, -3.2f,
                   {0.26f, 0.43f, 0.6f});  // as the floor shows: between its Gaussians shines the dark below
  std::size_t left[2] = {0, 0};            // pixels
  for (const bool arrives : {false, true}) {
    SCOPED_TRACE(arrives);
    Moved moved(block);
    Repair repair = moved.repair();
    const auto go_on = [](double) { return Result<void>{}; };
    ASSERT_TRUE(repair.correct(moved.working, moved.masks, {1, 1, 0.5, arrives}, go_on));
    const auto second_time = repair.correct(moved.working, moved.masks, {2, 1, 0.5, arrives}, go_on);
    ASSERT_TRUE(second_time);
    left[std::size_t(arrives)] = second_time->uncovered[0].pixels;
    for (std::uint32_t row = first; row < moved.working.input_rows(); ++row)
      EXPECT_EQ(moved.working.role()[row], arrives ? Role::original : Role::frozen) << row;
  }
  EXPECT_EQ(left[1], left[0]) << "the veil was not the part's";
}

TEST(Repair, CompletesAPlaceOnce) {
  Moved moved;
  Repair repair = moved.repair();
  const auto correct = [&](const Round& round) {
    return repair.correct(moved.working, moved.masks, round, [](double) { return Result<void>{}; });
  };
  const auto first = correct({1, 1, 0.5});
  ASSERT_TRUE(first);
  const std::vector<std::uint32_t> seeds = moved.working.rows_of(Role::seed);
  ASSERT_FALSE(seeds.empty());
  for (const std::uint32_t row : seeds) EXPECT_EQ(first->trust[row], 0.0f) << "to be optimised";
  for (const std::uint32_t row : moved.working.rows_of(Role::copy)) moved.working.note_mean(row);  // the next interval
  for (const Round& round : {Round{1, 2, 0.4}, Round{2, 1, 0.5}}) {
    const auto again = correct(round);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->seeds, 0u);
    EXPECT_TRUE(again->uncovered.empty());
    for (const std::uint32_t row : seeds) EXPECT_EQ(again->trust[row], 1.0f) << "it stays";
  }
  const auto last = correct({2, 1, 0.5, /*arrives=*/true});
  ASSERT_TRUE(last);
  EXPECT_EQ(last->uncovered.size(), moved.block.cameras.size());
}

TEST(Repair, TellsWhatIsLeftOpenAndWhere) {
  Moved on_floor, before_all(before_rubble());
  const auto completed = on_floor.correct(), open = before_all.correct();
  ASSERT_TRUE(completed && open);
  ASSERT_EQ(completed->uncovered.size(), on_floor.block.cameras.size());
  for (std::size_t v = 0; v < on_floor.block.cameras.size(); ++v) {
    const Uncovered& there = completed->uncovered[v];
    EXPECT_LT(double(there.open), 0.1 * double(there.pixels)) << v << ": the floor goes on, but for rims";
  }
  const Uncovered &there = completed->uncovered[0], &nowhere = open->uncovered[0];
  EXPECT_NEAR(double(there.pixels), double(nowhere.pixels), 0.1 * double(nowhere.pixels))
      << "the same block has left, and its foot shines a little through a floor";
  EXPECT_GT(double(nowhere.open), 0.5 * double(nowhere.pixels));
  const scene::Mask below = before_all.uncovered(0);
  const scene::Rect hidden = scene::bounding_box(below), box = nowhere.open_box;
  EXPECT_TRUE(box.x0 <= hidden.x0 && box.y0 <= hidden.y0 && box.x1 >= hidden.x1 && box.y1 >= hidden.y1);
  EXPECT_GE(std::size_t(box.width() * box.height()), nowhere.open);
  Moved drawn_out(0, Mode::extend);
  const auto extended = drawn_out.correct();
  ASSERT_TRUE(extended);
  EXPECT_TRUE(extended->uncovered.empty()) << "nothing has left its place";
}

TEST(Repair, LeavesNothingOpenWhereThereIsMereAir) {
  Moved in_void(without_floor());
  const auto corrected = in_void.correct();
  ASSERT_TRUE(corrected);
  for (const Uncovered& seen : corrected->uncovered) {
    EXPECT_EQ(seen.pixels, 0u) << "nothing that could be completed";
    EXPECT_EQ(seen.open, 0u);
  }
}

TEST(Repair, KeepsInThePictureWhatWasFilledInWhereNoSurfaceGoesOn) {
  Moved moved(without_floor());
  bool first = true;
  moved.corrector.answer = [&](const correct::CorrectionTask& flawed) {
    const bool is_background = std::exchange(first, !first);
    return painted(flawed, is_background ? Vec3(0, 1, 0) : Vec3(0, 0, 1));
  };
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->seeds, 0u);
  for (std::size_t v = 0; v < moved.block.cameras.size(); ++v) {
    const scene::Mask uncovered = moved.uncovered(v);
    for (std::size_t i = 0; i < uncovered.data.size(); ++i) {
      if (uncovered.data[i] == 0) continue;
      EXPECT_GT(outcome->pictures[v].plane(1)[i], 0.99f) << v;
      EXPECT_LT(outcome->pictures[v].plane(2)[i], 0.01f) << v << ": it is not asked for again";
    }
  }
}

TEST(Repair, OfAnExtendShowsThePartOpaqueAndAsksOnce) {
  Moved moved(0, Mode::extend);
  const WorkingScene before = moved.working;
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->seeds, 0u);
  EXPECT_EQ(moved.corrector.asked.size(), moved.block.cameras.size());
  EXPECT_EQ(moved.working.cloud(), before.cloud()) << "opacities are lowered again afterwards";
  for (std::size_t v = 0; v < moved.block.cameras.size(); ++v) {
    const scene::Camera& camera = moved.block.cameras[v];
    const scene::Image input = render::forward(moved.original, camera).color, lowered = shown(before, camera);
    double of_picture = 0, of_lowered = 0, count = 0;
    for (std::size_t i = 0; i < input.pixels(); ++i) {
      if (input.plane(0)[i] < 0.5f) continue;  // not the block
      of_picture += double(std::abs(outcome->pictures[v].plane(0)[i] - input.plane(0)[i]));
      of_lowered += double(std::abs(lowered.plane(0)[i] - input.plane(0)[i]));
      ++count;
    }
    EXPECT_GT(count, 50) << v;
    EXPECT_LT(of_picture / count, 0.01) << v;
    EXPECT_GT(of_lowered / count, 0.03) << v << ": otherwise this shows nothing";
  }
}

TEST(Repair, HoldsWhatWasSeenAndLetsTheRestGo) {
  Moved moved;
  const auto outcome = moved.correct();
  ASSERT_TRUE(outcome);
  const auto& trust = outcome->trust;
  ASSERT_EQ(trust.size(), moved.working.size());
  float least = 1, most = 0;
  for (std::size_t row = 0; row < trust.size(); ++row) {
    ASSERT_GE(trust[row], 0);
    ASSERT_LE(trust[row], 1);
    const Role role = moved.working.role()[row];
    if (role == Role::copy) {
      least = std::min(least, trust[row]), most = std::max(most, trust[row]);
    } else {
      EXPECT_EQ(trust[row], 0) << row;
    }
  }
  EXPECT_EQ(most, 1) << "the block's top";
  EXPECT_LT(least, 0.05f) << "its inside";
}

TEST(Repair, AsksForEveryPictureWithTheStrengthOfTheCorrection) {
  for (const double strength : {0.8, 0.25}) {
    Moved moved;
    ASSERT_TRUE(moved.correct({1, 2, strength}));
    EXPECT_EQ(moved.corrector.strengths, std::vector<double>(moved.corrector.asked.size(), strength));
  }
}

TEST(Repair, GoesOutwardFromTheViewThatShowsMostOfTheHoleAndTellsHowFarItIs) {
  BlockScene block;
  std::swap(block.cameras[0], block.cameras[2]);
  block.cameras[3].fx *= 1.3, block.cameras[3].fy *= 1.3;
  Moved moved(std::move(block));
  std::vector<double> told;
  Repair repair = moved.repair();
  ASSERT_TRUE(repair.correct(moved.working, moved.masks, {1, 1, 0.5}, [&](double done) {
    told.push_back(done);
    return Result<void>{};
  }));
  ASSERT_EQ(told.size(), 16u) << "five views looked through, the closure, five views looked at, five corrected";
  EXPECT_EQ(std::count(told.begin(), told.end(), 0.0), 5) << "which takes next to no time";
  told.erase(told.begin(), told.begin() + 5);
  for (std::size_t k = 1; k < told.size(); ++k) EXPECT_GT(told[k], told[k - 1]) << k;
  for (std::size_t k = 7; k < told.size(); ++k)
    EXPECT_NEAR(told[k] - told[k - 1], told[6] - told[5], 1e-12) << "as much for each view that is corrected";
  EXPECT_NEAR(told.back(), 1, 1e-12);
  std::vector<std::size_t> order;
  const std::span<const correct::CorrectionTask> asked = moved.corrector.of_views();
  for (std::size_t k = 0; k < asked.size(); k += 2) order.push_back(asked[k].examples[0]);
  ASSERT_EQ(order.size(), 5u);
  EXPECT_EQ(order[0], 3u);
  EXPECT_EQ(std::set(order.begin(), order.end()).size(), 5u);
  const int place_on_arc[] = {2, 1, 0, 3, 4};
  for (std::size_t k = 1; k < 5; ++k)
    EXPECT_TRUE(
        std::any_of(order.begin(), order.begin() + std::ptrdiff_t(k),
                    [&](std::size_t before) { return std::abs(place_on_arc[before] - place_on_arc[order[k]]) == 1; }))
        << k << ": beside one that is done";
}

TEST(Repair, BeginsWithAViewWhoseBorderDoesNotCutTheHoleOff) {
  // The fourth view is nearer than the others and shows more of the hole: also where half of that is beyond its border.
  const auto first_view = [](bool cut_off) {
    BlockScene block;
    scene::Camera& near = block.cameras[3];
    near.fx *= 1.6, near.fy *= 1.6;
    if (cut_off) near.cx -= near.pixel_from_cam(near.cam_from_world(block.middle)).x;
    Moved moved(std::move(block));
    EXPECT_TRUE(moved.correct());
    return moved.corrector.of_views()[0].examples[0];
  };
  EXPECT_EQ(first_view(false), 3u);
  EXPECT_NE(first_view(true), 3u);
}

TEST(Repair, EndsWithTheErrorOfTheCorrectorOrOfWhoeverIsTold) {
  Moved failing;
  failing.corrector.answer = [](const correct::CorrectionTask&) -> Result<scene::Image> {
    return fail(ErrorCode::unavailable, "out of order", "corrector");
  };
  const auto failed = failing.correct();
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().where, "corrector");
  for (const int enough : {2, 6, 8, 12}) {  // while views are looked through, after the closure, ..., one is corrected
    Moved told;
    int calls = 0;
    const auto ended = told.repair().correct(told.working, told.masks, {1, 1, 0.5}, [&](double) -> Result<void> {
      if (++calls < enough) return {};
      return fail(ErrorCode::cancelled, "enough", "here");
    });
    ASSERT_FALSE(ended) << enough;
    EXPECT_EQ(ended.error().where, "here");
    EXPECT_EQ(told.corrector.asked.size(), enough < 12 ? 0u : 3u) << enough << ": the chart and one view, twice";
  }
}

}  // namespace
}  // namespace engine::repair
