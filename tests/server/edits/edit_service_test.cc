#include "server/edits/edit_service.h"

#include <algorithm>
#include <optional>
#include <set>
#include <thread>

#include "engine/core/rng.h"
#include "server/edits/convert.h"
#include "server/edits/records.h"
#include "tests/server/edits/service_support.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  if (fs::exists(folder))
    for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
  return names;
}

TEST_F(ServiceTest, AnEditBecomesANewVersionOfItsScene) {
  const auto accepted = value(service->submit(move_ball(scene), ""));
  EXPECT_TRUE(accepted.created);
  EXPECT_EQ(accepted.status.id, "e000001");
  EXPECT_EQ(accepted.status.scene, scene);
  const auto done = wait_for_end(*service, "e000001");
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_EQ(done.result_version, 1);
  EXPECT_EQ(done.progress, 1);
  EXPECT_EQ(done.stage, "");
  EXPECT_FALSE(done.stopped_early);
  ASSERT_EQ(done.handles.size(), 1u);
  EXPECT_EQ(done.handles[0].gaussians, 200u);
  ASSERT_TRUE(done.gaussians);
  EXPECT_EQ(done.gaussians->input, 344u);
  EXPECT_EQ(done.gaussians->removed, 200u);
  EXPECT_EQ(done.gaussians->output, 144u + done.gaussians->copies);
  EXPECT_FALSE(done.simd.empty());
  EXPECT_FALSE(done.timings.empty());
  ASSERT_EQ(versions(), 2u);
  const auto version = value(store->find(scene)).versions.at(1);
  EXPECT_EQ(version.edit, "e000001");
  EXPECT_EQ(version.parent, 0);
  EXPECT_EQ(version.gaussians, done.gaussians->output);
}

TEST_F(ServiceTest, TellsAnOperatorHowLongStagesTook) {
  service.reset();
  std::vector<proto::StageSeconds> told;
  service = value(
      EditService::open(*store, {.folder = dir.path() / "edits",
                                 .threads = 1,
                                 .timed = [&](const std::vector<proto::StageSeconds>& timings) { told = timings; }}));
  EXPECT_EQ(service->oldest_queued_seconds(), 0);
  const auto accepted = value(service->submit(move_ball(scene), ""));
  const auto done = wait_for_end(*service, accepted.status.id);
  ASSERT_EQ(done.state, "succeeded");
  ASSERT_EQ(told.size(), done.timings.size());
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(told[i].stage, done.timings[i].stage);
    EXPECT_NEAR(told[i].seconds, done.timings[i].seconds, 1e-3);  // an answer's are rounded
  }
  service.reset();
}

TEST_F(ServiceTest, FillsInTheRequestFromTheStart) {
  proto::EditRequest request = move_ball(scene);
  request.params.intervals = std::nullopt;
  const auto accepted = value(service->submit(request, ""));
  EXPECT_EQ(accepted.status.request.version, 0);
  EXPECT_EQ(accepted.status.request.params.intervals, 2) << "0.5 in steps of 0.3";
  EXPECT_EQ(accepted.status.intervals, 2);
  EXPECT_EQ(accepted.status.request.params.corrector, proto::Corrector::none);
  EXPECT_EQ(wait_for_end(*service, accepted.status.id).request, accepted.status.request);
}

TEST_F(ServiceTest, FillsInTheDefaultPresetToo) {
  submit(move_ball_for_long(scene));
  proto::EditRequest request = move_ball(scene);
  request.preset = std::nullopt;
  request.params = {};
  const auto id = submit(request);
  const proto::EditStatus waiting = value(service->find(id));
  EXPECT_EQ(waiting.request.preset, proto::Preset::standard);
  EXPECT_EQ(waiting.request.params.corrector, proto::Corrector::scene);
  const auto standard = preset_params(proto::Preset::standard);
  EXPECT_EQ(waiting.request.params.iterations, standard.iterations);
  EXPECT_EQ(waiting.iterations, standard.iterations * standard.annealing_steps);
  (void)value(service->cancel(id));
}

TEST_F(ServiceTest, TellsOfEveryFinishedInterval) {
  const auto done = wait_for_end(*service, submit(move_ball(scene, 3)));
  ASSERT_EQ(done.finished_intervals.size(), 3u);
  for (int u = 1; u <= 3; ++u) {
    SCOPED_TRACE(u);
    const auto& finished = done.finished_intervals[std::size_t(u) - 1];
    EXPECT_EQ(finished.interval, u);
    EXPECT_GE(finished.seconds, 0);
    ASSERT_EQ(finished.positions.size(), 1u);
    EXPECT_NEAR(finished.positions[0][0], 0.5 * u / 3, 1e-5);
    ASSERT_EQ(finished.renders.size(), 2u) << "so many views are pictured";
    EXPECT_EQ(finished.renders[0].stages, (std::vector<std::string>{"before", "deformed"}));
  }
  EXPECT_EQ(done.interval, 3);
  EXPECT_EQ(done.intervals, 3);
}

TEST_F(ServiceTest, TellsTheLossOfAnOptimisedIntervalAndShowsItsPicture) {
  proto::EditRequest request = move_ball(scene);
  request.params.iterations = 5;
  const auto id = submit(request);
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded");
  ASSERT_EQ(done.finished_intervals.size(), 2u);
  for (const auto& finished : done.finished_intervals) {
    EXPECT_TRUE(finished.loss);
    EXPECT_EQ(finished.renders.at(0).stages, (std::vector<std::string>{"before", "deformed", "optimised"}));
  }
  EXPECT_TRUE(value(service->interval_picture(id, 1, 0, "optimised")).starts_with("\xff\xd8\xff"));
  EXPECT_EQ(done.request.params.iterations, 5);
  EXPECT_TRUE(done.warnings.empty());
}

TEST_F(ServiceTest, ShowsWhatACorrectedIntervalWasCorrectedTo) {
  const auto id = submit(move_and_correct_ball(scene));
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded");
  ASSERT_EQ(done.finished_intervals.size(), 2u);
  for (const auto& finished : done.finished_intervals) {
    EXPECT_TRUE(finished.loss);
    ASSERT_EQ(finished.renders.size(), 2u);
    for (const auto& render : finished.renders)
      EXPECT_EQ(render.stages, (std::vector<std::string>{"before", "deformed", "corrected", "optimised"})) << "once";
  }
  const auto deformed = value(service->interval_picture(id, 1, 0, "deformed")),
             corrected = value(service->interval_picture(id, 1, 0, "corrected")),
             optimised = value(service->interval_picture(id, 1, 0, "optimised"));
  EXPECT_TRUE(corrected.starts_with("\xff\xd8\xff"));
  EXPECT_NE(corrected, deformed);
  EXPECT_NE(optimised, deformed);
  EXPECT_EQ(value(service->interval_picture(id, 2, 0, "before")), optimised) << "not what was only aimed at";
  EXPECT_EQ(done.request.params.corrector, proto::Corrector::scene);
  for (const std::string& warning : done.warnings)
    EXPECT_NE(warning.find("could not be completed"), std::string::npos)
        << "of a wall of tufts, no two pictures tell the same: " << warning;
  EXPECT_EQ(std::count_if(done.timings.begin(), done.timings.end(),
                          [](const auto& timing) { return timing.stage == "correct"; }),
            1);
}

TEST_F(ServiceTest, TellsWhenItCorrects) {
  proto::EditRequest request = move_and_correct_ball(scene);
  request.params.views = 20;
  request.params.max_image_side = 160;
  const auto id = submit(request);
  const auto correcting = wait_for(*service, id, [](const auto& status) { return status.stage == "correct"; });
  EXPECT_EQ(correcting.iteration, 0);
  EXPECT_FALSE(correcting.loss);
  (void)value(service->cancel(id));
  EXPECT_EQ(wait_for_end(*service, id).state, "cancelled");
  EXPECT_EQ(versions(), 1u);
}

TEST_F(ServiceTest, ACorrectedEditGoesOnToTheSameBytes) {
  const auto whole = wait_for_end(*service, submit(move_and_correct_ball(scene, 3)));
  ASSERT_EQ(whole.state, "succeeded");
  const auto id = submit(move_and_correct_ball(scene, 3));
  wait_for_interval(*service, id, 1);
  reopen();
  const auto resumed = wait_for_end(*service, id);
  ASSERT_EQ(resumed.state, "succeeded");
  EXPECT_EQ(resumed.warnings, whole.warnings);
  EXPECT_EQ(version_bytes(*store, scene, *resumed.result_version), version_bytes(*store, scene, *whole.result_version));
}

/// Moves the ball by what is selected; its handle says nothing of how far it grips.
proto::EditRequest move_selected_ball(const std::string& scene, int intervals = 2) {
  proto::EditRequest request = move_and_correct_ball(scene, intervals);
  request.handles[0].radius.reset();
  request.selection = {{.action = proto::selection::Sphere{{0, 0, 0}, 0.3}}};
  return request;
}

TEST_F(ServiceTest, MovesWhatIsSelected) {
  proto::EditRequest request = move_selected_ball(scene);
  request.preset = proto::Preset::preview;
  request.params = move_ball(scene).params;
  request.params.interpolation = proto::Interpolation::rigid;
  const auto by_ball = wait_for_end(*service, submit(move_ball(scene)));
  const auto accepted = value(service->submit(request, ""));
  EXPECT_EQ(accepted.status.request.selection, request.selection);
  const auto done = wait_for_end(*service, accepted.status.id);
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_EQ(done.handles.at(0).gaussians, 200u);
  EXPECT_EQ(done.request.selection, request.selection);
  ASSERT_TRUE(done.request.handles[0].radius) << "what was used is said";
  EXPECT_NEAR(*done.request.handles[0].radius, 0.175, 0.001) << "that of the ball";
  EXPECT_EQ(version_bytes(*store, scene, *done.result_version), version_bytes(*store, scene, *by_ball.result_version));

  request.params.interpolation.reset();
  const auto body = value(service->preview(request));
  ASSERT_EQ(body.parts.size(), 1u) << "what is selected moves as a body";
  EXPECT_EQ(body.parts[0].how, "one_piece");
  EXPECT_EQ(body.handles.at(0).gaussians, 200u);

  request.selection->push_back(
      {.op = proto::selection::Op::subtract, .action = proto::selection::Plane{{0, 0, 0}, {0, 1, 0}}});
  const auto half = value(service->preview(request));
  EXPECT_GT(half.handles.at(0).gaussians, 50u);
  EXPECT_LT(half.handles.at(0).gaussians, 150u);
  request.region = proto::Region{{0, 0, 0}, {0.1, 4, 4}};
  EXPECT_LT(value(service->preview(request)).handles.at(0).gaussians, half.handles.at(0).gaussians)
      << "within the region";
}

TEST_F(ServiceTest, LeavesTheNumberOfIntervalsToWhatIsSelected) {
  proto::EditRequest request = move_selected_ball(scene);
  request.params.intervals.reset();
  request.handles[0].target = proto::Point{1, 0, 0};
  request.mode = proto::Mode::extend;
  request.params.interpolation = proto::Interpolation::rigid;
  const auto before_it = submit(move_ball_for_long(scene));
  const auto waiting = value(service->submit(request, "")).status;
  EXPECT_EQ(waiting.request.params.intervals, std::nullopt) << "not known before it begins";
  EXPECT_EQ(waiting.intervals, 0);
  const auto estimate = value(service->estimate(request));
  EXPECT_EQ(estimate.intervals, 3);
  EXPECT_EQ(estimate.request.params.intervals, 3);
  EXPECT_EQ(estimate.request.selection, request.selection);
  (void)value(service->cancel(before_it));
  EXPECT_EQ(wait_for_end(*service, waiting.id).intervals, 3);
}

TEST_F(ServiceTest, AnEditOfASelectionGoesOnToTheSameBytes) {
  const auto whole = wait_for_end(*service, submit(move_selected_ball(scene, 3)));
  ASSERT_EQ(whole.state, "succeeded") << whole.error->message;
  const auto id = submit(move_selected_ball(scene, 3));
  wait_for_interval(*service, id, 1);
  reopen();
  const auto resumed = wait_for_end(*service, id);
  ASSERT_EQ(resumed.state, "succeeded");
  EXPECT_EQ(resumed.request, whole.request);
  EXPECT_EQ(version_bytes(*store, scene, *resumed.result_version), version_bytes(*store, scene, *whole.result_version));
}

TEST_F(ServiceTest, RemovesWhatIsSelectedAndHealsWhatIsSaid) {
  proto::EditRequest request = move_selected_ball(scene);
  request.mode = proto::Mode::remove;
  request.handles.clear();
  request.preset = proto::Preset::draft;
  const auto preview = value(service->preview(request));
  ASSERT_EQ(preview.handles.size(), 1u);
  EXPECT_GT(preview.handles[0].gaussians, 0u);
  request.heal = {{.action = proto::selection::Rows{{{0, 3}}}}};
  EXPECT_EQ(value(service->estimate(request)).request.heal, request.heal);
  const auto ended = wait_for_end(*service, submit(request));
  ASSERT_EQ(ended.state, "succeeded") << ended.error->message;
  EXPECT_EQ(ended.request.heal, request.heal);
  EXPECT_EQ(ended.request.selection, request.selection);
  EXPECT_TRUE(ended.request.handles.empty());
  request.heal = {{.action = proto::selection::Sphere{{9, 9, 9}, 0.1}}};
  EXPECT_EQ(service->submit(request, "").error().where, "heal");
  request.heal = {{.action = proto::selection::Rows{{{0, 345}}}}};
  EXPECT_EQ(service->estimate(request).error().where, "heal[0].rows[0]");
}

TEST_F(ServiceTest, SaysWhatIsWrongWithASelection) {
  struct Case {
    const char* what;
    proto::selection::Action action;
    ErrorCode code;
    const char* where;
  };
  const Case cases[] = {
      {"empty", proto::selection::Sphere{{9, 9, 9}, 0.1}, ErrorCode::unprocessable, "selection"},
      {"no such row", proto::selection::Rows{{{0, 345}}}, ErrorCode::unprocessable, "selection[0].rows[0]"},
      {"no dataset", proto::selection::Stroke{"a.png", {{1, 1}}, 3}, ErrorCode::not_found, "selection[0].stroke.view"},
      {"nothing there", proto::selection::Grow{{{0, 90, 0}}, {}, 1}, ErrorCode::unprocessable,
       "selection[0].grow.inside[0]"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    proto::EditRequest request = move_selected_ball(scene);
    request.selection = {{.action = c.action}};
    for (const auto& error : {service->submit(request, "").error(), service->estimate(request).error(),
                              service->preview(request).error()}) {
      EXPECT_EQ(error.code, c.code) << error.message;
      EXPECT_EQ(error.where, c.where) << error.message;
    }
  }
  proto::EditRequest request = move_selected_ball(scene);
  request.handles.push_back({.source = {50, 0, 0}, .target = proto::Point{51, 0, 0}, .radius = {}});
  const auto lonely = service->preview(request);
  ASSERT_FALSE(lonely);
  EXPECT_EQ(lonely.error().where, "handles[1].source") << lonely.error().message;
}

TEST_F(ServiceTest, WarnsOfWhatASelectionTakesTooMuchOf) {
  proto::EditRequest request = move_ball(scene);
  const proto::PinholeCamera close{32, 32, 200, 200, 16, 16, {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 4}}}};
  request.selection = {{.action = proto::selection::Sphere{{0, 0, 0}, 0.3}},
                       {.action = proto::selection::Stroke{proto::Camera(close), {{16, 16}}, 40}},
                       {.action = proto::selection::Sphere{{40, 0, 0}, 0.1}}};
  const auto warnings = value(service->preview(request)).warnings;
  EXPECT_TRUE(std::ranges::any_of(warnings, [](const auto& w) { return w.starts_with("the selection takes"); }));
  EXPECT_TRUE(
      std::ranges::any_of(warnings, [](const auto& w) { return w == "selection[2]: the sphere names no Gaussian"; }));
  EXPECT_EQ(value(service->estimate(request)).warnings, warnings);
  const auto done = wait_for_end(*service, submit(request));
  for (const std::string& warning : warnings) EXPECT_TRUE(std::ranges::count(done.warnings, warning)) << warning;
}

TEST_F(ServiceTest, ShowsPicturesOfEveryInterval) {
  const auto id = submit(move_ball(scene));
  wait_for_end(*service, id);
  const auto before = value(service->interval_picture(id, 1, 0, "before"));
  const auto deformed = value(service->interval_picture(id, 1, 0, "deformed"));
  EXPECT_TRUE(before.starts_with("\xff\xd8\xff")) << "JPEG";
  EXPECT_NE(before, deformed);
  EXPECT_EQ(value(service->interval_picture(id, 2, 0, "before")), deformed) << "it begins as the one before ended";
}

TEST_F(ServiceTest, LooksAtASceneTheWayThatIsUp) {
  const auto picture = [&] {
    const auto id = submit(move_ball(scene));
    EXPECT_EQ(wait_for_end(*service, id).state, "succeeded");
    return value(service->interval_picture(id, 1, 0, "before"));
  };
  const auto as_usual = picture();
  value(store->patch(scene, {{}, engine::DVec3(0, -2, 0)}));
  EXPECT_EQ(picture(), as_usual) << "y down is what is taken for granted";
  value(store->patch(scene, {{}, engine::DVec3(1, 0, 0)}));
  EXPECT_NE(picture(), as_usual);
}

TEST_F(ServiceTest, SaysWhichPicturesThereAre) {
  const auto id = submit(move_ball(scene));
  wait_for_end(*service, id);
  const auto refusal = [&](int interval, int view, const std::string& stage) {
    const auto picture = service->interval_picture(id, interval, view, stage);
    EXPECT_EQ(code_of(picture), ErrorCode::not_found);
    return picture.error();
  };
  EXPECT_EQ(refusal(0, 0, "before").where, "interval");
  EXPECT_EQ(refusal(3, 0, "before").where, "interval");
  EXPECT_NE(refusal(3, 0, "before").message.find("1 to 2"), std::string::npos);
  EXPECT_EQ(refusal(1, 2, "before").where, "render");
  EXPECT_EQ(refusal(1, -1, "before").where, "render");
  EXPECT_NE(refusal(1, 0, "optimised").message.find("before, deformed"), std::string::npos);
  EXPECT_EQ(refusal(1, 0, "../../x").where, "stage");
  EXPECT_EQ(code_of(service->interval_picture("e000009", 1, 0, "before")), ErrorCode::not_found);
}

TEST_F(ServiceTest, RefusesAtOnceWhatCannotBeDone) {
  struct Case {
    const char* what;
    std::function<void(proto::EditRequest&)> spoil;
    ErrorCode code;
    const char* where;
  };
  const Case cases[] = {
      {"no scene named", [](auto& r) { r.scene.reset(); }, ErrorCode::invalid_argument, "scene"},
      {"unknown scene", [](auto& r) { r.scene = "s000099"; }, ErrorCode::not_found, "scene"},
      {"unknown version", [](auto& r) { r.version = 7; }, ErrorCode::not_found, "version"},
      {"no handles", [](auto& r) { r.handles.clear(); }, ErrorCode::invalid_argument, "handles"},
      {"bad radius", [](auto& r) { r.handles[0].radius = 0; }, ErrorCode::invalid_argument, "handles[0].radius"},
      {"far away",
       [](auto& r) {
         r.handles[0].source = {9, 9, 9};
       },
       ErrorCode::unprocessable, "handles[0].radius"},
      {"no such corrector", [](auto& r) { r.params.corrector = proto::Corrector::sd; }, ErrorCode::unsupported,
       "params.corrector"},
      {"bad views", [](auto& r) { r.params.views = 0; }, ErrorCode::invalid_argument, "params.views"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    proto::EditRequest request = move_ball(scene);
    c.spoil(request);
    const auto submitted = service->submit(request, "");
    ASSERT_FALSE(submitted);
    EXPECT_EQ(submitted.error().code, c.code) << submitted.error().message;
    EXPECT_EQ(submitted.error().where, c.where);
    const auto estimated = service->estimate(request);
    ASSERT_FALSE(estimated);
    EXPECT_EQ(estimated.error().where, c.where);
    const auto previewed = service->preview(request);
    ASSERT_FALSE(previewed);
    EXPECT_EQ(previewed.error().where, c.where);
  }
  EXPECT_TRUE(value(service->list({})).empty());
}

TEST_F(ServiceTest, AKeyGivesTheSameEditOnceMore) {
  const auto first = value(service->submit(move_ball(scene), "key 1"));
  const auto again = value(service->submit(move_ball(scene), "key 1"));
  EXPECT_TRUE(first.created);
  EXPECT_FALSE(again.created);
  EXPECT_EQ(again.status.id, first.status.id);
  proto::EditRequest explicit_version = move_ball(scene);
  explicit_version.version = 0;
  EXPECT_EQ(value(service->submit(explicit_version, "key 1")).status.id, first.status.id) << "0 is the default";
  const auto other = service->submit(move_ball(scene, 3), "key 1");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::unprocessable);
  EXPECT_EQ(other.error().where, "Idempotency-Key");
  wait_for_end(*service, first.status.id);
  EXPECT_EQ(value(service->submit(move_ball(scene), "key 1")).status.id, first.status.id) << "ended since";
  EXPECT_EQ(value(service->submit(move_ball(scene), "key 2")).created, true);
}

TEST_F(ServiceTest, AKeyGivesItsEditThoughTheSceneIsGone) {
  const auto id = submit(move_ball(scene), "key");
  wait_for_end(*service, id);
  value(service->remove_scene(scene));
  EXPECT_EQ(value(service->submit(move_ball(scene), "key")).status.id, id);
  EXPECT_EQ(code_of(service->submit(move_ball(scene), "")), ErrorCode::not_found);
}

TEST_F(ServiceTest, SequenceOnOneSceneBuildsOnWhatCameBefore) {
  wait_for_end(*service, submit(move_ball(scene)));
  proto::EditRequest back = move_ball(scene);
  back.version = 1;
  back.handles[0] = {.source = {0.5, 0, 0}, .target = proto::Point{0, 0, 0}, .radius = 0.3};
  const auto done = wait_for_end(*service, submit(back));
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_EQ(done.version, 1);
  EXPECT_EQ(done.result_version, 2);
  EXPECT_EQ(value(store->find(scene)).versions.at(2).parent, 1);
}

// Of one scene: which of two scenes' edits goes first depends on what they are estimated to take, and so on the
// machine.
TEST_F(ServiceTest, EditsWaitForEachOtherInTheirOrder) {
  const auto first = submit(move_ball_for_long(scene));
  const auto second = submit(move_ball_for_long(scene)), third = submit(move_ball_for_long(scene));
  wait_for_interval(*service, first);
  EXPECT_EQ(value(service->find(second)).queue_position, 1);
  EXPECT_EQ(value(service->find(third)).queue_position, 2);
  EXPECT_EQ(value(service->find(first)).queue_position, std::nullopt);
  for (const auto& id : {first, second, third}) {
    wait_for_interval(*service, id);
    (void)value(service->stop(id));
  }
  EXPECT_EQ(wait_for_end(*service, third).result_version, 3) << "the first one's is 1";
  EXPECT_EQ(value(service->find(second)).result_version, 2);
  const std::string other = add_ball(*store, dir.path());
  const auto of_other = submit(move_ball(other));
  EXPECT_EQ(wait_for_end(*service, of_other).result_version, 1) << "of its own scene";

  const auto listed = [&](const EditService::Filter& filter) {
    std::vector<std::string> ids;
    for (const auto& status : value(service->list(filter))) ids.push_back(status.id);
    return ids;
  };
  EXPECT_EQ(listed({}), (std::vector{of_other, third, second, first}));
  EXPECT_EQ(listed({.scene = other}), (std::vector{of_other}));
  EXPECT_EQ(listed({.limit = 1}), (std::vector{of_other}));
  EXPECT_TRUE(listed({.active_only = true}).empty());
  EXPECT_EQ(value(service->list({}))[1].request.scene, scene) << "a list tells as much as a look at each";
}

TEST_F(ServiceTest, AFullQueueIsBusy) {
  reopen(1);
  submit(move_ball_for_long(scene));
  wait_for(*service, "e000001", [](const auto& status) { return status.state == "running"; });
  submit(move_ball_for_long(scene, 2));
  EXPECT_EQ(code_of(service->submit(move_ball(scene), "")), ErrorCode::busy);
}

TEST_F(ServiceTest, KeepsEverybodyWithinTheirQuota) {
  const EditService::Requester studio{.name = "studio", .quota = {.active = 1}};
  const std::string first = value(service->submit(move_ball_for_long(scene), "key", studio)).status.id;
  const auto refused = service->submit(move_ball(scene), "", studio);
  ASSERT_EQ(code_of(refused), ErrorCode::quota_exceeded);
  EXPECT_EQ(refused.error().where, "edits");
  EXPECT_EQ(value(service->submit(move_ball_for_long(scene), "key", studio)).status.id, first) << "asked again";
  (void)value(service->submit(move_ball(scene), "", {.name = "others", .quota = {.active = 1}}));
  (void)value(service->estimate(move_ball(scene)));
  (void)value(service->cancel(first));
  wait_for_end(*service, first);
  (void)value(service->submit(move_ball(scene), "", studio));
  const auto too_long =
      service->submit(move_ball_for_long(scene), "", {.name = "third", .quota = {.worked_per_day = 1ms}});
  ASSERT_EQ(code_of(too_long), ErrorCode::too_large) << "it fits on no day";
  EXPECT_EQ(too_long.error().where, "seconds");
}

TEST_F(ServiceTest, LooksAtASceneWithinTheMemoryForWorkAndOnlyWhereThereIsRoomInTheQueue) {
  service.reset();
  engine::MemoryBudget budget(1 << 30, "--work-memory", std::chrono::milliseconds(20));
  service = value(
      EditService::open(*store, {.folder = dir.path() / "edits", .max_queued = 1, .threads = 1, .memory = &budget}));
  submit(move_ball_for_long(scene));
  wait_for(*service, "e000001", [](const auto& status) { return status.state == "running"; });
  {
    const auto others = value(budget.take(1 << 30, ""));
    EXPECT_EQ(code_of(service->submit(move_ball(scene), "")), ErrorCode::unavailable);
    EXPECT_EQ(code_of(service->estimate(move_ball(scene))), ErrorCode::unavailable);
  }
  submit(move_ball_for_long(scene, 2));
  EXPECT_EQ(budget.lent(), 0u);
  const auto others = value(budget.take(1 << 30, ""));
  EXPECT_EQ(code_of(service->submit(move_ball(scene), "")), ErrorCode::busy) << "nothing is measured for it";
  service.reset();  // before the budget goes
}

TEST_F(ServiceTest, StopKeepsTheLastFinishedInterval) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id, 2);
  const auto stopping = value(service->stop(id));
  EXPECT_EQ(stopping.state, "stop_requested");
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_TRUE(done.stopped_early);
  EXPECT_LT(done.finished_intervals.size(), 20u);
  EXPECT_EQ(done.progress, 1);
  ASSERT_EQ(done.result_version, 1);
  // The ball has come as far as the handle, which its record says.
  const double reached = done.finished_intervals.back().positions[0][0];
  EXPECT_NEAR(reached, 0.5 * double(done.finished_intervals.size()) / 20, 1e-4);
  EXPECT_EQ(code_of(service->stop(id)), ErrorCode::conflict);
}

TEST_F(ServiceTest, StopGivesTheIntervalInWorkUp) {
  proto::EditRequest request = move_ball_for_long(scene);
  if (!under_thread_sanitizer) request.params.max_image_side = 768;
  const auto id = submit(request);
  wait_for_interval(*service, id);  // the next one has a second to go, and is asked all the time whether to go on
  const auto stopping = value(service->stop(id));
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_TRUE(done.stopped_early);
  EXPECT_EQ(done.finished_intervals.size(), stopping.finished_intervals.size());
  EXPECT_EQ(versions(), 2u);
}

TEST_F(ServiceTest, StopNeedsSomethingToKeep) {
  submit(move_ball_for_long(scene));
  const auto waiting = submit(move_ball_for_long(scene, 2));
  EXPECT_EQ(code_of(service->stop(waiting)), ErrorCode::conflict);
  EXPECT_EQ(code_of(service->stop("e000077")), ErrorCode::not_found);
}

TEST_F(ServiceTest, AShortEditGoesFirstBetweenTheIntervalsOfALongOneWhichEndsWithTheSameBytes) {
  const std::string undisturbed = add_ball(*store, dir.path()), other = add_ball(*store, dir.path());
  const auto slowly = [](const std::string& of) {
    proto::EditRequest request = move_ball_slowly(of);
    if (!under_thread_sanitizer) request.params.views = 400, request.params.max_image_side = 320;
    return request;
  };
  ASSERT_GT(value(service->estimate(slowly(scene))).seconds, 1.0) << "it is too short to be overtaken";
  const auto alone = wait_for_end(*service, submit(slowly(undisturbed)));
  ASSERT_EQ(alone.state, "succeeded");

  const auto longest = submit(slowly(scene)), after_it = submit(move_ball(scene, 1));
  wait_for_interval(*service, longest);
  const auto shorter = submit(move_ball(other, 1));
  EXPECT_EQ(wait_for_end(*service, shorter).state, "succeeded");
  const auto overtaken = value(service->find(longest));
  EXPECT_FALSE(overtaken.ended) << "the short one has waited for the long one";
  EXPECT_GE(overtaken.finished_intervals.size(), 1u);
  EXPECT_FALSE(value(service->find(after_it)).started) << "edits of a scene come in order";
  const auto done = wait_for_end(*service, longest);
  EXPECT_EQ(done.state, "succeeded");
  EXPECT_TRUE(done.warnings.empty()) << done.warnings[0];
  EXPECT_EQ(done.finished_intervals.size(), 20u);
  EXPECT_EQ(version_bytes(*store, scene, *done.result_version),
            version_bytes(*store, undisturbed, *alone.result_version));
  EXPECT_EQ(wait_for_end(*service, after_it).state, "succeeded");
}

TEST_F(ServiceTest, RefusesAnEditThatTakesLongerThanOneMay) {
  service.reset();
  service = value(EditService::open(*store, {.folder = dir.path() / "edits", .longest_seconds = 1e-4, .threads = 1}));
  for (const auto& refused :
       {code_of(service->submit(move_ball(scene), "")), code_of(service->estimate(move_ball(scene)))})
    EXPECT_EQ(refused, ErrorCode::too_large);
  EXPECT_EQ(service->submit(move_ball(scene), "").error().where, "scene") << "nothing would be short enough";
  EXPECT_TRUE(value(service->list({})).empty());
}

/// Takes its time.
class Sleeper final : public engine::optim::PerceptualLoss {
 public:
  Result<double> evaluate(const engine::scene::Image& rendered, const engine::scene::Image&,
                          engine::scene::Image& v_rendered) override {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    v_rendered = engine::scene::Image(rendered.width, rendered.height, rendered.channels, 0.0f);
    return 0.0;
  }
  double seconds = 0;
};

TEST_F(ServiceTest, AnEditThatOutlivesItsTimeEndsWithWhatItHas) {
  proto::EditRequest request = move_ball(scene, 3);
  request.params.iterations = 1;
  // Estimates of so little are mostly of what surrounds it; under a sanitizer they are longer.
  const double limit = std::max(1.0, 1.5 * value(service->estimate(request)).seconds);
  service.reset();
  Sleeper sleeper;
  const auto hurried = value(EditService::open(*store, {.folder = dir.path() / "edits",
                                                        .pictured_views = 1,
                                                        .longest_seconds = limit,
                                                        .threads = 1,
                                                        .perceptual = &sleeper}));
  sleeper.seconds = 0.9 * limit;  // of each interval
  const auto some = wait_for_end(*hurried, value(hurried->submit(request, "")).status.id);
  ASSERT_EQ(some.state, "succeeded") << some.error->message;
  EXPECT_TRUE(some.stopped_early);
  EXPECT_LT(some.finished_intervals.size(), 3u);
  ASSERT_FALSE(some.warnings.empty());
  EXPECT_TRUE(std::ranges::any_of(
      some.warnings, [](const std::string& warning) { return warning.find("--edit-time") != std::string::npos; }));
  EXPECT_EQ(some.result_version, 1);

  request.params.intervals = 1;
  request.params.iterations = 4;
  const auto none = wait_for_end(*hurried, value(hurried->submit(request, "")).status.id);
  EXPECT_EQ(none.state, "failed");
  ASSERT_TRUE(none.error);
  EXPECT_EQ(none.error->code, ErrorCode::too_large);
  EXPECT_NE(none.error->message.find("--edit-time"), std::string::npos) << none.error->message;
  EXPECT_EQ(versions(), 2u);

  sleeper.seconds = 0;
  (void)value(hurried->requeue(none.id));
  EXPECT_EQ(wait_for_end(*hurried, none.id).state, "succeeded") << "it has its whole time again";
}

TEST_F(ServiceTest, ACancelledEditLeavesNothingAtWhateverMomentItComes) {
  engine::Rng rng(8);
  int cancelled = 0;
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE(round);
    const std::size_t before = versions();
    proto::EditRequest request = move_ball(scene, 4);  // over in a few dozen milliseconds
    const auto id = submit(request);
    std::this_thread::sleep_for(std::chrono::microseconds(rng.below(40'000)));
    const auto answer = service->cancel(id);
    const auto end = wait_for_end(*service, id);
    if (answer) {
      ++cancelled;
      EXPECT_EQ(end.state, "cancelled");
      EXPECT_EQ(end.result_version, std::nullopt);
      EXPECT_TRUE(end.finished_intervals.empty());
      EXPECT_EQ(versions(), before) << "it leaves no version";
      EXPECT_EQ(value(service->cancel(id)).state, "cancelled") << "idempotent";
    } else {
      EXPECT_EQ(answer.error().code, ErrorCode::conflict);
      EXPECT_EQ(end.state, "succeeded");
      EXPECT_EQ(versions(), before + 1);
    }
  }
  EXPECT_GE(cancelled, 1);
}

TEST_F(ServiceTest, ACancelledEditsFilesAreGone) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id);
  EXPECT_TRUE(fs::exists(dir.path() / "edits/jobs" / id));
  value(service->cancel(id));
  wait_for_end(*service, id);
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (fs::exists(dir.path() / "edits/jobs" / id) && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(fs::exists(dir.path() / "edits/jobs" / id));
  EXPECT_EQ(code_of(service->interval_picture(id, 1, 0, "before")), ErrorCode::not_found);
}

TEST_F(ServiceTest, OnlyWhatHasEndedCanBeRemoved) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id);
  EXPECT_EQ(code_of(service->remove(id)), ErrorCode::conflict);
  value(service->cancel(id));
  wait_for_end(*service, id);
  value(service->remove(id));
  EXPECT_EQ(code_of(service->find(id)), ErrorCode::not_found);
  EXPECT_EQ(code_of(service->remove(id)), ErrorCode::not_found);
}

TEST_F(ServiceTest, RemovingAnEditKeepsItsResult) {
  const auto id = submit(move_ball(scene));
  wait_for_end(*service, id);
  value(service->remove(id));
  EXPECT_EQ(versions(), 2u);
  EXPECT_EQ(names_in(dir.path() / "edits/jobs"), std::set<std::string>{"last_number"});
}

TEST_F(ServiceTest, AVersionIsKeptAsLongAsAnEditNeedsIt) {
  for (int i = 0; i < 2; ++i) wait_for_end(*service, submit(move_ball(scene)));
  proto::EditRequest request = move_ball_for_long(scene);
  request.version = 1;
  request.handles[0].source = {0.5, 0, 0}, request.handles[0].target = proto::Point{0, 0, 0};
  const auto id = submit(request);
  const auto refused = service->remove_version(scene, "1");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::conflict);
  EXPECT_NE(refused.error().message.find(id), std::string::npos) << refused.error().message;
  EXPECT_TRUE(service->remove_version(scene, "2")) << "nobody needs that one";
  value(service->cancel(id));
  wait_for_end(*service, id);
  value(service->remove_version(scene, "1"));
  EXPECT_EQ(versions(), 1u);
  EXPECT_EQ(value(service->find("e000001")).result_version, 1) << "what it made then";
  EXPECT_EQ(code_of(service->submit(request, "")), ErrorCode::not_found);
  EXPECT_EQ(wait_for_end(*service, submit(move_ball(scene))).result_version, 3) << "no number is used twice";
}

TEST_F(ServiceTest, ASceneIsKeptAsLongAsAnEditNeedsIt) {
  const auto id = submit(move_ball_for_long(scene));
  const auto refused = service->remove_scene(scene);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::conflict);
  EXPECT_NE(refused.error().message.find(id), std::string::npos) << refused.error().message;
  value(service->cancel(id));
  wait_for_end(*service, id);
  value(service->remove_scene(scene));
  EXPECT_EQ(code_of(service->remove_scene(scene)), ErrorCode::not_found);
}

TEST_F(ServiceTest, NoAcceptedEditLosesItsSceneWhileBothAreAskedFor) {
  for (int round = 0; round < 10; ++round) {
    SCOPED_TRACE(round);
    const std::string contested = add_ball(*store, dir.path());
    Result<EditService::Submission> submitted = engine::fail(ErrorCode::internal, "");
    std::thread submitter([&] { submitted = service->submit(move_ball(contested), ""); });
    const auto removed = service->remove_scene(contested);
    submitter.join();
    ASSERT_NE(submitted.has_value(), removed.has_value()) << "one of them comes first";
    if (submitted)
      EXPECT_EQ(wait_for_end(*service, submitted->status.id).state, "succeeded");
    else
      EXPECT_EQ(submitted.error().code, ErrorCode::not_found);
  }
}

TEST_F(ServiceTest, AnEditEndsTheSameAfterARestart) {
  const auto whole = wait_for_end(*service, submit(move_ball_slowly(scene)));
  ASSERT_EQ(whole.state, "succeeded");
  const auto id = submit(move_ball_slowly(scene));
  wait_for_interval(*service, id, 3);
  reopen();
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded") << done.error->message;
  EXPECT_EQ(version_bytes(*store, scene, *done.result_version), version_bytes(*store, scene, *whole.result_version));
  EXPECT_EQ(done.finished_intervals.size(), 20u) << "those before the restart are remembered";
  EXPECT_EQ(done.finished_intervals[0].positions, whole.finished_intervals[0].positions);
  EXPECT_TRUE(done.warnings.empty()) << done.warnings[0];
  for (int u = 1; u <= 20; ++u)
    EXPECT_EQ(value(service->interval_picture(id, u, 1, "deformed")),
              value(service->interval_picture("e000001", u, 1, "deformed")))
        << u;
}

TEST_F(ServiceTest, ADamagedCheckpointCostsTimeOnly) {
  const auto whole = wait_for_end(*service, submit(move_ball_slowly(scene)));
  for (const char* how : {"cut", "gone", "other bytes"}) {
    SCOPED_TRACE(how);
    const auto id = submit(move_ball_slowly(scene));
    wait_for_interval(*service, id, 3);
    service.reset();
    for (const std::string& name : names_in(dir.path() / "edits/jobs" / id)) {
      if (!name.starts_with("checkpoint-")) continue;
      const fs::path file = dir.path() / "edits/jobs" / id / name;
      std::string bytes = support::read_file(file);
      if (how[0] == 'c') bytes.resize(bytes.size() / 2);
      if (how[0] == 'o') bytes[bytes.size() / 3] ^= 1;
      how[0] == 'g' ? void(fs::remove(file)) : support::write_file(file, bytes);
    }
    service = open_service(*store, dir.path());
    const auto done = wait_for_end(*service, id);
    ASSERT_EQ(done.state, "succeeded") << done.error->message;
    ASSERT_EQ(done.warnings.size(), 1u);
    EXPECT_NE(done.warnings[0].find("begin again"), std::string::npos) << done.warnings[0];
    EXPECT_EQ(version_bytes(*store, scene, *done.result_version), version_bytes(*store, scene, *whole.result_version));
    EXPECT_EQ(done.finished_intervals.size(), 20u);
  }
}

TEST_F(ServiceTest, AStopThatARestartCameBetweenKeepsThePromisedInterval) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id, 3);
  service->drain(0ms);
  const auto finished = value(service->find(id)).finished_intervals.size();
  const auto stopping = value(service->stop(id));
  EXPECT_EQ(stopping.state, "stop_requested");
  reopen();
  const auto done = wait_for_end(*service, id);
  ASSERT_EQ(done.state, "succeeded");
  EXPECT_TRUE(done.stopped_early);
  EXPECT_EQ(done.finished_intervals.size(), finished);
}

TEST_F(ServiceTest, EndedEditsAreRememberedAcrossARestart) {
  const auto id = submit(move_ball(scene), "key");
  const auto before = proto::to_json(wait_for_end(*service, id));
  reopen();
  EXPECT_EQ(proto::to_json(value(service->find(id))), before) << "not a byte changed";
  EXPECT_FALSE(value(service->submit(move_ball(scene), "key")).created);
}

TEST_F(ServiceTest, ALostJobStoreDoesNotMixUpResults) {
  wait_for_end(*service, submit(move_ball(scene)));
  service.reset();
  fs::remove_all(dir.path() / "edits");
  const ServiceOptions options{.folder = dir.path() / "edits"};
  for (int start = 0; start < 2; ++start) {  // it does not begin afresh by being started again either
    const auto opened = EditService::open(*store, options);
    ASSERT_EQ(code_of(opened), ErrorCode::corrupt_data);
    EXPECT_NE(opened.error().message.find("splatdrag admin rebuild"), std::string::npos) << opened.error().message;
  }
  EXPECT_TRUE(value(rebuild_records(*store, options.folder)).findings.empty()) << "nothing is left of the edit";
  service = open_service(*store, dir.path());
  const auto id = submit(move_ball(scene, 3));
  EXPECT_EQ(id, "e000002") << "e000001 stands beside version 1";
  EXPECT_EQ(wait_for_end(*service, id).result_version, 2);
}

TEST_F(ServiceTest, AnEditComesBackAfterItsRecordsWereLost) {
  const auto ended = submit(move_ball(scene), "key");
  wait_for_end(*service, ended);
  const auto id = submit(move_ball_slowly(scene));
  wait_for_interval(*service, id);
  service.reset();
  const fs::path edits = dir.path() / "edits";
  support::write_file(edits / "jobs.db", "");
  fs::remove(edits / "jobs.db-wal");
  EXPECT_FALSE(value(check_records(edits)).damaged.empty());
  ASSERT_EQ(code_of(EditService::open(*store, {.folder = edits})), ErrorCode::corrupt_data);
  EXPECT_EQ(value(rebuild_records(*store, edits)).findings.size(), 2u);
  EXPECT_TRUE(value(check_records(edits)).damaged.empty());
  service = open_service(*store, dir.path());
  const auto before = value(service->find(ended));
  EXPECT_EQ(before.state, "succeeded");
  EXPECT_EQ(before.result_version, 1);
  EXPECT_FALSE(value(service->submit(move_ball(scene), "key")).created) << "its key is known still";
  const auto after = wait_for_end(*service, id);
  EXPECT_EQ(after.state, "succeeded") << after.stage;
  EXPECT_EQ(after.result_version, 2);
}

TEST_F(ServiceTest, ADamagedPictureIsNamedAndNotServed) {
  const auto id = submit(move_ball(scene));
  wait_for_end(*service, id);
  const fs::path file = dir.path() / "edits/jobs" / id / "interval-1-view-0-before.jpg";
  std::string bytes = support::read_file(file);
  bytes[bytes.size() / 2] = char(bytes[bytes.size() / 2] ^ 8);
  support::write_file(file, bytes);
  const auto picture = service->interval_picture(id, 1, 0, "before");
  ASSERT_EQ(code_of(picture), ErrorCode::corrupt_data);
  EXPECT_EQ(picture.error().where, "edits/jobs/" + id + "/interval-1-view-0-before.jpg");
  EXPECT_TRUE(service->interval_picture(id, 1, 0, "deformed"));
}

TEST_F(ServiceTest, BetweenTwoNewsNotAByteChanges) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id);
  int same = 0;
  for (int i = 0; i < 50; ++i) {
    const auto seen = service->version();
    const auto one = proto::to_json(value(service->find(id))), two = proto::to_json(value(service->find(id)));
    if (service->version() != seen) continue;  // there was news
    if (one == two) {
      ++same;
      continue;
    }
    // What is new can be read a moment before it is told; whoever reads it in between hears of it again.
    for (int wait = 0; wait < 2000 && service->version() == seen; ++wait)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_NE(service->version(), seen) << one << '\n' << two;
  }
  EXPECT_GT(same, 0);
}

TEST_F(ServiceTest, ProgressNeverFallsAndEndsAtOne) {
  const auto id = submit(move_ball_slowly(scene));
  double progress = 0;
  wait_for(*service, id, [&](const auto& status) {
    EXPECT_GE(status.progress, progress);
    EXPECT_LE(status.finished_intervals.size(), std::size_t(std::max(0, status.interval)));
    progress = status.progress;
    return status.ended.has_value();
  });
  EXPECT_EQ(progress, 1);
}

TEST_F(ServiceTest, AFullDiskFailsTheEditWithAClearWordAndHarmsNothingElse) {
  wait_for_end(*service, submit(move_ball(scene)));
  const std::string before = version_bytes(*store, scene, 1);
  proto::EditRequest request = move_ball(scene, 1);
  request.params.max_image_side = 2048;  // its checkpoint holds 3 masks of half a megabyte
  std::string id;
  {
    const engine::jobs::FullDisk full(1 << 20);
    id = submit(request);
    wait_for_end(*service, id);
  }
  const auto failed = value(service->find(id));
  ASSERT_EQ(failed.state, "failed");
  EXPECT_EQ(failed.error->code, ErrorCode::no_space);
  EXPECT_NE(failed.error->message.find("interval 1"), std::string::npos) << failed.error->message;
  EXPECT_NE(failed.error->message.find("free some space"), std::string::npos) << failed.error->message;
  EXPECT_EQ(failed.error->where, "") << "folders of the server are nobody's business";
  EXPECT_EQ(failed.result_version, std::nullopt);
  EXPECT_EQ(versions(), 2u);
  EXPECT_EQ(version_bytes(*store, scene, 1), before);
  EXPECT_EQ(wait_for_end(*service, submit(move_ball(scene))).state, "succeeded") << "it works again";
}

TEST_F(ServiceTest, SpeaksOfItsTroubleWithoutNamingItsFolder) {
  const auto id = submit(move_ball_slowly(scene));
  std::optional<engine::Error> trouble;
  {
    const engine::jobs::FullDisk full(std::filesystem::file_size(dir.path() / "edits" / "jobs.db-wal"));
    const auto deadline = std::chrono::steady_clock::now() + patience;
    while (!(trouble = service->trouble()) && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_TRUE(trouble);
  EXPECT_EQ(trouble->code, ErrorCode::no_space);
  EXPECT_EQ((trouble->message + trouble->where).find(dir.path().string()), std::string::npos) << trouble->where;
  wait_for_end(*service, id);
}

TEST_F(ServiceTest, WarnsOfFieldsWithoutEffect) {
  proto::EditRequest request = move_ball(scene);
  request.prompt = "a ball";
  const auto accepted = value(service->submit(request, ""));
  ASSERT_EQ(accepted.status.warnings.size(), 1u);
  EXPECT_NE(accepted.status.warnings[0].find("prompt"), std::string::npos);
  EXPECT_EQ(wait_for_end(*service, accepted.status.id).warnings, accepted.status.warnings);
  EXPECT_EQ(value(service->estimate(request)).warnings, accepted.status.warnings);
}

TEST_F(ServiceTest, APreviewIsWhatTheEditWillPublish) {
  const auto preview = value(service->preview(move_ball(scene)));
  EXPECT_EQ(preview.version, "p000001");
  EXPECT_EQ(preview.parent, 0);
  EXPECT_EQ(preview.intervals, 2);
  ASSERT_EQ(preview.handles.size(), 1u);
  EXPECT_EQ(preview.handles[0].gaussians, 200u);
  ASSERT_EQ(preview.positions.size(), 1u);
  EXPECT_NEAR(preview.positions[0][0], 0.5, 1e-5);
  const auto done = wait_for_end(*service, submit(move_ball(scene)));
  EXPECT_EQ(preview.gaussians.output, done.gaussians->output);
  EXPECT_EQ(preview.gaussians.changeable, done.gaussians->changeable);
  const auto shown = value(store->load(scene, preview.version)), made = value(store->load(scene, "1"));
  EXPECT_EQ(engine::scene::flatten(shown.cloud), engine::scene::flatten(made.cloud));
  EXPECT_EQ(versions(), 2u) << "a preview is no version of the chain";
}

TEST_F(ServiceTest, AnEstimateKnowsTheRequestAndGrowsWithIt) {
  const auto small = value(service->estimate(move_ball(scene)));
  EXPECT_EQ(small.views, 3u);
  EXPECT_EQ(small.intervals, 2);
  ASSERT_EQ(small.handles.size(), 1u);
  EXPECT_EQ(small.handles[0].gaussians, 200u);
  EXPECT_EQ(small.request.version, 0);
  EXPECT_EQ(small.request.params.rotate_sh, true);
  EXPECT_GT(small.seconds, 0);
  EXPECT_GT(small.memory_bytes, 344u * 100);
  proto::EditRequest request = move_ball(scene);
  request.params.max_image_side = 1600;
  request.params.views = 50;
  const auto large = value(service->estimate(request));
  EXPECT_GT(large.seconds, small.seconds);
  EXPECT_GT(large.memory_bytes, small.memory_bytes);
  EXPECT_TRUE(value(service->list({})).empty()) << "nothing was accepted";
}

TEST_F(ServiceTest, RefusesAnEditThatWouldTakeMoreMemoryThanOneMay) {
  const auto limit_to = [&](std::uint64_t memory_bytes) {
    service.reset();
    service = value(EditService::open(
        *store, {.folder = dir.path() / "edits", .pictured_views = 2, .memory_bytes = memory_bytes, .threads = 1}));
  };
  // As many views, and as large, as a request may ask for: to render even one to see how long it takes would be much.
  proto::EditRequest greedy = move_and_correct_ball(scene);
  greedy.params.views = 1000;
  greedy.params.max_image_side = 8192;
  limit_to(std::uint64_t{4} << 30);
  for (const auto& refused :
       {service->submit(greedy, "key").map([](const auto&) {}), service->estimate(greedy).map([](const auto&) {})}) {
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::too_large);
    EXPECT_EQ(refused.error().where, "params.max_image_side");
  }
  EXPECT_TRUE(value(service->list({})).empty());

  const proto::EditRequest modest = move_and_correct_ball(scene);
  const std::uint64_t needed = value(service->estimate(modest)).memory_bytes;
  limit_to(needed - 1);
  EXPECT_EQ(code_of(service->submit(modest, "")), ErrorCode::too_large);
  limit_to(needed);
  EXPECT_EQ(wait_for_end(*service, submit(modest, "other key")).state, "succeeded");
}

TEST_F(ServiceTest, AnEstimateCountsTheCorrection) {
  proto::EditRequest request = move_and_correct_ball(scene);
  request.params.corrector = proto::Corrector::none;
  const auto without = value(service->estimate(request));
  request.params.corrector = proto::Corrector::scene;
  const auto with = value(service->estimate(request));
  EXPECT_GT(with.memory_bytes, without.memory_bytes);
  request.params.iterations = 0;
  const auto no_use = value(service->estimate(request));
  request.params.corrector = proto::Corrector::none;
  EXPECT_EQ(no_use.memory_bytes, value(service->estimate(request)).memory_bytes) << "nothing would be corrected";
}

TEST_F(ServiceTest, CountsEditsByState) {
  wait_for_end(*service, submit(move_ball(scene)));
  const auto counts = service->counts();
  EXPECT_EQ(counts.size(), 7u);
  EXPECT_EQ(counts.at("succeeded"), 1u);
  EXPECT_EQ(counts.at("queued"), 0u);
  EXPECT_EQ(service->trouble(), std::nullopt);
}

TEST_F(ServiceTest, DrainEndsAtTheNextIntervalAndLosesNothing) {
  const auto id = submit(move_ball_for_long(scene));
  wait_for_interval(*service, id, 1);
  service->drain(10s);
  const auto paused = value(service->find(id));
  EXPECT_EQ(paused.state, "running");
  EXPECT_LT(paused.finished_intervals.size(), 20u);
  reopen();
  wait_for_interval(*service, id, paused.finished_intervals.size() + 1);
  (void)value(service->stop(id));
  EXPECT_EQ(wait_for_end(*service, id).state, "succeeded");
}

}  // namespace
}  // namespace server::edits
