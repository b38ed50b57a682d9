#include "engine/evaluate/measure.h"

#include <gtest/gtest.h>

#include "engine/render/forward.h"

namespace engine::evaluate {
namespace {

const Case& speck() {
  static const Case made = make_case("speck").value();
  return made;
}

TEST(Judge, TheTruthIsPerfect) {
  const Quality quality = judge(speck(), speck().truth);
  for (const Likeness& likeness : {quality.edited, quality.vacated, quality.arrived, quality.outside}) {
    EXPECT_GT(likeness.pixels, 100u);
    EXPECT_EQ(likeness.psnr_db, 100);
    EXPECT_NEAR(likeness.ssim, 1, 1e-9);
  }
  EXPECT_EQ(quality.miss, 0);
}

TEST(Judge, DoingNothingIsRightOutsideAndWrongInside) {
  const Quality quality = judge(speck(), speck().before);
  EXPECT_GT(quality.outside.psnr_db, 45);
  EXPECT_LT(quality.edited.psnr_db, 25);
  EXPECT_LT(quality.arrived.psnr_db, 20);
  EXPECT_GT(quality.miss, 0.02) << "though parts of the table are near to where the apple should be";
}

TEST(Judge, PixelsOfAKindAreThoseOfItsName) {
  const scene::Camera& camera = speck().held_out.front();
  const Kinds kinds = kinds_of(speck(), camera);
  for (std::size_t i = 0; i < kinds.edited.data.size(); ++i) {
    EXPECT_FALSE(kinds.vacated.data[i] && kinds.arrived.data[i]);
    EXPECT_TRUE(kinds.edited.data[i] || !(kinds.vacated.data[i] || kinds.arrived.data[i]));
  }
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
