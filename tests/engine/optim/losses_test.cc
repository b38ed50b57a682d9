#include "engine/optim/losses.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/optim/losses_reference.h"
#include "tests/engine/optim/pictures.h"

namespace engine::optim {
namespace {

using reference::Plane;

struct LossAndGradient {
  double loss = 0;
  scene::Image v;
};

LossAndGradient ssim_of(const scene::Image& rendered, const scene::Image& target, MaskView mask = {}) {
  LossWorkspace workspace;
  LossAndGradient out{0, scene::Image(rendered.width, rendered.height, rendered.channels)};
  out.loss = ssim_loss(view(rendered), view(target), mask, rendered.pixels(), 1, workspace, view(out.v));
  return out;
}

LossAndGradient l1_of(const scene::Image& rendered, const scene::Image& target, const L1Options& options,
                      MaskView mask = {}) {
  LossWorkspace workspace;
  LossAndGradient out{0, scene::Image(rendered.width, rendered.height, rendered.channels)};
  out.loss = smooth_l1_loss(view(rendered), view(target), mask, rendered.pixels(), options, 1, workspace, view(out.v));
  return out;
}

/// The same by the reference pass, in double.
struct Reference {
  double loss = 0;
  std::vector<double> v;  ///< As Image::data.
};
Reference ssim_reference(const scene::Image& rendered, const scene::Image& target, SsimTerm term,
                         const scene::Mask& mask = {}) {
  Reference out;
  const double values = double(rendered.data.size());
  for (int c = 0; c < rendered.channels; ++c) {
    const auto pass =
        reference::ssim_pass<double>(plane_of<double>(rendered, c), plane_of<double>(target, c), mask.data, term);
    out.loss += pass.sum / values;
    for (const double v : pass.v_x.data) out.v.push_back(v / values);
  }
  return out;
}

// ---- The formulas against differences, in double.

TEST(SsimReference, BackwardMatchesCentralDifferences) {
  for (const SsimTerm term : {SsimTerm::full, SsimTerm::contrast_structure}) {
    const scene::Image noisy = noise(13, 17, 3, 0.1f, 0.9f, 1);
    Plane<double> x = plane_of<double>(noisy, 0);
    const Plane<double> y = plane_of<double>(disturbed(noisy, 0.2f, 4), 0);
    const scene::Mask mask = scattered_mask(13, 17, 4, 5);
    const auto pass = reference::ssim_pass<double>(x, y, mask.data, term);
    for (std::size_t i = 0; i < x.data.size(); ++i) {
      const double here = x.data[i], h = 1e-5;
      x.data[i] = here + h;
      const double above = reference::ssim_pass<double>(x, y, mask.data, term).sum;
      x.data[i] = here - h;
      const double below = reference::ssim_pass<double>(x, y, mask.data, term).sum;
      x.data[i] = here;
      EXPECT_NEAR(pass.v_x.data[i], (above - below) / (2 * h), 1e-6) << "pixel " << i;
    }
  }
}

TEST(SmoothL1, BackwardMatchesCentralDifferences) {
  for (const SmoothL1 kind : {SmoothL1::dead_zone, SmoothL1::charbonnier})
    for (const double d : {-0.7, -0.011, -0.003, 0.0, 0.004, 0.02, 1.3}) {
      const double h = 1e-7, scale = 0.01;
      const double slope =
          (reference::smooth_l1(d + h, kind, scale) - reference::smooth_l1(d - h, kind, scale)) / (2 * h);
      EXPECT_NEAR(reference::smooth_l1_vjp(d, kind, scale, 1.5), 1.5 * slope, 1e-6) << "d = " << d;
    }
}

TEST(SmoothL1, AtTheKinksOfTheDeadZoneTheDerivativeIsThatOfItsInside) {
  for (const double d : {-0.01, 0.01}) EXPECT_EQ(reference::smooth_l1_vjp(d, SmoothL1::dead_zone, 0.01, 1.0), 0.0);
}

// ---- Vector kernels against the reference.

TEST(SsimLoss, MatchesTheReferenceForAnySize) {
  std::uint64_t seed = 0;
  for (const auto& [width, height] : {std::pair{1, 1},
                                      {1, 40},
                                      {40, 1},
                                      {5, 7},
                                      {10, 11},
                                      {16, 16},
                                      {23, 80},
                                      {127, 9},
                                      {128, 64},
                                      {129, 65},
                                      {150, 70},
                                      {271, 20}}) {
    SCOPED_TRACE(testing::Message() << width << " x " << height);
    const scene::Image rendered = noise(width, height, ++seed), target = disturbed(rendered, 0.3f, ++seed);
    const Reference expected = ssim_reference(rendered, target, SsimTerm::full);
    const LossAndGradient seen = ssim_of(rendered, target);
    EXPECT_NEAR(seen.loss, expected.loss, 1e-6);
    EXPECT_LT(relative_error(seen.v.data, expected.v), 2e-5);
  }
}

TEST(SsimLoss, MatchesTheReferenceUnderAMask) {
  for (const std::uint32_t rarity : {2u, 5u, 50u}) {
    SCOPED_TRACE(rarity);
    const scene::Image rendered = waves(141, 75), target = disturbed(rendered, 0.1f, 8);
    const scene::Mask mask = scattered_mask(141, 75, rarity, 9);
    const Reference expected = ssim_reference(rendered, target, SsimTerm::full, mask);
    const LossAndGradient seen = ssim_of(rendered, target, view(mask));
    EXPECT_NEAR(seen.loss, expected.loss, 1e-6);
    EXPECT_LT(relative_error(seen.v.data, expected.v), 5e-5);
  }
}

TEST(Losses, MatchTheReferenceOnEveryInstructionSetOfThisMachine) {
  const scene::Image rendered = waves(141, 75), target = disturbed(rendered, 0.1f, 8);
  const scene::Mask mask = scattered_mask(141, 75, 3, 9);
  const Reference ssim = ssim_reference(rendered, target, SsimTerm::full, mask);
  const LossAndGradient l1 = l1_of(rendered, target, {}, view(mask));
  for (const std::int64_t instruction_set : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(instruction_set));
    hwy::GetChosenTarget().Update(instruction_set);
    const LossAndGradient seen = ssim_of(rendered, target, view(mask));
    EXPECT_NEAR(seen.loss, ssim.loss, 1e-6);
    EXPECT_LT(relative_error(seen.v.data, ssim.v), 5e-5);
    const LossAndGradient seen_l1 = l1_of(rendered, target, {}, view(mask));
    EXPECT_NEAR(seen_l1.loss, l1.loss, 1e-12);
    EXPECT_EQ(seen_l1.v, l1.v);  // nothing in it rounds differently
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(SsimSums, OfTheContrastTermMatchTheReference) {
  const scene::Image rendered = waves(140, 70), target = disturbed(rendered, 0.1f, 8);
  const Reference expected = ssim_reference(rendered, target, SsimTerm::contrast_structure);
  LossWorkspace workspace;
  scene::Image v(140, 70, 3);
  std::vector<double> sums(3);
  ssim_sums(view(rendered), view(target), {}, SsimTerm::contrast_structure, 1.0f / float(v.data.size()), workspace,
            view(v), sums);
  EXPECT_NEAR(std::accumulate(sums.begin(), sums.end(), 0.0) / double(v.data.size()), expected.loss, 1e-6);
  EXPECT_LT(relative_error(v.data, expected.v), 5e-5);
}

TEST(SsimLoss, KeepsTheDigitsOfATinyDifference) {
  const scene::Image rendered = waves(64, 48), target = disturbed(rendered, 1e-4f, 8);
  const Reference expected = ssim_reference(rendered, target, SsimTerm::full);
  const LossAndGradient seen = ssim_of(rendered, target);
  EXPECT_LT(expected.loss, 1e-4);
  EXPECT_NEAR(seen.loss / expected.loss, 1, 1e-4);
  EXPECT_LT(relative_error(seen.v.data, expected.v), 1e-3);
}

TEST(SmoothL1Loss, MatchesTheFormulaUnderAMask) {
  for (const SmoothL1 kind : {SmoothL1::dead_zone, SmoothL1::charbonnier})
    for (const int width : {1, 15, 64, 67, 200}) {
      SCOPED_TRACE(width);
      const L1Options options{.kind = kind, .scale = 0.02};
      const scene::Image rendered = noise(width, 37, 1), target = disturbed(rendered, 0.05f, 2);
      const scene::Mask mask = scattered_mask(width, 37, 3, 3);
      const LossAndGradient seen = l1_of(rendered, target, options, view(mask));
      double loss = 0;
      const double values = double(rendered.data.size());
      for (std::size_t i = 0; i < rendered.data.size(); ++i) {
        const double d = double(rendered.data[i]) - double(target.data[i]);
        const bool masked = mask.data[i % mask.data.size()] != 0;
        if (!masked) loss += reference::smooth_l1(d, kind, 0.02);
        const double v = masked ? 0 : reference::smooth_l1_vjp(d, kind, 0.02, 1 / values);
        if (std::abs(std::abs(d) - 0.02) > 1e-6) {
          EXPECT_NEAR(seen.v.data[i], v, 1e-5 / values) << "value " << i;
        }
      }
      EXPECT_NEAR(seen.loss, loss / values, 1e-7);
    }
}

// ---- Closed forms.

TEST(SsimLoss, OfConstantPicturesFarFromTheRimIsTheLuminanceTerm) {
  // A picture of 0.2 against one of 0.6, without variance: SSIM = (2 xy + C1) / (x^2 + y^2 + C1).
  const scene::Image x(40, 40, 1, 0.2f), y(40, 40, 1, 0.6f);
  scene::Mask all_but_middle(40, 40);
  std::fill(all_but_middle.data.begin(), all_but_middle.data.end(), std::uint8_t{1});
  all_but_middle.at(20, 20) = 0;
  const double ssim = (2 * 0.2 * 0.6 + 1e-4) / (0.2 * 0.2 + 0.6 * 0.6 + 1e-4);
  const LossAndGradient seen = ssim_of(x, y, view(all_but_middle));
  EXPECT_NEAR(seen.loss * 1600, 1 - ssim, 1e-3);  // the variance of a constant is rounding, against C2 = 9e-4
  EXPECT_FALSE(first_not_finite(seen.v.data));
}

TEST(Losses, OfEqualPicturesAreExactlyZeroAndSoAreTheirGradients) {
  for (const scene::Image& picture : {noise(150, 70, 1), scene::Image(150, 70, 3, 0.7f), scene::Image(1, 1, 3, 1.0f),
                                      noise(30, 30, 2, -100, 100), scene::Image(20, 20, 3, 0.0f)}) {
    // Negative zero in one: not the same bits, so that no short cut is taken where the picture is zero.
    scene::Image same = picture;
    for (float& value : same.data)
      if (value == 0) value = -0.0f;
    for (const scene::Image* other : {&picture, static_cast<const scene::Image*>(&same)}) {
      const LossAndGradient ssim = ssim_of(picture, *other);
      EXPECT_EQ(ssim.loss, 0.0);
      EXPECT_TRUE(std::all_of(ssim.v.data.begin(), ssim.v.data.end(), [](float v) { return v == 0; }));
      for (const SmoothL1 kind : {SmoothL1::dead_zone, SmoothL1::charbonnier}) {
        const LossAndGradient l1 = l1_of(picture, *other, {.kind = kind});
        EXPECT_EQ(l1.loss, 0.0);
        EXPECT_TRUE(std::all_of(l1.v.data.begin(), l1.v.data.end(), [](float v) { return v == 0; }));
      }
    }
  }
}

TEST(SsimLoss, IsZeroAroundPixelsThatAgreeAlsoWhereNoShortCutIsTaken) {
  // One pixel differs: its tile is computed in full, yet beyond its rim everything stays zero.
  const scene::Image target = noise(100, 60, 4);
  scene::Image rendered = target;
  rendered.at(50, 30, 1) += 0.25f;
  const LossAndGradient seen = ssim_of(rendered, target);
  EXPECT_GT(seen.loss, 0);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 100; ++x)
        if (c != 1 || std::abs(x - 50) > ssim_rim || std::abs(y - 30) > ssim_rim) {
          ASSERT_EQ(seen.v.at(x, y, c), 0.0f) << x << ", " << y << ", channel " << c;
        }
}

TEST(SmoothL1Loss, ANegativeWeightTurnsTheGradientAround) {
  const scene::Image rendered = noise(20, 10, 1), target = noise(20, 10, 2);
  for (const SmoothL1 kind : {SmoothL1::dead_zone, SmoothL1::charbonnier}) {
    LossWorkspace workspace;
    scene::Image v(20, 10, 3);
    for (const double weight : {2.5, -2.5})
      smooth_l1_loss(view(rendered), view(target), {}, 200, {.kind = kind}, weight, workspace, view(v));
    EXPECT_EQ(v, scene::Image(20, 10, 3));
  }
}

TEST(SmoothL1Loss, IgnoresLessThanHalfAnEightBitStep) {
  const scene::Image target(8, 8, 3, 0.5f), rendered(8, 8, 3, 0.5f + 0.49f / 255);
  const LossAndGradient seen = l1_of(rendered, target, {});
  EXPECT_EQ(seen.loss, 0.0);
  EXPECT_TRUE(std::all_of(seen.v.data.begin(), seen.v.data.end(), [](float v) { return v == 0; }));
}

TEST(Losses, StayFiniteForExtremePictures) {
  const scene::Image black(33, 21, 3), white(33, 21, 3, 1.0f), bright = noise(33, 21, 1, 0, 1e4f),
                                                               huge = noise(33, 21, 2, -1e9f, 1e9f);
  for (const scene::Image* rendered : {&black, &white, &bright, &huge})
    for (const scene::Image* target : {&black, &white, &bright, &huge}) {
      const LossAndGradient ssim = ssim_of(*rendered, *target);
      EXPECT_TRUE(std::isfinite(ssim.loss));
      EXPECT_GE(ssim.loss, 0);
      EXPECT_LE(ssim.loss, 3);
      EXPECT_FALSE(first_not_finite(ssim.v.data));
      for (const SmoothL1 kind : {SmoothL1::dead_zone, SmoothL1::charbonnier}) {
        const LossAndGradient l1 = l1_of(*rendered, *target, {.kind = kind});
        EXPECT_TRUE(std::isfinite(l1.loss));
        EXPECT_FALSE(first_not_finite(l1.v.data));
      }
    }
}

TEST(Losses, OfNothingAreZero) {
  const scene::Image nothing(0, 0, 3);
  EXPECT_EQ(ssim_of(nothing, nothing).loss, 0.0);
  EXPECT_EQ(l1_of(nothing, nothing, {}).loss, 0.0);
}

// ---- Masks.

TEST(Losses, AreZeroUnderAFullMask) {
  const scene::Image rendered = noise(140, 80, 1), target = noise(140, 80, 2);
  scene::Mask mask(140, 80);
  std::fill(mask.data.begin(), mask.data.end(), std::uint8_t{1});
  EXPECT_EQ(ssim_of(rendered, target, view(mask)).loss, 0.0);
  EXPECT_EQ(l1_of(rendered, target, {}, view(mask)).loss, 0.0);
}

TEST(SsimLoss, MaskedPixelsStillFeelTheWindowsAroundThem) {
  const scene::Image rendered = noise(40, 40, 1), target = noise(40, 40, 2);
  scene::Mask mask(40, 40);
  for (int y = 0; y < 40; ++y)
    for (int x = 20; x < 40; ++x) mask.at(x, y) = 1;
  const LossAndGradient seen = ssim_of(rendered, target, view(mask));
  EXPECT_NE(seen.v.at(24, 10), 0.0f);  // five columns from an unmasked centre
  EXPECT_EQ(seen.v.at(25, 10), 0.0f);
}

// ---- A part of the view.

TEST(Losses, OfTheChangedPartAndItsRimAreThoseOfTheFullView) {
  const scene::Image target = waves(300, 210);
  const scene::Mask mask = scattered_mask(300, 210, 6, 11);
  for (const scene::Rect changed :
       {scene::Rect{100, 90, 160, 130}, scene::Rect{0, 0, 30, 20}, scene::Rect{283, 201, 300, 210},
        scene::Rect{5, 0, 290, 3}, scene::Rect{149, 100, 150, 101}}) {
    SCOPED_TRACE(testing::Message() << changed.x0 << ", " << changed.y0);
    const scene::Image rendered = disturbed(target, changed, 0.2f, 12);
    LossWorkspace workspace;
    scene::Image v_full(300, 210, 3), v_part(300, 210, 3);
    const BackgroundLoss full =
        background_loss(view(rendered), view(target), view(mask), target.pixels(), {}, workspace, view(v_full));
    const scene::Rect rect = with_rim(changed, 300, 210);
    const BackgroundLoss part = background_loss(crop(rendered, rect), crop(target, rect), crop(mask, rect),
                                                target.pixels(), {}, workspace, crop(v_part, rect));
    EXPECT_NEAR(part.ssim / full.ssim, 1, 1e-12);
    EXPECT_NEAR(part.l1 / full.l1, 1, 1e-12);
    for (int c = 0; c < 3; ++c)
      for (int y = changed.y0; y < changed.y1; ++y)
        for (int x = changed.x0; x < changed.x1; ++x)
          ASSERT_EQ(v_part.at(x, y, c), v_full.at(x, y, c)) << x << ", " << y;
  }
}

TEST(WithRim, StaysInsideThePictureAndKeepsAnEmptyRectangleEmpty) {
  EXPECT_EQ(with_rim({5, 40, 20, 60}, 100, 65), (scene::Rect{0, 30, 30, 65}));
  EXPECT_TRUE(with_rim({5, 5, 5, 9}, 100, 100).empty());
}

// ---- The background term.

TEST(BackgroundLoss, IsTheWeightedSumAndAddsToTheGradient) {
  const scene::Image rendered = noise(50, 30, 1), target = noise(50, 30, 2);
  const BackgroundLossOptions options{.l1_weight = 3, .ssim_weight = 0.5, .l1 = {.kind = SmoothL1::charbonnier}};
  LossWorkspace workspace;
  scene::Image v(50, 30, 3, 1.0f);
  const BackgroundLoss loss =
      background_loss(view(rendered), view(target), {}, rendered.pixels(), options, workspace, view(v));
  const LossAndGradient l1 = l1_of(rendered, target, options.l1), ssim = ssim_of(rendered, target);
  EXPECT_EQ(loss.l1, l1.loss);
  EXPECT_EQ(loss.ssim, ssim.loss);
  EXPECT_DOUBLE_EQ(loss.total, 3 * l1.loss + 0.5 * ssim.loss);
  for (std::size_t i = 0; i < v.data.size(); ++i)
    ASSERT_NEAR(v.data[i], 1 + 3 * l1.v.data[i] + 0.5f * ssim.v.data[i], 3e-7) << "value " << i;
}

TEST(BackgroundLoss, HasTheSameBytesForAnyNumberOfThreads) {
  const scene::Image rendered = noise(300, 150, 1), target = noise(300, 150, 2);
  const scene::Mask mask = scattered_mask(300, 150, 3, 3);
  auto compute = [&](int threads) {
    LossAndGradient out{0, scene::Image(300, 150, 3)};
    WorkArena(threads).run([&] {
      LossWorkspace workspace;
      out.loss =
          background_loss(view(rendered), view(target), view(mask), rendered.pixels(), {}, workspace, view(out.v))
              .total;
    });
    return out;
  };
  const LossAndGradient one = compute(1), four = compute(4);
  EXPECT_EQ(one.loss, four.loss);
  EXPECT_EQ(one.v, four.v);
}

TEST(BackgroundLoss, DoesNotGrowItsWorkspaceAgain) {
  const scene::Image rendered = noise(300, 150, 1), target = noise(300, 150, 2);
  LossWorkspace workspace;
  scene::Image v(300, 150, 3);
  background_loss(view(rendered), view(target), {}, rendered.pixels(), {}, workspace, view(v));
  const double* memory = workspace.partial.data();
  background_loss(view(rendered), view(target), {}, rendered.pixels(), {}, workspace, view(v));
  EXPECT_EQ(workspace.partial.data(), memory);
}

TEST(LossOptions, ThatMakeNoSenseAreNamed) {
  EXPECT_TRUE(validate(BackgroundLossOptions{}));
  EXPECT_EQ(validate(BackgroundLossOptions{.l1_weight = -1}).error().where, "l1_weight");
  EXPECT_EQ(validate(BackgroundLossOptions{.ssim_weight = std::nan("")}).error().where, "ssim_weight");
  EXPECT_EQ(validate(BackgroundLossOptions{.l1 = {.scale = 0}}).error().where, "l1.scale");
}

}  // namespace
}  // namespace engine::optim
