#include "server/edits/convert.h"

#include <gtest/gtest.h>

#include "tests/proto/examples.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;

proto::EditRequest full_request() { return proto::parse_edit_request(proto::example("move_ball.json")).value(); }

TEST(Convert, CarriesEveryFieldTheEngineKnows) {
  proto::EditRequest asked = full_request();
  asked.params.rotation = proto::Rotation::paper;
  asked.params.rotate_sh = false;
  asked.handles.push_back({.source = {1, 2, 3}, .target = {}, .radius = 4, .group = 5});
  const auto request = to_engine(asked);
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->mode, edit::Mode::move);
  ASSERT_EQ(request->handles.size(), 2u);
  EXPECT_EQ(request->handles[0].source, engine::DVec3(-0.28, -0.21, -0.62));
  EXPECT_EQ(request->handles[0].target, engine::DVec3(0.52, -0.21, -0.70));
  EXPECT_EQ(request->handles[1].target, std::nullopt);
  EXPECT_EQ(request->handles[1].radius, 4);
  EXPECT_EQ(request->handles[1].group, 5);
  ASSERT_TRUE(request->region);
  EXPECT_EQ(request->region->center, engine::DVec3(0.0, -0.4, -0.6));
  EXPECT_EQ(request->region->size, engine::DVec3(2.4, 1.0, 1.2));
  EXPECT_EQ(request->params.intervals, 4);
  EXPECT_EQ(request->params.views, 30);
  EXPECT_EQ(request->params.exclude_views, std::vector<std::string>{"view_03.png"});
  EXPECT_EQ(request->params.max_image_side, 512);
  EXPECT_EQ(request->params.rotation, edit::Rotation::paper);
  EXPECT_EQ(request->params.interpolation, edit::Interpolation::smooth);
  EXPECT_FALSE(request->params.rotate_sh);
  EXPECT_EQ(request->params.seed, 7u);
  EXPECT_TRUE(edit::validate(*request));
}

TEST(Convert, LeavesWhatIsNotGivenToTheEngine) {
  const auto request = to_engine(proto::parse_edit_request(proto::example("stretch_apple.json")).value());
  ASSERT_TRUE(request);
  const edit::Params defaults;
  EXPECT_EQ(request->mode, edit::Mode::extend);
  EXPECT_EQ(request->params.intervals, defaults.intervals);
  EXPECT_EQ(request->params.views, defaults.views);
  EXPECT_EQ(request->params.rotation, defaults.rotation);
  EXPECT_EQ(request->params.interpolation, defaults.interpolation);
  EXPECT_EQ(request->params.rotate_sh, defaults.rotate_sh);
}

TEST(Convert, FillsInThePaperPresetWhereNothingIsGiven) {
  proto::EditRequest asked = full_request();
  ASSERT_EQ(asked.preset, proto::Preset::paper);
  EXPECT_EQ(to_engine(asked)->params.intervals, 4) << "given, so the preset does not count";
  asked.params = {};
  EXPECT_EQ(to_engine(asked)->params.intervals, 5);
  EXPECT_EQ(to_engine(asked)->params.views, 50);
  asked.preset = proto::Preset::preview;
  EXPECT_EQ(to_engine(asked)->params.intervals, 0) << "from the length of the drag";
}

TEST(Convert, RefusesACorrectorThisBuildHasNotAndNamesTheOneItHas) {
  for (const auto corrector : {proto::Corrector::scene, proto::Corrector::sd}) {
    proto::EditRequest asked = full_request();
    asked.params.corrector = corrector;
    const auto request = to_engine(asked);
    ASSERT_FALSE(request);
    EXPECT_EQ(request.error().code, engine::ErrorCode::unsupported);
    EXPECT_EQ(request.error().where, "params.corrector");
    EXPECT_NE(request.error().message.find("\"none\""), std::string::npos) << request.error().message;
  }
}

TEST(Convert, RefusesALossOrABackgroundThisBuildHasNot) {
  proto::EditRequest asked = full_request();
  asked.params.perceptual = proto::Perceptual::lpips;
  ASSERT_FALSE(to_engine(asked));
  EXPECT_EQ(to_engine(asked).error().code, engine::ErrorCode::unsupported);
  EXPECT_EQ(to_engine(asked).error().where, "params.perceptual");
  asked.params.perceptual = proto::Perceptual::msssim;
  asked.params.background = proto::Background::photo;
  ASSERT_FALSE(to_engine(asked));
  EXPECT_EQ(to_engine(asked).error().where, "params.background");
}

TEST(Convert, HandsTheParametersOfTheOptimisationOn) {
  proto::EditRequest asked;
  EXPECT_EQ(to_engine(asked)->params.iterations, 0);
  asked.params.iterations = 70, asked.params.annealing_steps = 3;
  EXPECT_EQ(to_engine(asked)->params.iterations, 70);
  EXPECT_EQ(to_engine(asked)->params.annealing_steps, 3);
}

TEST(Convert, EchoesTheRequestWithEveryUsedParameterFilledIn) {
  const auto asked = proto::parse_edit_request(proto::example("stretch_apple.json")).value();
  edit::Params used = to_engine(asked)->params;
  used.intervals = 3;
  const proto::EditRequest echoed = resolved(asked, used);
  EXPECT_EQ(echoed.handles, asked.handles);
  EXPECT_EQ(echoed.params.intervals, 3);
  EXPECT_EQ(echoed.params.corrector, proto::Corrector::none);
  EXPECT_EQ(echoed.params.rotation, proto::Rotation::shortest_arc);
  EXPECT_EQ(echoed.params.seed, 0u);
  EXPECT_EQ(echoed.params.iterations, 0) << "nothing was optimised";
  EXPECT_EQ(echoed.params.perceptual, proto::Perceptual::msssim);
  EXPECT_EQ(echoed.params.background, proto::Background::render);
  const auto again = to_engine(echoed);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->params.interpolation, used.interpolation);
}

TEST(Convert, EveryEnumeratorComesBack) {
  for (const auto rotation : {proto::Rotation::shortest_arc, proto::Rotation::paper, proto::Rotation::none}) {
    proto::EditRequest asked = full_request();
    asked.params.rotation = rotation;
    EXPECT_EQ(resolved(asked, to_engine(asked)->params).params.rotation, rotation);
  }
  for (const auto interpolation :
       {proto::Interpolation::paper, proto::Interpolation::smooth, proto::Interpolation::rigid}) {
    proto::EditRequest asked = full_request();
    asked.params.interpolation = interpolation;
    EXPECT_EQ(resolved(asked, to_engine(asked)->params).params.interpolation, interpolation);
  }
}

TEST(Convert, ListsFieldsThatHaveNoEffect) {
  proto::EditRequest asked = full_request();
  asked.prompt = "a ball";
  EXPECT_EQ(fields_without_effect(asked), (std::vector<std::string>{"prompt", "params.strength_initial",
                                                                    "params.strength_final", "params.annealing"}));
  for (const auto preset : {proto::Preset::draft, proto::Preset::standard}) {
    proto::EditRequest plain;
    plain.preset = preset;
    EXPECT_EQ(fields_without_effect(plain), std::vector<std::string>{"preset"});
  }
  EXPECT_TRUE(fields_without_effect(proto::parse_edit_request(proto::example("stretch_apple.json")).value()).empty());
}

TEST(Convert, WarnsOnceOfAllFieldsThatHaveNoEffect) {
  proto::EditRequest asked;
  EXPECT_TRUE(warnings_about(asked).empty());
  asked.prompt = "a ball";
  asked.params.strength_final = 0.3;
  const auto warnings = warnings_about(asked);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].ends_with("without effect: prompt params.strength_final")) << warnings[0];
}

}  // namespace
}  // namespace server::edits
