#include "engine/train/trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/forward.h"

namespace engine::train {
namespace {

scene::GaussianCloud blob(std::size_t n, std::uint64_t seed, Vec3 centre, float radius) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 1;
  cloud.resize(n);
  Rng rng(seed);
  for (std::size_t i = 0; i < n; ++i) {
    cloud.mean.set(i, centre + radius * Vec3(rng.normal(), rng.normal(), rng.normal()));
    cloud.log_scale.set(i, {rng.uniform(-3.5f, -2.5f), rng.uniform(-3.5f, -2.5f), rng.uniform(-3.5f, -2.5f)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-1.0f, 3.0f);
  }
  for (float& value : cloud.sh) value = 0.3f * rng.normal();
  return cloud;
}

/// A wall with a few things in front of it; some of them are changeable.
struct Setting {
  scene::GaussianCloud base = blob(3000, 1, {0, 0, 0}, 0.5f);
  scene::GaussianCloud changeable = blob(150, 2, {0.3f, 0.2f, -2}, 0.1f);
  std::vector<float> mobility;  // of the changeable ones
  std::vector<std::uint32_t> hidden{5, 90};
  std::vector<scene::Camera> cameras;
  scene::Mask mask{320, 240};
  optim::MsSsimLoss loss;

  Setting() {
    for (int k = 0; k < 4; ++k)
      cameras.push_back(scene::look_at({0.5 * k - 0.75, 0.3 * k - 0.4, -5}, {0, 0, -2}, {0, -1, 0}, 0.8, 320, 240));
    for (int y = 100; y < 180; ++y)
      for (int x = 145; x < 230; ++x) mask.at(x, y) = 1;
  }
  [[nodiscard]] Trainer trainer(const TrainOptions& options = {}) {
    return Trainer({&base, hidden}, {changeable, {}, mobility}, 10, options, loss);
  }
  /// A trainer whose views show something else than they should: the changeable part as it was before a push and in its
  /// old colours.
  [[nodiscard]] Trainer pushed(const TrainOptions& options = {}) {
    const scene::GaussianCloud before = changeable;
    for (float& x : changeable.mean.x) x += 0.005f;
    for (float& value : changeable.sh) value += 0.1f;
    Trainer out = trainer(options);
    changeable = before;
    for (const scene::Camera& camera : cameras) out.add_view(camera, mask, before);
    for (std::size_t v = 0; v < out.views(); ++v) {
      static_cast<void>(out.render(v));  // so that what it keeps is at hand
      render::LocalFrame frame;
      frame.project(before, cameras[v]);
      frame.merge(out.view(v).frozen);
      scene::Image picture = out.view(v).frozen.color();
      frame.forward(out.view(v).frozen, picture);
      out.set_edited(v, std::move(picture));
    }
    return out;
  }
};

/// Trains, and gives the loss of each iteration.
std::vector<double> train(Trainer& trainer, int iterations, const RandomKey& key = {}) {
  trainer.begin_correction(key, iterations);
  std::vector<double> losses;
  for (int i = 0; i < iterations; ++i) losses.push_back(trainer.step().value().loss);
  return losses;
}

double mean(const std::vector<double>& values, std::size_t first, std::size_t count) {
  return std::accumulate(values.begin() + std::ptrdiff_t(first), values.begin() + std::ptrdiff_t(first + count), 0.0) /
         double(count);
}

TEST(Trainer, TheLossFalls) {
  Setting setting;
  Trainer trainer = setting.pushed();
  const auto losses = train(trainer, 120);
  EXPECT_LT(mean(losses, 116, 4), 0.5 * mean(losses, 0, 4)) << losses.front() << " to " << losses.back();
}

TEST(Trainer, KeepsToItsMemoryAndGivesTheSameBytes) {
  Setting one, other;
  Trainer free = one.pushed();
  Trainer bound = other.pushed({.frozen_memory = 1});
  EXPECT_LT(bound.memory_bytes(), free.memory_bytes());
  std::size_t let_go = 0;
  for (std::size_t v = 0; v < bound.views(); ++v) let_go += bound.view(v).frozen.is_let_go();
  EXPECT_EQ(let_go, bound.views() - 1) << "all but the one in use";
  EXPECT_EQ(train(free, 30), train(bound, 30));
  EXPECT_EQ(free.cloud(), bound.cloud());
}

TEST(Trainer, NothingMovesWhereThePicturesAreAsTheyShouldBe) {
  Setting setting;
  Trainer trainer = setting.trainer();
  for (const scene::Camera& camera : setting.cameras) trainer.add_view(camera, setting.mask, setting.changeable);
  const auto losses = train(trainer, 20);
  EXPECT_EQ(losses, std::vector<double>(20, 0.0));
  EXPECT_TRUE(trainer.cloud() == setting.changeable);
}

TEST(Trainer, SeesEveryViewOnceAnEpoch) {
  Setting setting;
  Trainer trainer = setting.pushed();
  trainer.begin_correction({.seed = 3}, 12);
  std::vector<std::vector<std::size_t>> epochs(3);
  for (auto& epoch : epochs) {
    for (int i = 0; i < 4; ++i) epoch.push_back(trainer.step().value().view);
    auto sorted = epoch;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(sorted, (std::vector<std::size_t>{0, 1, 2, 3}));
  }
  EXPECT_FALSE(epochs[0] == epochs[1] && epochs[1] == epochs[2]);
}

TEST(Trainer, LeavesOutViewsWithAnEmptyMask) {
  Setting setting;
  Trainer trainer = setting.trainer();
  EXPECT_FALSE(trainer.add_view(setting.cameras[0], scene::Mask(320, 240), setting.changeable));
  EXPECT_EQ(trainer.views(), 0u);
  EXPECT_TRUE(trainer.add_view(setting.cameras[1], setting.mask, setting.changeable));
  EXPECT_EQ(trainer.views(), 1u);
}

TEST(Trainer, TheBackgroundIsThatOfTheOriginalAndTheRestWhatIsShownNow) {
  Setting setting;
  const scene::GaussianCloud original = setting.changeable;
  for (float& x : setting.changeable.mean.x) x += 0.3f;
  Trainer trainer = setting.trainer();
  trainer.add_view(setting.cameras[1], setting.mask, original);
  const scene::Rect region = trainer.view(0).frozen.region();
  const auto whole = [&](const scene::GaussianCloud& top) {
    render::Layers layers(setting.base);
    layers.hidden = setting.hidden, layers.top = &top;
    return render::forward(layers, setting.cameras[1]).color;
  };
  const scene::Image before = whole(original), now = whole(setting.changeable);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) {
      const bool inside = x >= region.x0 && x < region.x1 && y >= region.y0 && y < region.y1;
      if (!inside) {
        ASSERT_EQ(before.at(x, y), now.at(x, y)) << x << ", " << y;
        continue;
      }
      ASSERT_EQ(trainer.view(0).background.at(x - region.x0, y - region.y0), before.at(x, y)) << x << ", " << y;
      ASSERT_NEAR(trainer.view(0).edited.at(x - region.x0, y - region.y0), std::clamp(now.at(x, y), 0.0f, 1.0f),
                  0.501 / 255)
          << x << ", " << y;
    }
}

TEST(Trainer, GivesTheSameBytesForAnyNumberOfThreads) {
  scene::GaussianCloud first;
  std::vector<double> first_losses;
  for (const int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      Setting setting;
      TrainOptions options;
      options.densify.every = 10, options.densify.gradient = 1e-9;
      Trainer trainer = setting.pushed(options);
      const auto losses = train(trainer, 30, {.seed = 1, .interval = 2});
      if (threads == 1) first = trainer.cloud(), first_losses = losses;
      EXPECT_TRUE(trainer.cloud() == first) << threads;
      EXPECT_EQ(losses, first_losses);
    });
  }
}

TEST(Trainer, ChildrenKnowTheirAncestorAndStayWithinTheCap) {
  Setting setting;
  TrainOptions options;
  options.densify.every = 5, options.densify.gradient = 1e-12, options.densify.most_growth = 0.1;
  Trainer trainer = setting.pushed(options);
  train(trainer, 30);
  EXPECT_GT(trainer.cloud().size(), 150u);
  EXPECT_LE(trainer.cloud().size(), 165u);
  ASSERT_EQ(trainer.ancestors().size(), trainer.cloud().size());
  for (std::size_t row = 0; row < trainer.ancestors().size(); ++row) {
    EXPECT_LT(trainer.ancestors()[row], 150u);
    if (row < trainer.initial_rows()) {
      EXPECT_EQ(trainer.ancestors()[row], row);
    }
  }
}

TEST(Trainer, RowsOfNoMobilityStayAsTheyAre) {
  Setting setting;
  setting.mobility.resize(150);
  for (std::size_t row = 0; row < 150; ++row) setting.mobility[row] = float(row % 2);
  Trainer trainer = setting.pushed();
  const scene::GaussianCloud before = trainer.cloud();
  train(trainer, 20);
  ASSERT_EQ(trainer.cloud().size(), 150u);
  std::vector<std::uint8_t> stays(150);
  for (std::size_t row = 0; row < 150; ++row) stays[row] = row % 2 == 0;
  EXPECT_TRUE(scene::select(trainer.cloud(), stays) == scene::select(before, stays));
  std::size_t moved = 0;
  for (std::size_t row = 1; row < 150; row += 2) moved += trainer.cloud().mean.get(row) != before.mean.get(row);
  EXPECT_GT(moved, 50u);
}

TEST(Trainer, NoPositionRateIsLargerThanAShareOfTheRowsWidth) {
  TrainOptions options;
  options.rates.most_widths = 0.125;
  Setting setting;
  const std::array<Vec3, 3> of_one_width{Vec3(-9, -7, -3), Vec3(-3, -9, -7), Vec3(-7, -3, -9)};
  for (std::size_t row = 0; row < 150; row += 2) setting.changeable.log_scale.set(row, of_one_width[row / 2 % 3]);
  Trainer trainer = setting.pushed(options);
  const scene::GaussianCloud before = trainer.cloud();
  train(trainer, 1);
  const double share = 0.125 * std::exp(-7.0);
  std::array<double, 3> longest{};  // along an axis: the first step of Adam is as long as the rate
  double of_others = 0;
  for (std::size_t row = 0; row < 150; ++row) {
    const Vec3 way = glm::abs(trainer.cloud().mean.get(row) - before.mean.get(row));
    double& most = row % 2 == 0 ? longest[row / 2 % 3] : of_others;
    most = std::max({most, double(way.x), double(way.y), double(way.z)});
  }
  for (const double way : longest) EXPECT_NEAR(way, share, 0.01 * share);
  EXPECT_GT(of_others, 1.2 * share) << "the rate of all, where rows are large enough";
}

TEST(Trainer, AMobilityOfOneEverywhereIsTheSameAsNone) {
  Setting one, other;
  other.mobility.assign(150, 1.0f);
  TrainOptions options;
  options.densify.every = 5, options.densify.gradient = 1e-12;
  Trainer without = one.pushed(options), with = other.pushed(options);
  EXPECT_EQ(train(without, 20), train(with, 20));
  EXPECT_GT(with.cloud().size(), 150u) << "children have a mobility as well";
  EXPECT_TRUE(with.cloud() == without.cloud());
}

TEST(Trainer, RowsThatHardlyMoveGetNoChildren) {
  Setting setting;
  setting.mobility.resize(150);
  for (std::size_t row = 0; row < 150; ++row) setting.mobility[row] = row % 3 == 0 ? 1.0f : 0.01f;
  TrainOptions options;
  options.densify.every = 5, options.densify.gradient = 1e-12, options.densify.most_growth = 2;
  Trainer trainer = setting.pushed(options);
  train(trainer, 30);
  ASSERT_GT(trainer.cloud().size(), 150u);
  for (std::size_t row = 150; row < trainer.cloud().size(); ++row) EXPECT_EQ(trainer.ancestors()[row] % 3, 0u) << row;
}

TEST(Trainer, RemovesChildrenThatFloatInFrontOfThePart) {
  Setting setting;
  TrainOptions options;
  options.densify = {.every = 5, .until = 1, .gradient = 1e-12, .dense = 0, .most_growth = 1};  // only splits
  options.floater_distance = 0;
  Trainer trainer = setting.pushed(options);
  train(trainer, 20);
  EXPECT_GT(trainer.floaters_removed(), 0u);
  EXPECT_GE(trainer.cloud().size(), trainer.initial_rows());
  EXPECT_EQ(trainer.ancestors().size(), trainer.cloud().size());
}

TEST(Trainer, KeepsUpWithGaussiansThatLeaveTheirRegion) {
  Setting setting;
  TrainOptions options;
  options.rates.position = 0.5;  // far too much: Gaussians fly about
  options.rates.most_widths = std::numeric_limits<double>::infinity();
  options.rates.last = 1;
  Trainer trainer = setting.pushed(options);
  const scene::Rect before = trainer.view(0).frozen.region();
  train(trainer, 3);
  const scene::Image shown = trainer.render(0);
  const scene::Rect region = trainer.view(0).frozen.region();
  EXPECT_NE(before, region);
  const scene::GaussianCloud now = trainer.cloud();
  render::Layers layers(setting.base);
  layers.hidden = setting.hidden, layers.top = &now;
  const scene::Image whole = render::forward(layers, setting.cameras[0]).color;
  for (int y = region.y0; y < region.y1; ++y)
    for (int x = region.x0; x < region.x1; ++x)
      ASSERT_EQ(shown.at(x - region.x0, y - region.y0), whole.at(x, y)) << x << ", " << y;
}

/// Gives gradients that are not numbers from some call on.
class Poison final : public optim::PerceptualLoss {
 public:
  explicit Poison(int after) : after_(after) {}
  Result<double> evaluate(const scene::Image& rendered, const scene::Image& target, scene::Image& v) override {
    auto loss = loss_.evaluate(rendered, target, v);
    if (after_-- <= 0)
      for (float& value : v.data) value = std::numeric_limits<float>::quiet_NaN();
    return loss;
  }

 private:
  optim::MsSsimLoss loss_;
  int after_;
};

TEST(Trainer, APoisonedGradientIsAnErrorThatNamesTheParameter) {
  Setting setting;
  Poison poison(2);
  Trainer trainer({&setting.base, setting.hidden}, {setting.changeable, std::vector<std::uint32_t>(150, 4321)}, 10, {},
                  poison);
  scene::GaussianCloud original = setting.changeable;
  for (const scene::Camera& camera : setting.cameras) trainer.add_view(camera, setting.mask, original);
  for (std::size_t v = 0; v < trainer.views(); ++v) {
    scene::Image bright = trainer.render(v);
    for (float& value : bright.data) value += 0.1f;
    trainer.set_edited(v, bright);
  }
  trainer.begin_correction({}, 10);
  EXPECT_TRUE(trainer.step());
  EXPECT_TRUE(trainer.step());
  const auto poisoned = trainer.step();
  ASSERT_FALSE(poisoned);
  EXPECT_EQ(poisoned.error().code, ErrorCode::internal);
  EXPECT_TRUE(poisoned.error().where.starts_with("gaussian[4321].")) << poisoned.error().where;
}

TEST(Trainer, ParametersThatOverflowAreNamed) {
  Setting setting;
  setting.changeable.mean.x[7] = 3e38f;
  setting.changeable.opacity_logit[3] = 3.4e38f;
  TrainOptions options;
  options.rates.opacity_logit = 1e38;
  Trainer trainer = setting.pushed(options);
  trainer.begin_correction({}, 50);
  Result<IterationResult> last;
  for (int i = 0; i < 50 && last; ++i) last = trainer.step();
  ASSERT_FALSE(last);
  EXPECT_TRUE(last.error().where.starts_with("gaussian[")) << last.error().where;
  EXPECT_TRUE(last.error().where.ends_with("].opacity")) << last.error().where;
}

TEST(Trainer, AnIterationCostsWhatTheEditReaches) {
  Setting setting;
  Trainer few = setting.pushed();
  train(few, 4);
  // Ten times as many, where nothing is edited.
  const scene::GaussianCloud elsewhere = blob(30000, 8, {-2.6f, -1.6f, 0}, 0.03f);
  std::vector<std::uint32_t> rows(elsewhere.size());
  std::iota(rows.begin(), rows.end(), 0u);
  scene::append_rows(setting.base, elsewhere, rows);
  Trainer many = setting.pushed();
  train(many, 4);
  EXPECT_GT(few.last_cost().tiles, 0u);
  EXPECT_EQ(many.last_cost().tiles, few.last_cost().tiles);
  EXPECT_EQ(many.last_cost().entries, few.last_cost().entries);
  EXPECT_EQ(many.last_cost().frozen_splats, few.last_cost().frozen_splats);
  EXPECT_LT(few.last_cost().tiles, 100u);  // of 300
}

}  // namespace
}  // namespace engine::train
