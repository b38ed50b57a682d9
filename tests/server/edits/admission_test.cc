#include "server/edits/admission.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace server::edits {
namespace {

using engine::ErrorCode;
using engine::params::Params;

constexpr std::uint64_t gib = std::uint64_t{1} << 30;

/// A scene of 150,000 Gaussians without a dataset.
struct Edit {
  Edit(int views, int side) {
    params.views = views, params.max_image_side = side;
    work.row_bytes = 152, work.copies = 6000;
    work.edit.gaussians = 150'000, work.edit.dragged = 6000;
    work.edit.intervals = 1, work.edit.iterations = 200, work.edit.corrected = true;
    work.edit.views = std::size_t(views), work.edit.view_pixels = view_pixels_at(side, {});
  }
  [[nodiscard]] engine::Result<void> admitted(std::uint64_t limit) const { return admit(work, params, {}, limit); }
  Params params;
  JobWorkload work;
};

/// The number behind "at most " that follows the name of a parameter.
int advised(const std::string& message, const std::string& parameter) {
  const std::string before = "lower " + parameter + " to at most ";
  const std::size_t at = message.find(before);
  return at == std::string::npos ? 0 : std::stoi(message.substr(at + before.size()));
}

TEST(Admission, TakesWhatFits) {
  const Edit usual(50, 512);
  EXPECT_TRUE(usual.admitted(2 * gib));
  EXPECT_TRUE(usual.admitted(estimated_bytes(usual.work)));
  EXPECT_FALSE(usual.admitted(estimated_bytes(usual.work) - 1));
  EXPECT_TRUE(Edit(1000, 8192).admitted(0)) << "no limit";
}

TEST(Admission, NamesWhatIsFurthestBeyondTheUsual) {
  const auto pixels = Edit(50, 8192).admitted(4 * gib);
  ASSERT_FALSE(pixels);
  EXPECT_EQ(pixels.error().code, ErrorCode::too_large);
  EXPECT_EQ(pixels.error().where, "params.max_image_side");
  EXPECT_NE(pixels.error().message.find("--edit-memory) is 4.0 GiB: "), std::string::npos) << pixels.error().message;
  const auto views = Edit(1000, 512).admitted(4 * gib);
  ASSERT_FALSE(views);
  EXPECT_EQ(views.error().where, "params.views");
  EXPECT_EQ(Edit(1000, 8192).admitted(4 * gib).error().where, "params.max_image_side");
}

TEST(Admission, AdvisesTheMostThatFits) {
  for (const auto& [views, side, limit] : {std::tuple{1000, 512, 4 * gib}, std::tuple{50, 4096, 2 * gib},
                                           std::tuple{400, 2048, gib}, std::tuple{1000, 8192, 16 * gib}}) {
    SCOPED_TRACE(testing::Message() << views << " views of " << side << " pixels, " << limit << " bytes");
    const auto refused = Edit(views, side).admitted(limit);
    ASSERT_FALSE(refused);
    const int fewer = advised(refused.error().message, "params.views");
    const int smaller = advised(refused.error().message, "params.max_image_side");
    EXPECT_TRUE(fewer > 0 || smaller > 0);
    if (fewer > 0) {
      EXPECT_TRUE(Edit(fewer, side).admitted(limit));
      EXPECT_FALSE(Edit(fewer + 1, side).admitted(limit));
    }
    if (smaller > 0) {
      EXPECT_TRUE(Edit(views, smaller).admitted(limit));
      EXPECT_FALSE(Edit(views, smaller + 1).admitted(limit));
    }
  }
}

TEST(Admission, LooksAtWhatTheCamerasOfADatasetHave) {
  engine::scene::Camera camera;
  camera.width = 640, camera.height = 480;
  const std::vector<engine::scene::Camera> dataset(1000, camera);
  Edit edit(1000, 8192);
  edit.work.edit.view_pixels = view_pixels_at(8192, dataset);
  EXPECT_EQ(edit.work.edit.view_pixels, 640u * 480u) << "they are never enlarged";
  EXPECT_TRUE(admit(edit.work, edit.params, dataset, 25 * gib));
  const auto refused = admit(edit.work, edit.params, dataset, 8 * gib);
  ASSERT_FALSE(refused);
  const int smaller = advised(refused.error().message, "params.max_image_side");
  EXPECT_LT(smaller, 640) << "a side beyond that of the cameras changes nothing: " << refused.error().message;
  EXPECT_GT(smaller, 16);
}

TEST(Admission, SaysSoWhereOneParameterAloneIsNotEnough) {
  const auto both = Edit(1000, 16384).admitted(gib / 4);
  ASSERT_FALSE(both);
  EXPECT_EQ(both.error().where, "params.max_image_side");
  EXPECT_NE(both.error().message.find("params.views and params.max_image_side"), std::string::npos);
  const auto none = Edit(1, 16).admitted(1 << 20);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().where, "scene");
  EXPECT_NE(none.error().message.find("--edit-memory) is 1 MiB: "), std::string::npos) << none.error().message;
}

/// The same with what its time depends on; a frame takes ten milliseconds.
Edit timed(int views, int side, int iterations, int intervals = 1) {
  Edit edit(views, side);
  edit.work.edit.iterations = iterations, edit.work.edit.intervals = intervals;
  edit.work.edit.candidates = 50, edit.work.edit.covered = 0.2;
  edit.work.edit.frame = {5e-3, 2e-8};
  return edit;
}

TEST(AdmissionByTime, TakesWhatIsOverInTime) {
  const Edit usual = timed(50, 512, 500);
  const double needed = estimated_seconds(usual.work);
  EXPECT_TRUE(admit_time(usual.work, usual.params, {}, needed));
  EXPECT_FALSE(admit_time(usual.work, usual.params, {}, 0.99 * needed));
  const Edit endless = timed(1000, 8192, 1'000'000, 100);
  EXPECT_TRUE(admit_time(endless.work, endless.params, {}, 0)) << "no limit";
}

TEST(AdmissionByTime, NamesWhatIsFurthestBeyondTheUsualAndHowFarToLowerIt) {
  struct Case {
    Edit edit;
    std::string parameter;
    std::function<Edit(int)> with;
  };
  const std::vector<Case> cases = {
      {timed(50, 512, 1'000'000), "params.iterations", [](int n) { return timed(50, 512, n); }},
      {timed(50, 512, 500, 1000), "params.intervals", [](int n) { return timed(50, 512, 500, n); }},
      {timed(1000, 512, 500), "params.views", [](int n) { return timed(n, 512, 500); }},
      {timed(50, 8192, 500), "params.max_image_side", [](int n) { return timed(50, n, 500); }}};
  for (const Case& each : cases) {
    SCOPED_TRACE(each.parameter);
    const double limit = estimated_seconds(each.edit.work) / 4;
    const auto refused = admit_time(each.edit.work, each.edit.params, {}, limit);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::too_large);
    EXPECT_EQ(refused.error().where, each.parameter) << refused.error().message;
    EXPECT_NE(refused.error().message.find("--edit-time"), std::string::npos) << refused.error().message;
    const int most = advised(refused.error().message, each.parameter);
    ASSERT_GT(most, 0) << refused.error().message;
    const Edit fits = each.with(most), does_not = each.with(most + 1);
    EXPECT_TRUE(admit_time(fits.work, fits.params, {}, limit));
    EXPECT_FALSE(admit_time(does_not.work, does_not.params, {}, limit));
  }
}

TEST(AdmissionByTime, SaysSoWhereOneParameterAloneIsNotEnough) {
  const Edit edit = timed(1000, 8192, 1'000'000, 100);
  const auto several = admit_time(edit.work, edit.params, {}, 60);
  ASSERT_FALSE(several);
  EXPECT_EQ(several.error().where, "params.iterations");
  EXPECT_NE(several.error().message.find("params.iterations and params."), std::string::npos);
  EXPECT_NE(several.error().message.find(" days; the limit (--edit-time) is 60 s: "), std::string::npos)
      << several.error().message;
  const auto none = admit_time(edit.work, edit.params, {}, 1e-3);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().where, "scene");
}

TEST(Admission, ADiffusionModelThatWorksForHoursHasToBeAllowed) {
  Edit edit(50, 512);
  edit.work.edit.first_tuning = 200;
  EXPECT_TRUE(admit_slow(edit.work, false)) << "there is none";
  add_models(edit.work, {models::RepainterCost{0.1, 0.1, 1, gib}, {}});
  EXPECT_TRUE(admit_slow(edit.work, false)) << "of a small one: " << estimated_seconds(edit.work) << " s";
  add_models(edit.work, {models::RepainterCost{85, 24, 336, gib}, {}});  // of 1.5 on one thread
  const auto refused = admit_slow(edit.work, false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(refused.error().where, "allow_slow");
  EXPECT_TRUE(refused.error().message.starts_with("the edit, with the diffusion model, would take about 7 hours"))
      << refused.error().message;
  EXPECT_TRUE(admit_slow(edit.work, true));
  Edit by_lpips(50, 512);
  add_models(by_lpips.work, {{}, models::PerceptualCost{1e-3, gib, 4000}});
  const auto slow = admit_slow(by_lpips.work, false);
  ASSERT_FALSE(slow);
  EXPECT_TRUE(slow.error().message.starts_with("the edit, with the network of the perceptual loss, would take about "))
      << slow.error().message;
  EXPECT_EQ(slow.error().where, "allow_slow");
  EXPECT_NE(slow.error().message.find("set params.perceptual to \"msssim\""), std::string::npos)
      << slow.error().message;
}

TEST(Admission, CountsTheMemoryOfADiffusionModelAndOfTheHistory) {
  Edit edit(50, 512);
  const std::uint64_t without = estimated_bytes(edit.work);
  add_models(edit.work, {});
  EXPECT_EQ(estimated_bytes(edit.work), without);
  add_models(edit.work, {models::RepainterCost{1, 1, 1, 4 * gib, gib, 2 * gib}, {}});
  const std::uint64_t of_one_interval = estimated_bytes(edit.work);
  EXPECT_GT(of_one_interval, without + 5 * gib);
  EXPECT_LT(of_one_interval, without + 6 * gib) << "it learns nothing";
  edit.work.edit.later_tuning = 1;
  EXPECT_EQ(estimated_bytes(edit.work), of_one_interval + gib) << "it paints and learns one after the other";
  edit.work.edit.later_tuning = 0;
  edit.work.edit.intervals = 2;
  EXPECT_GE(estimated_bytes(edit.work), of_one_interval + 50 * 6 * 512 * 512);
}

TEST(Admission, CountsTheMemoryOfLpipsAtTheSizeOfItsPictures) {
  Edit edit(50, 512), painted(50, 512);
  const std::uint64_t without = estimated_bytes(edit.work);
  const models::PerceptualCost lpips{1e-5, gib, 4096};
  add_models(edit.work, {{}, lpips});
  EXPECT_EQ(estimated_bytes(edit.work), without + gib + 4096 * 512 * 512);
  const models::RepainterCost sd{1, 1, 1, 0, 3 * gib, 0};
  add_models(edit.work, {sd, lpips});
  add_models(painted.work, {sd, {}});
  EXPECT_EQ(estimated_bytes(edit.work), estimated_bytes(painted.work) + gib) << "not both at a time";
}

/// An edit with networks of `bytes`; `more` are taken to learn, and are LPIPS's.
Edit with_networks(std::uint64_t bytes, std::uint64_t more) {
  Edit edit(50, 512);
  edit.work.edit.first_tuning = 200, edit.work.edit.later_tuning = 50;
  add_models(edit.work, {models::RepainterCost{10, 10, 100, bytes, 0, more}, models::PerceptualCost{1e-5, more, 0}});
  return edit;
}

TEST(Admission, NamesTheNetworkThatAnEditCanDoWithout) {
  const std::uint64_t rest = estimated_bytes(with_networks(0, 0).work);
  struct Case {
    std::uint64_t limit;
    std::string where, advice;
  };
  for (const Case& each : {Case{rest + 7 * gib, "params.perceptual", "set params.perceptual to \"msssim\""},
                           Case{rest + 4 * gib, "params.perceptual",
                                ": set params.perceptual to \"msssim\" and set params.tuning_steps and "
                                "params.tuning_steps_later to 0"},
                           Case{rest + 3 * gib, "params.corrector", ": set params.corrector to \"scene\""},
                           Case{rest / 2, "params.perceptual", ", and lower params.views and params.max_image_side"}}) {
    const Edit edit = with_networks(4 * gib, 3 * gib);
    const auto refused = admit(edit.work, edit.params, {}, each.limit);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().where, each.where) << refused.error().message;
    EXPECT_NE(refused.error().message.find(each.advice), std::string::npos) << refused.error().message;
  }
  Edit learning(50, 512);
  learning.work.edit.first_tuning = 200;
  add_models(learning.work, {models::RepainterCost{10, 10, 100, gib, gib, 9 * gib}, {}});
  const auto refused = admit(learning.work, learning.params, {}, rest + 3 * gib);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "params.tuning_steps") << refused.error().message;
}

TEST(Admission, NamesTheChoicesThatOnlyTogetherAreEnough) {
  Edit edit(50, 512);
  edit.work.edit.first_tuning = 200;
  add_models(edit.work, {models::RepainterCost{10, 10, 100, 0, 0, 8 * gib},
                         models::PerceptualCost{1e-5, 0, 8 * gib / edit.work.edit.view_pixels}});
  const std::uint64_t limit = estimated_bytes(edit.work) - 7 * gib;  // it learns and compares one after the other
  const auto refused = edit.admitted(limit);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "params.perceptual");
  EXPECT_TRUE(refused.error().message.ends_with(
      ": set params.perceptual to \"msssim\" and set params.tuning_steps and params.tuning_steps_later to 0"))
      << refused.error().message;
  add_models(edit.work, {edit.work.models.repainter, {}});
  EXPECT_FALSE(edit.admitted(limit));
  edit.work.edit.first_tuning = 0;
  EXPECT_TRUE(edit.admitted(limit));
}

TEST(AdmissionByTime, NamesWhatADiffusionModelTakesLongFor) {
  Edit edit = timed(50, 512, 100);
  edit.params = engine::params::filled_in({}, engine::params::Preset::standard);
  edit.work.edit.first_tuning = 10'000, edit.work.edit.later_tuning = 50;
  add_models(edit.work, {models::RepainterCost{10, 1, 10, gib, 0, 0}, {}});
  const double limit = estimated_seconds(edit.work) / 2;
  const auto learns = admit_time(edit.work, edit.params, {}, limit);
  ASSERT_FALSE(learns);
  EXPECT_EQ(learns.error().where, "params.tuning_steps") << learns.error().message;
  EXPECT_NE(learns.error().message.find("set params.corrector to \"scene\""), std::string::npos)
      << learns.error().message;
  edit.work.edit.first_tuning = advised(learns.error().message, "params.tuning_steps");
  EXPECT_TRUE(admit_time(edit.work, edit.params, {}, limit));
  ++edit.work.edit.first_tuning;
  EXPECT_FALSE(admit_time(edit.work, edit.params, {}, limit));

  Edit painting = timed(50, 512, 100);
  painting.params = edit.params;
  painting.params.sampling_steps = 500;
  const auto with_steps = [&](int steps) {
    add_models(painting.work, {models::RepainterCost{0.1, 1, 2.0 * steps, gib, 0, 0}, {}});
    return painting.work;
  };
  const double less = estimated_seconds(with_steps(500)) / 10;
  const auto paints = admit_time(with_steps(500), painting.params, {}, less);
  ASSERT_FALSE(paints);
  EXPECT_EQ(paints.error().where, "params.sampling_steps") << paints.error().message;
  const int steps = advised(paints.error().message, "params.sampling_steps");
  ASSERT_GT(steps, 0);
  EXPECT_LE(estimated_seconds(with_steps(steps)), less);
  EXPECT_GT(estimated_seconds(with_steps(steps + 1)), less);
}

}  // namespace
}  // namespace server::edits
