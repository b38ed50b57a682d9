#include "engine/captures/capture_trial.h"

#include <gtest/gtest.h>

#include "engine/params/params.h"
#include "tests/support/data.h"

namespace engine::captures {
namespace {

edit::Request with(edit::Request request, params::Preset preset) {
  request.params = params::filled_in({}, preset);
  return request;
}

TEST(CaptureTrial, TheShareOfTheCeilingIsAPartOfTheWay) {
  CaptureTrial trial;
  trial.trial.untouched.edited.psnr_db = 10;
  trial.ceiling.edited.psnr_db = 30;
  trial.deformed.edited.psnr_db = 12;
  const auto share_at = [&](double db) {
    trial.trial.result.edited.psnr_db = db;
    return *trial.share_of_ceiling();
  };
  EXPECT_DOUBLE_EQ(share_at(10), 0);
  EXPECT_DOUBLE_EQ(share_at(25), 0.75);
  EXPECT_DOUBLE_EQ(share_at(30), 1);
  EXPECT_LT(share_at(9), 0);
  EXPECT_DOUBLE_EQ(trial.gain_db(), -3);
  trial.ceiling.edited.psnr_db = 10;
  EXPECT_FALSE(trial.share_of_ceiling()) << "nowhere to go";
}

TEST(CaptureTrial, HarmIsSeenInTheRegionWhereItIs) {
  CaptureTrial trial;
  const auto in = [](evaluate::Quality& quality, double edited, double vacated, double outside) {
    const auto of = [](double db) { return evaluate::RegionQuality{.psnr_db = db, .pixels = 10}; };
    quality.edited = of(edited), quality.vacated = of(vacated), quality.outside = of(outside);
  };
  in(trial.deformed, 20, 18, 33);
  in(trial.trial.result, 21, 22, 32.5);
  in(trial.ceiling, 30, 26, 35);
  EXPECT_DOUBLE_EQ(trial.least_gain_db(), -0.5) << "outside; nothing has arrived anywhere, which is no region";
  EXPECT_DOUBLE_EQ(trial.vacated_gain_db().value(), 4);
  EXPECT_DOUBLE_EQ(trial.vacated_share().value(), 0.5);
  trial.trial.result.edited.psnr_db = 19;
  EXPECT_DOUBLE_EQ(trial.least_gain_db(), -1);
  trial.ceiling.vacated.psnr_db = 18;
  EXPECT_FALSE(trial.vacated_share()) << "nothing to gain";
  trial.deformed.vacated.pixels = 0;
  EXPECT_FALSE(trial.vacated_gain_db());
}

TEST(CaptureTrial, ATinyOneFromPhotosToFigures) {
  const support::TempDir folder;
  const CapturedCase the_case = make_captured_case("mug").value();
  fit::FitOptions options = training_options(150);
  options.max_gaussians = 6000;
  const auto trained = train(the_case, options, folder.path());
  ASSERT_TRUE(trained) << trained.error().message;
  const auto ready = make_ready(the_case, *trained, grasp_by_balls);
  ASSERT_TRUE(ready) << ready.error().message;
  EXPECT_NE(ready->key_before, ready->key_after);
  EXPECT_GT(ready->match.recall, 0.5);
  EXPECT_GT(ready->match.precision, 0.5);
  EXPECT_FALSE(ready->judged.part_before.empty());
  const auto again = train(the_case, options, folder.path());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->before.cloud, ready->judged.before);
  EXPECT_EQ(again->before.seconds + again->after.seconds, ready->fit_seconds) << "nothing was trained again";

  edit::Request draft = with(ready->judged.request, params::Preset::draft);
  draft.params.iterations = 20, draft.params.views = 6, draft.params.max_image_side = 160;
  const auto done = carry_out(*ready, draft, with(ready->judged.request, params::Preset::preview), "scene");
  ASSERT_TRUE(done) << done.error().message;
  const CaptureTrial& trial = done->trial;
  EXPECT_EQ(trial.trial.name, "mug");
  EXPECT_GT(trial.deformed.edited.psnr_db, trial.trial.untouched.edited.psnr_db + 3);
  EXPECT_GT(trial.ceiling.edited.psnr_db, trial.deformed.edited.psnr_db);
  EXPECT_GT(trial.trial.result.edited.psnr_db, trial.trial.untouched.edited.psnr_db + 3);
  EXPECT_GT(trial.share_of_ceiling().value(), 0.2);
  EXPECT_LT(trial.share_of_ceiling().value(), 1);
  EXPECT_GT(trial.ceiling_beyond_db, trial.untouched_beyond_db);
  EXPECT_GT(trial.trial.result.outside.psnr_db, 20);
  EXPECT_NE(capture_table_row(trial).find("| mug | choose | balls | scene |"), std::string::npos);
}

TEST(CaptureTrial, HandsTheErrorOfASelectionOn) {
  const support::TempDir folder;
  const CapturedCase the_case = make_captured_case("mug").value();
  const auto refuse = [](const CapturedCase&, const scene::GaussianCloud&) -> Result<Grasp> {
    return fail(ErrorCode::unprocessable, "nothing is selected", "selection[2].sphere.radius");
  };
  const auto trained = train(the_case, training_options(2), folder.path());
  ASSERT_TRUE(trained) << trained.error().message;
  const auto ready = make_ready(the_case, *trained, refuse);
  ASSERT_FALSE(ready);
  EXPECT_EQ(ready.error().where, "selection[2].sphere.radius");
}

}  // namespace
}  // namespace engine::captures
