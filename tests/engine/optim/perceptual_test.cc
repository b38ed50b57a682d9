#include "engine/optim/perceptual.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/optim/losses_reference.h"
#include "tests/engine/optim/pictures.h"

namespace engine::optim {
namespace {

/// MsSsimLoss by the reference, in double.
double reference_loss(const std::vector<double>& x, const scene::Image& target, const MsSsimOptions& options) {
  double loss = 0, l1 = 0;
  for (int c = 0; c < target.channels; ++c) {
    reference::Plane<double> plane(target.width, target.height);
    std::copy_n(x.begin() + std::ptrdiff_t(plane.data.size()) * c, plane.data.size(), plane.data.begin());
    const auto other = plane_of<double>(target, c);
    loss += reference::ms_ssim_loss(plane, other, options) / target.channels;
    for (std::size_t i = 0; i < plane.data.size(); ++i)
      l1 += reference::smooth_l1(plane.data[i] - other.data[i], options.l1.kind, options.l1.scale);
  }
  return options.ms_ssim_weight * loss + (1 - options.ms_ssim_weight) * l1 / double(target.data.size());
}

TEST(MsSsimScales, AreAsManyAsHoldAWindow) {
  EXPECT_EQ(ms_ssim_scales(1, 1), 1);
  EXPECT_EQ(ms_ssim_scales(21, 500), 1);
  EXPECT_EQ(ms_ssim_scales(22, 500), 2);
  EXPECT_EQ(ms_ssim_scales(88, 88), 4);
  EXPECT_EQ(ms_ssim_scales(176, 176), 5);
  EXPECT_EQ(ms_ssim_scales(10000, 10000), 5);
  for (int scales = 1; scales <= 5; ++scales) {
    double sum = 0;
    for (const double weight : ms_ssim_weights(scales)) sum += weight;
    EXPECT_DOUBLE_EQ(sum, 1.0);
  }
}

TEST(MsSsimLoss, MatchesTheReferenceAtEachNumberOfScales) {
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 9}, {25, 31}, {45, 50}, {91, 89}, {177, 181}}) {
    SCOPED_TRACE(testing::Message() << width << " x " << height);
    const MsSsimOptions options;
    const scene::Image target = waves(width, height), rendered = disturbed(target, 0.2f, 1);
    MsSsimLoss loss(options);
    scene::Image v;
    const auto seen = loss.evaluate(rendered, target, v);
    ASSERT_TRUE(seen);
    EXPECT_NEAR(*seen, reference_loss({rendered.data.begin(), rendered.data.end()}, target, options), 2e-6);
  }
}

TEST(MsSsimLoss, GradientMatchesCentralDifferencesOfTheReference) {
  const MsSsimOptions options{.l1 = {.kind = SmoothL1::charbonnier}};
  for (const auto& [width, height] : {std::pair{9, 6}, {24, 23}, {45, 47}}) {
    SCOPED_TRACE(testing::Message() << width << " x " << height);
    const scene::Image target = waves(width, height), rendered = disturbed(target, 0.2f, 1);
    MsSsimLoss loss(options);
    scene::Image v;
    ASSERT_TRUE(loss.evaluate(rendered, target, v));
    std::vector<double> x(rendered.data.begin(), rendered.data.end());
    double largest = 0;
    for (const float value : v.data) largest = std::max(largest, std::abs(double(value)));
    for (std::size_t i = 0; i < x.size(); i += 1 + x.size() / 40) {
      const double here = x[i], h = 1e-5;
      x[i] = here + h;
      const double above = reference_loss(x, target, options);
      x[i] = here - h;
      const double below = reference_loss(x, target, options);
      x[i] = here;
      EXPECT_NEAR(v.data[i], (above - below) / (2 * h), 1e-4 * largest) << "value " << i;
    }
  }
}

TEST(MsSsimLoss, OfEqualPicturesIsExactlyZeroAndSoIsItsGradient) {
  for (const scene::Image& picture : {waves(100, 60), scene::Image(40, 40, 3, 0.3f), scene::Image(1, 1, 3)}) {
    MsSsimLoss loss;
    scene::Image v(3, 3, 1, 9.0f);  // of another size, and not zero: both are overwritten
    EXPECT_EQ(loss.evaluate(picture, picture, v).value(), 0.0);
    EXPECT_EQ(v, scene::Image(picture.width, picture.height, 3));
  }
}

TEST(MsSsimLoss, OfAPictureAndItsNegativeIsFiniteThoughTermsAreNegative) {
  const scene::Image target = noise(50, 50, 1);
  scene::Image rendered = target;
  for (float& value : rendered.data) value = 1 - value;
  scene::Image v;
  const auto seen = MsSsimLoss().evaluate(rendered, target, v);
  ASSERT_TRUE(seen);
  EXPECT_GT(*seen, 0.5);
  EXPECT_LT(*seen, 1.0);
  EXPECT_FALSE(first_not_finite(v.data));
}

TEST(MsSsimLoss, BelowTheFloorOnlyTheL1Pulls) {
  const scene::Image target = waves(50, 50), rendered = disturbed(target, 0.3f, 1);
  const MsSsimOptions options{.floor = 0.99};
  scene::Image v, v_l1(50, 50, 3);
  const double seen = MsSsimLoss(options).evaluate(rendered, target, v).value();
  LossWorkspace workspace;
  const double l1 = smooth_l1_loss(view(rendered), view(target), {}, 2500, options.l1, 0.16, workspace, view(v_l1));
  EXPECT_NEAR(seen, 0.84 * (1 - 0.99) + 0.16 * l1, 1e-12);
  for (std::size_t i = 0; i < v.data.size(); ++i) ASSERT_NEAR(v.data[i], v_l1.data[i], 1e-12);
}

TEST(MsSsimLoss, HasTheSameBytesForAnyNumberOfThreads) {
  const scene::Image target = waves(200, 190), rendered = disturbed(target, 0.2f, 1);
  auto compute = [&](int threads) {
    std::pair<double, scene::Image> out;
    WorkArena(threads).run([&] { out.first = MsSsimLoss().evaluate(rendered, target, out.second).value(); });
    return out;
  };
  EXPECT_EQ(compute(1), compute(4));
}

TEST(MsSsimLoss, CanBeUsedAgainWithAnotherSize) {
  MsSsimLoss used;
  scene::Image v_used, v_fresh;
  const scene::Image large = waves(180, 180), small = waves(30, 40);
  ASSERT_TRUE(used.evaluate(large, disturbed(large, 0.1f, 1), v_used));
  const auto again = used.evaluate(small, disturbed(small, 0.1f, 2), v_used);
  EXPECT_EQ(again.value(), MsSsimLoss().evaluate(small, disturbed(small, 0.1f, 2), v_fresh).value());
  EXPECT_EQ(v_used, v_fresh);
}

TEST(EditLoss, ComparesThePixelsOfTheMaskOnly) {
  const scene::Image rendered = noise(60, 50, 1), edited = noise(60, 50, 2);
  const scene::Rect box{10, 5, 50, 45};
  const scene::Mask mask = scattered_mask(60, 50, 2, 3);
  scene::Image composite(40, 40, 3), target(40, 40, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 40; ++x) {
        target.at(x, y, c) = edited.at(x + 10, y + 5, c);
        composite.at(x, y, c) = mask.at(x + 10, y + 5) ? rendered.at(x + 10, y + 5, c) : target.at(x, y, c);
      }
  MsSsimLoss loss;
  scene::Image v_composite, v(60, 50, 3);
  const double expected = loss.evaluate(composite, target, v_composite).value();
  EditWorkspace workspace;
  const auto seen =
      edit_loss(loss, crop(rendered, box), crop(edited, box), crop(mask, box), 3000, 2.0, workspace, crop(v, box));
  ASSERT_TRUE(seen);
  EXPECT_DOUBLE_EQ(*seen, expected * 1600 / 3000);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 50; ++y)
      for (int x = 0; x < 60; ++x) {
        const bool inside = x >= 10 && x < 50 && y >= 5 && y < 45 && mask.at(x, y) != 0;
        const float v_here = inside ? v_composite.at(x - 10, y - 5, c) : 0.0f;
        ASSERT_NEAR(v.at(x, y, c), v_here * 2 * 1600 / 3000, 1e-9) << x << ", " << y;
      }
}

TEST(EditLoss, TakesTheDeadZoneOffEveryDifference) {
  const scene::Image edited = waves(40, 30);
  const scene::Image rendered = disturbed(edited, 0.03f, 6);
  scene::Mask mask(40, 30);
  std::fill(mask.data.begin(), mask.data.end(), 1);
  constexpr float dead_zone = 0.01f;
  scene::Image nearer = rendered;
  for (std::size_t i = 0; i < nearer.data.size(); ++i) {
    const float difference = rendered.data[i] - edited.data[i];
    nearer.data[i] =
        std::abs(difference) <= dead_zone ? edited.data[i] : rendered.data[i] - std::copysign(dead_zone, difference);
  }
  MsSsimLoss loss;
  EditWorkspace workspace;
  scene::Image v(40, 30, 3), v_nearer(40, 30, 3);
  const auto with = edit_loss(loss, view(rendered), view(edited), view(mask), 1200, 1, workspace, view(v), dead_zone);
  const auto plain = edit_loss(loss, view(nearer), view(edited), view(mask), 1200, 1, workspace, view(v_nearer));
  EXPECT_EQ(with.value(), plain.value());
  for (std::size_t i = 0; i < v.data.size(); ++i)
    ASSERT_EQ(v.data[i], nearer.data[i] == edited.data[i] ? 0.0f : v_nearer.data[i]) << i;
}

TEST(EditLoss, BrighterThanAStoredPictureCanSayIsNoDifference) {
  scene::Image rendered = noise(40, 30, 3);
  for (float& value : rendered.data) value = 1.5f * value - 0.2f;
  scene::Image edited = rendered;
  for (float& value : edited.data) value = std::clamp(value, 0.0f, 1.0f);
  scene::Mask mask(40, 30);
  std::fill(mask.data.begin(), mask.data.end(), 1);
  MsSsimLoss loss;
  EditWorkspace workspace;
  scene::Image v(40, 30, 3);
  const auto with = [&](float dead_zone) {
    return edit_loss(loss, view(rendered), view(edited), view(mask), 1200, 1, workspace, view(v), dead_zone).value();
  };
  EXPECT_EQ(with(0.001f), 0);
  EXPECT_GT(with(0), 0);
}

TEST(EditLoss, RoundingWithinTheDeadZoneIsExactlyNothing) {
  const scene::Image rendered = noise(40, 30, 3);
  scene::Image edited = rendered;
  for (float& value : edited.data) value = std::round(value * 255) / 255;
  scene::Mask mask(40, 30);
  std::fill(mask.data.begin(), mask.data.end(), 1);
  MsSsimLoss loss;
  EditWorkspace workspace;
  scene::Image v(40, 30, 3);
  EXPECT_EQ(edit_loss(loss, view(rendered), view(edited), view(mask), 1200, 1, workspace, view(v), 0.5f / 255 + 1e-6f)
                .value(),
            0);
  EXPECT_EQ(v.data, std::vector<float>(v.data.size(), 0.0f));
}

TEST(EditLoss, OfAnEmptyBoxIsZero) {
  scene::Image picture = noise(8, 8, 1), v(8, 8, 3);
  const scene::Mask mask(8, 8);
  MsSsimLoss loss;
  EditWorkspace workspace;
  EXPECT_EQ(
      edit_loss(loss, crop(picture, {}), crop(picture, {}), crop(mask, {}), 64, 1, workspace, crop(v, {})).value(),
      0.0);
}

/// What LPIPS will do if its network fails.
class FailingLoss final : public PerceptualLoss {
 public:
  Result<double> evaluate(const scene::Image&, const scene::Image&, scene::Image&) override {
    return fail(ErrorCode::unavailable, "No weights.", "model");
  }
};

TEST(EditLoss, CarriesUpTheErrorOfTheLossAndLeavesTheGradient) {
  const scene::Image picture = noise(8, 8, 1);
  const scene::Mask mask = scattered_mask(8, 8, 2, 1);
  scene::Image v(8, 8, 3);
  FailingLoss loss;
  EditWorkspace workspace;
  const auto seen = edit_loss(loss, view(picture), view(picture), view(mask), 64, 1, workspace, view(v));
  ASSERT_FALSE(seen);
  EXPECT_EQ(seen.error().code, ErrorCode::unavailable);
  EXPECT_EQ(v, scene::Image(8, 8, 3));
}

TEST(MsSsimOptions, ThatMakeNoSenseAreNamed) {
  EXPECT_TRUE(validate(MsSsimOptions{}));
  EXPECT_EQ(validate(MsSsimOptions{.ms_ssim_weight = 1.5}).error().where, "ms_ssim_weight");
  EXPECT_EQ(validate(MsSsimOptions{.floor = 0}).error().where, "floor");
  EXPECT_EQ(validate(MsSsimOptions{.l1 = {.scale = -1}}).error().where, "l1.scale");
}

}  // namespace
}  // namespace engine::optim
