#include "engine/evaluate/trial.h"

#include <gtest/gtest.h>

#include "engine/evaluate/trip_trial.h"
#include "tests/engine/edit/student.h"

namespace engine::evaluate {
namespace {

const Case& speck() {
  static const Case made = make_case("speck").value();
  return made;
}

edit::Request quick_request(int iterations) {
  edit::Request request = speck().request;
  request.params.intervals = 2, request.params.views = 6, request.params.max_image_side = 120;
  request.params.interpolation = edit::Interpolation::rigid;
  request.params.iterations = iterations;
  return request;
}

/// Names and widths of what is shown.
struct Shown {
  std::vector<std::string> names;
  std::vector<int> widths;
  Show show = [this](const std::string& name, const scene::Image& picture) -> Result<void> {
    names.push_back(name);
    widths.push_back(picture.width);
    return {};
  };
};

TEST(Trial, SaysWhatAnEditCameTo) {
  const auto done = carry_out(speck(), quick_request(10), "scene");
  ASSERT_TRUE(done) << done.error().message;
  const Trial& trial = done->trial;
  EXPECT_EQ(trial.name, "speck");
  EXPECT_EQ(trial.corrector, "scene");
  EXPECT_EQ(trial.intervals, 2);
  EXPECT_EQ(trial.gaussians, speck().before.size());
  EXPECT_EQ(trial.part, speck().part_before.size());
  EXPECT_GT(trial.result.edited.psnr_db, trial.untouched.edited.psnr_db + 5);
  EXPECT_EQ(trial.result.edited.psnr_db, judge(JudgedViews(speck()), done->edited).edited.psnr_db);
  EXPECT_GT(trial.corrected_views.pixels, 0u);
  double sum = 0;
  for (const edit::StageTime& stage : trial.stages) sum += stage.seconds;
  EXPECT_DOUBLE_EQ(trial.seconds, sum);
  EXPECT_GT(trial.seconds, 0);
}

TEST(Trial, HasNoAgreementWithoutACorrection) {
  const auto done = carry_out(speck(), quick_request(0), "none");
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_EQ(done->trial.corrected_views.pixels, 0u);
  EXPECT_EQ(done->trial.seeds, 0u);
}

TEST(Trial, ARepainterRepaintsWhatTheSceneCorrectorHasCompleted) {
  edit::Student student;
  const auto done = carry_out(speck(), quick_request(3), "sd", nullptr, &student);
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_EQ(done->trial.corrector, "sd");
  EXPECT_FALSE(student.asked.empty());
  EXPECT_GT(done->trial.seeds, 0u) << "nothing was completed before";
}

TEST(Trial, HandsTheErrorOfAnEditOn) {
  edit::Request request = quick_request(0);
  request.handles[0].radius = -1;
  const auto done = carry_out(speck(), request, "none");
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().where, "handles[0].radius");
}

TEST(ShowPictures, ShowsAsManyHeldOutViewsAsThereAre) {
  const auto show = [&](std::size_t count) {
    Shown shown;
    EXPECT_TRUE(show_pictures(speck(), quick_request(0), "none", speck().truth, count, shown.show));
    return shown;
  };
  EXPECT_TRUE(show(0).names.empty());
  const Shown one = show(1);
  ASSERT_EQ(one.names.size(), 1u);
  EXPECT_EQ(one.names[0], "speck_none_" + speck().held_out[0].name);
  EXPECT_EQ(one.widths[0], 5 * speck().held_out[0].width);
  EXPECT_EQ(show(1000).names.size(), speck().held_out.size());
}

TEST(ShowPictures, EndsAtThePictureThatCannotBeShown) {
  int shown = 0;
  const auto full = [&](const std::string&, const scene::Image&) -> Result<void> {
    ++shown;
    return fail(ErrorCode::no_space, "the disk is full");
  };
  const auto done = show_pictures(speck(), quick_request(0), "none", speck().truth, 2, full);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::no_space);
  EXPECT_EQ(shown, 1);
}

TEST(TripTrial, SaysHowNearASceneComesBack) {
  Shown shown;
  const auto trial = carry_out_trip(speck().before, speck().cameras, quick_request(0), "none", 1, shown.show);
  ASSERT_TRUE(trial) << trial.error().message;
  EXPECT_EQ(trial->corrector, "none");
  EXPECT_GT(trial->arrived, 0.9);
  EXPECT_GT(trial->inside.psnr_db, 50);
  EXPECT_GT(trial->zero_drag.psnr_db, 50);
  EXPECT_GE(trial->cameras, 3u);
  ASSERT_EQ(shown.names, (std::vector<std::string>{"trip_none_0"}));
  EXPECT_EQ(shown.widths[0] % 3, 0);
}

}  // namespace
}  // namespace engine::evaluate
