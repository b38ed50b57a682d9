#include "engine/evaluate/measure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "engine/render/forward.h"

namespace engine::evaluate {
namespace {

const Case& speck() {
  static const Case made = make_case("speck").value();
  return made;
}

const JudgedViews& views() {
  static const JudgedViews made(speck());
  return made;
}

TEST(JudgedViews, OfACaseThatHasItsOwnAreThose) {
  Case the_case;
  the_case.held_out.resize(2);
  the_case.judged.resize(2);
  const JudgedViews own(the_case);
  EXPECT_EQ(own.all().data(), the_case.judged.data()) << "not copied";
  ASSERT_EQ(views().all().size(), speck().held_out.size());
  EXPECT_EQ(views().all()[0].truth.data, picture(speck().truth, speck().held_out[0]).data);
}

TEST(Judge, TheTruthIsPerfect) {
  const Quality quality = judge(views(), speck().truth);
  for (const RegionQuality& likeness : {quality.edited, quality.vacated, quality.arrived, quality.outside}) {
    EXPECT_GT(likeness.pixels, 100u);
    EXPECT_EQ(likeness.psnr_db, 100);
    EXPECT_NEAR(likeness.ssim, 1, 1e-9);
  }
  EXPECT_EQ(quality.miss, 0);
}

/// Stripes of so many pixels, of which the first are so far from the left.
scene::Image stripes(int width, int shift, float low = 0.2f, float high = 0.8f) {
  scene::Image picture(48, 32, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x) picture.at(x, y, c) = (x + shift) / width % 2 == 0 ? low : high;
  return picture;
}

/// Of the whole picture.
RegionQuality quality_of(const scene::Image& result, const scene::Image& truth) {
  RegionQualitySum sum;
  sum.add(result, truth, complement(scene::Mask(truth.width, truth.height)));
  return sum.quality();
}

TEST(RegionQuality, DetailIsLessInASmearAndNotWherePhasesAreOff) {
  const scene::Image truth = stripes(4, 0);
  EXPECT_EQ(quality_of(truth, truth).detail, 1);
  const RegionQuality shifted = quality_of(stripes(4, 4), truth),
                      smeared = quality_of(stripes(4, 0, 0.5f, 0.5f), truth);
  EXPECT_GT(smeared.psnr_db, shifted.psnr_db + 5) << "dB are best for a smear";
  EXPECT_NEAR(shifted.detail.value(), 1, 0.05);
  EXPECT_NEAR(smeared.detail.value(), 0, 1e-6);
  EXPECT_NEAR(quality_of(stripes(4, 0, 0.35f, 0.65f), truth).detail.value(), 0.5, 1e-4);
  EXPECT_GT(quality_of(truth, stripes(4, 0, 0.35f, 0.65f)).detail.value(), 1.9) << "rough";
}

TEST(RegionQuality, DetailOfOneColorIsUnknown) {
  const scene::Image truth = stripes(4, 0, 0.3f, 0.3f);
  EXPECT_EQ(quality_of(stripes(4, 0), truth).detail, std::nullopt);
  EXPECT_EQ(RegionQualitySum().quality().detail, std::nullopt);
}

TEST(Judge, DoingNothingIsRightOutsideAndWrongInside) {
  const Quality quality = judge(views(), speck().before);
  EXPECT_GT(quality.outside.psnr_db, 45);
  EXPECT_LT(quality.edited.psnr_db, 25);
  EXPECT_LT(quality.arrived.psnr_db, 20);
  EXPECT_GT(quality.miss, 0.02) << "though parts of the table are near to where the apple should be";
}

TEST(Judge, PixelsOfAKindAreThoseOfItsName) {
  const scene::Camera& camera = speck().held_out.front();
  const JudgedRegions kinds = judged_regions(speck(), camera);
  for (std::size_t i = 0; i < kinds.edited.data.size(); ++i) {
    EXPECT_FALSE(kinds.vacated.data[i] && kinds.arrived.data[i]);
    EXPECT_TRUE(kinds.edited.data[i] || !(kinds.vacated.data[i] || kinds.arrived.data[i]));
  }
}

/// The sum of absolute differences.
class Difference final : public optim::PerceptualLoss {
 public:
  Result<double> evaluate(const scene::Image& rendered, const scene::Image& target, scene::Image&) override {
    if (error) return tl::make_unexpected(*error);
    double sum = 0;
    for (std::size_t i = 0; i < target.data.size(); ++i) sum += std::abs(double(rendered.data[i]) - target.data[i]);
    pixels += target.pixels();
    ++pictures;
    return sum;
  }
  std::optional<Error> error;
  std::size_t pixels = 0, pictures = 0;
};

TEST(PerceptualDistance, LooksAtTheEditedRegionAlone) {
  Difference loss;
  EXPECT_EQ(perceptual_distance(views().all(), speck().truth, loss).value(), 0);
  EXPECT_EQ(loss.pictures, speck().held_out.size());
  EXPECT_LT(loss.pixels, loss.pictures * speck().held_out[0].width * speck().held_out[0].height / 2) << "a box of each";
  EXPECT_GT(perceptual_distance(views().all(), speck().before, loss).value(), 10);
  loss.error = Error{ErrorCode::internal, "out of order", "loss"};
  EXPECT_EQ(perceptual_distance(views().all(), speck().truth, loss).error().where, "loss");
}

/// Every view's picture of the truth.
std::vector<scene::Image> true_pictures() {
  std::vector<scene::Image> pictures;
  for (const scene::Camera& camera : speck().cameras) pictures.push_back(picture(speck().truth, camera));
  return pictures;
}

TEST(Agreement, PicturesOfOneSceneAgree) {
  const Agreement found = agreement(speck(), speck().cameras, true_pictures());
  EXPECT_GT(found.pixels, 500u);
  EXPECT_GT(found.psnr_db, 35) << "but for what lies between pixels";
}

TEST(Agreement, AViewThatShowsSomethingElseIsNoticed) {
  auto pictures = true_pictures();
  for (std::size_t v = 0; v < pictures.size(); v += 2)
    for (float& value : pictures[v].data) value += 0.1f;
  const Agreement found = agreement(speck(), speck().cameras, pictures);
  EXPECT_LT(found.psnr_db, 24);
  EXPECT_GT(found.psnr_db, 19) << "0.1 everywhere is 20 dB; some nearest views are alike";
}

TEST(Agreement, OneViewAgreesWithNobody) {
  const auto pictures = true_pictures();
  EXPECT_EQ(agreement(speck(), std::span(speck().cameras).first(1), std::span(pictures).first(1)).pixels, 0u);
  EXPECT_EQ(agreement(speck(), {}, {}).pixels, 0u);
}

TEST(Comparison, ShowsFivePanels) {
  const scene::Camera& camera = speck().held_out.front();
  const scene::Image picture = comparison(speck(), speck().before, speck().truth, camera);
  EXPECT_EQ(picture.width, 5 * camera.width);
  EXPECT_EQ(picture.height, camera.height);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(picture.at(2 * camera.width + 7, 9, c), picture.at(3 * camera.width + 7, 9, c)) << "result is the truth";
    EXPECT_EQ(picture.at(4 * camera.width + 7, 9, c), 0.0f);
  }
}

}  // namespace
}  // namespace engine::evaluate
