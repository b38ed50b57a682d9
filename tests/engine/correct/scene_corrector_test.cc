#include "engine/correct/scene_corrector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/correct/harmonic.h"
#include "tests/engine/correct/samples.h"

namespace engine::correct {
namespace {

constexpr float unlike_any = 9;  // a colour that occurs nowhere else

/// Everything of a picture may be learned from.
Example example_of(scene::Image picture) {
  const scene::Rect box{0, 0, picture.width, picture.height};
  scene::Mask nothing(picture.width, picture.height);
  return {std::move(picture), std::move(nothing), box};
}

/// A picture with a hole: masked, not trusted, and in a colour that must not show.
CorrectionTask with_hole(const scene::Image& truth, const scene::Mask& hole, std::vector<std::size_t> examples = {0}) {
  CorrectionTask task{spoilt(truth, hole, unlike_any), hole, scene::Image(truth.width, truth.height, 1, 1.0f),
                      std::move(examples)};
  task.trust = spoilt(task.trust, hole, 0);
  return task;
}

scene::Image corrected(const std::vector<Example>& buffer, const CorrectionTask& task, double strength = 0.5,
                       std::uint64_t seed = 1) {
  SceneCorrector corrector;
  EXPECT_TRUE(corrector.fine_tune(buffer, 0));
  auto pictures = corrector.correct(std::span(&task, 1), strength, seed);
  if (!pictures || pictures->size() != 1) {
    ADD_FAILURE() << "no picture";
    return {};
  }
  return std::move(pictures->front());
}

bool finite(const scene::Image& image) {
  return std::all_of(image.data.begin(), image.data.end(), [](float value) { return std::isfinite(value); });
}

constexpr int width = 90, height = 76;
const scene::Mask hole = box_mask(width, height, {34, 28, 58, 48});

TEST(SceneCorrector, PutsStripesTogetherFromAnExampleOfThem) {
  const scene::Image truth = stripes(width, height);
  const CorrectionTask task = with_hole(truth, hole);
  const scene::Image made = corrected({example_of(stripes(width, height, 5))}, task);
  scene::Image smooth = task.picture;
  fill_harmonic(smooth, hole);
  EXPECT_GT(psnr_in(made, truth, hole), 30);
  EXPECT_GT(psnr_in(made, truth, hole), psnr_in(smooth, truth, hole) + 10);
}

TEST(SceneCorrector, ChangesNothingButFlaws) {
  CorrectionTask task = with_hole(stripes(width, height), hole);
  for (int y = 30; y < 34; ++y)
    for (int x = 36; x < 50; ++x) task.trust.at(x, y) = trusted;
  task.trust.at(2, 2) = 0;  // outside the mask
  const scene::Image made = corrected({example_of(stripes(width, height, 5))}, task);
  const scene::Mask flaws = pixels_to_correct(task);
  EXPECT_EQ(flaws.area(), hole.area() - 4 * 14);
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < flaws.data.size(); ++i)
      if (flaws.data[i] == 0) {
        ASSERT_EQ(made.plane(c)[i], task.picture.plane(c)[i]) << i;
      }
}

TEST(SceneCorrector, NothingToCorrectGivesBackThePictures) {
  const CorrectionTask unmasked = with_hole(stripes(width, height), scene::Mask(width, height));
  CorrectionTask sure = with_hole(stripes(width, height), hole);
  sure.trust = scene::Image(width, height, 1, 1.0f);
  const std::vector<Example> buffer{example_of(stripes(width, height, 5))};
  EXPECT_EQ(corrected(buffer, unmasked), unmasked.picture);
  EXPECT_EQ(corrected(buffer, sure), sure.picture);
  SceneCorrector corrector;
  const auto none = corrector.correct({}, 0.5, 1);
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->empty());
}

TEST(SceneCorrector, TakesNothingFromWhatIsExcludedHoweverWellItFits) {
  // Flat grey may be taken; the stripes, which fit far better, may not, and have a blue that occurs nowhere else.
  const scene::Image truth = stripes(width, height);
  Example example = example_of(scene::Image(width, height, 3, 0.5f));
  example.excluded = box_mask(width, height, {0, 0, 60, height});
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < example.excluded.data.size(); ++i)
      if (example.excluded.data[i] != 0) example.picture.plane(c)[i] = truth.plane(c)[i] + (c == 2 ? 0.12f : 0.0f);
  Example all_allowed = example;
  all_allowed.excluded = scene::Mask(width, height);
  const auto bluest = [](const scene::Image& image) {
    return *std::max_element(image.plane(2).begin(), image.plane(2).end());
  };
  for (const double strength : {0.0, 0.5, 1.0}) {
    EXPECT_LT(bluest(corrected({example}, with_hole(truth, hole), strength)), bluest(truth) + 0.01f) << strength;
    EXPECT_GT(bluest(corrected({all_allowed}, with_hole(truth, hole), strength)), bluest(truth) + 0.05f)
        << "otherwise this shows nothing";
  }
}

TEST(SceneCorrector, TakesOnlyFromTheExamplesThatThePictureNames) {
  const std::vector<Example> buffer{example_of(scene::Image(width, height, 3, unlike_any)),
                                    example_of(stripes(width, height, 5))};
  const scene::Image truth = stripes(width, height);
  EXPECT_EQ(corrected(buffer, with_hole(truth, hole, {1})), corrected({buffer[1]}, with_hole(truth, hole, {0})));
  // Stripes beyond SceneCorrectorOptions::sources are not looked at.
  const std::vector<Example> grey{example_of(scene::Image(width, height, 3, 0.5f)), buffer[1]};
  const scene::Image of_six = corrected(grey, with_hole(truth, hole, {0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(corrected(grey, with_hole(truth, hole, {0, 0, 0, 0, 0, 0, 1})), of_six);
  EXPECT_NE(corrected(grey, with_hole(truth, hole, {0, 0, 0, 0, 0, 1, 0})), of_six);
}

TEST(SceneCorrector, WithoutExamplesItFillsSmoothly) {
  Example all_excluded = example_of(stripes(width, height, 5));
  all_excluded.excluded = all_set(width, height);
  Example nothing_edited = example_of(stripes(width, height, 5));
  nothing_edited.box = {};
  const scene::Image even(width, height, 3, 0.3f);
  for (const std::vector<Example>& buffer :
       {std::vector<Example>{}, std::vector<Example>{all_excluded}, std::vector<Example>{nothing_edited}}) {
    const std::vector<std::size_t> examples(buffer.size(), 0);
    EXPECT_LT(largest_difference(corrected(buffer, with_hole(even, hole, examples)), even), 1e-5);
    const scene::Image truth = stripes(width, height);
    const scene::Image made = corrected(buffer, with_hole(truth, hole, examples));
    const auto [low, high] = std::minmax_element(truth.data.begin(), truth.data.end());
    for (const float value : made.data) ASSERT_TRUE(value >= *low - 1e-4f && value <= *high + 1e-4f) << value;
  }
}

TEST(SceneCorrector, GivesAFinitePictureWhateverIsMissing) {
  const std::vector<Example> buffer{example_of(stripes(50, 44, 5))};
  const auto expect_finite = [&](const char* what, int w, int h, const scene::Mask& missing) {
    for (const double strength : {0.0, 0.5, 1.0}) {
      const CorrectionTask task = with_hole(stripes(w, h), missing);
      EXPECT_TRUE(finite(corrected(buffer, task, strength))) << what << ", " << strength;
      EXPECT_TRUE(finite(corrected({}, with_hole(stripes(w, h), missing, {}), strength))) << what << ", " << strength;
    }
  };
  expect_finite("a pixel", 60, 50, box_mask(60, 50, {30, 20, 31, 21}));
  expect_finite("a corner", 60, 50, box_mask(60, 50, {0, 0, 9, 9}));
  expect_finite("the rim", 60, 50, box_mask(60, 50, {0, 20, 60, 50}));
  expect_finite("everything", 60, 50, all_set(60, 50));
  expect_finite("a picture smaller than a patch", 5, 4, box_mask(5, 4, {1, 1, 3, 3}));
  expect_finite("all of one", 5, 4, all_set(5, 4));
  expect_finite("a picture of one pixel", 1, 1, all_set(1, 1));
  expect_finite("a picture of one row", 80, 1, box_mask(80, 1, {20, 0, 60, 1}));
}

TEST(SceneCorrector, FillsWhatIsMissingUpToTheRim) {
  const scene::Mask corner = box_mask(width, height, {70, 58, width, height});
  const scene::Image truth = stripes(width, height);
  const scene::Image made = corrected({example_of(stripes(width, height, 5))}, with_hole(truth, corner));
  EXPECT_GT(psnr_in(made, truth, corner), 25);
}

TEST(SceneCorrector, TheMoreStrengthTheLessRemainsOfAHint) {
  const scene::Image truth = stripes(width, height);
  CorrectionTask task = with_hole(truth, hole);
  // The stripes, dimly, under noise: half trusted.
  const scene::Image disturbance = noise(width, height, 8);
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < hole.data.size(); ++i)
      if (hole.data[i] != 0)
        task.picture.plane(c)[i] = 0.5f * (truth.plane(c)[i] + disturbance.plane(c)[i]), task.trust.data[i] = 0.5f;
  const std::vector<Example> buffer{example_of(stripes(width, height, 5))};
  const scene::Image none = corrected(buffer, task, 0), some = corrected(buffer, task, 0.5),
                     all = corrected(buffer, task, 1);
  EXPECT_GT(psnr_in(none, task.picture, hole), 40);
  EXPECT_GT(psnr_in(some, truth, hole), 25);
  EXPECT_GT(psnr_in(all, truth, hole), 25);
  EXPECT_LT(psnr_in(some, task.picture, hole), psnr_in(none, task.picture, hole));
  // What nobody vouches for is no hint.
  CorrectionTask bare = task;
  for (float& trust : bare.trust.data) trust = trust < 1 ? 0.05f : 1;
  EXPECT_GT(psnr_in(corrected(buffer, bare, 0), truth, hole), 25);
}

TEST(SceneCorrector, GivesTheSameBytesForTheSameSeedAndAnyNumberOfThreads) {
  const std::vector<Example> buffer{example_of(noise(60, 50, 1)), example_of(noise(60, 50, 2))};
  const std::vector<CorrectionTask> views{with_hole(noise(60, 50, 3), box_mask(60, 50, {20, 15, 44, 36}), {0, 1}),
                                          with_hole(noise(60, 50, 4), box_mask(60, 50, {5, 5, 20, 30}), {1})};
  const auto run = [&](std::uint64_t seed) {
    SceneCorrector corrector;
    EXPECT_TRUE(corrector.fine_tune(buffer, 0));
    return corrector.correct(views, 0.5, seed).value();
  };
  const auto first = run(1);
  ASSERT_EQ(first.size(), 2u);
  EXPECT_NE(run(2), first);
  for (const int threads : {1, 2, 4}) WorkArena(threads).run([&] { EXPECT_EQ(run(1), first) << threads; });
}

}  // namespace
}  // namespace engine::correct
