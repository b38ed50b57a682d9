#include "engine/evaluate/harmonic_corrector.h"

#include <gtest/gtest.h>

namespace engine::evaluate {
namespace {

/// A slope in a picture; part of it is masked, and part of that is not trusted and shows something else.
correct::CorrectionTask flawed_slope() {
  correct::CorrectionTask flawed{scene::Image(20, 16, 3), scene::Mask(20, 16), scene::Image(20, 16, 1, 1.0f), {}};
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 20; ++x) flawed.picture.at(x, y, c) = 0.02f * float(x + c * y);
  for (int y = 3; y < 13; ++y)
    for (int x = 4; x < 16; ++x) flawed.mask.at(x, y) = 1;
  for (int y = 5; y < 10; ++y)
    for (int x = 0; x < 13; ++x) flawed.trust.at(x, y) = 0.5f;
  return flawed;
}

TEST(HarmonicCorrector, FillsFlawsFromWhatIsAroundThem) {
  const correct::CorrectionTask truth = flawed_slope();
  correct::CorrectionTask flawed = truth;
  const scene::Mask flaws = correct::pixels_to_correct(flawed);
  EXPECT_EQ(flaws.area(), 5u * 9u) << "masked and not trusted";
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < flaws.data.size(); ++i)
      if (flaws.data[i] != 0) flawed.picture.plane(c)[i] = 5;
  HarmonicCorrector corrector;
  ASSERT_TRUE(corrector.fine_tune({}, 0));
  const std::vector<correct::CorrectionTask> views{flawed, truth};
  const auto corrected = corrector.correct(views, 1, 0);
  ASSERT_TRUE(corrected);
  ASSERT_EQ(corrected->size(), 2u);
  for (const scene::Image& picture : *corrected)
    for (int c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < flaws.data.size(); ++i) {
        ASSERT_NEAR(picture.plane(c)[i], truth.picture.plane(c)[i], 1e-4) << i;
        if (flaws.data[i] == 0) {
          ASSERT_EQ(picture.plane(c)[i], truth.picture.plane(c)[i]) << i;
        }
      }
}

TEST(HarmonicCorrector, LeavesAPictureWithoutFlawsAsItIs) {
  correct::CorrectionTask flawed = flawed_slope();
  flawed.mask = scene::Mask(20, 16);
  HarmonicCorrector corrector;
  EXPECT_EQ(corrector.correct(std::span(&flawed, 1), 1, 0)->front(), flawed.picture);
}

}  // namespace
}  // namespace engine::evaluate
