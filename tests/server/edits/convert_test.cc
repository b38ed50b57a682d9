#include "server/edits/convert.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/engine/jobs/jobs_support.h"
#include "tests/proto/examples.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;

using engine::jobs::value;

constexpr proto::Preset every_preset[] = {proto::Preset::preview, proto::Preset::draft, proto::Preset::standard,
                                          proto::Preset::paper};

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

/// Equal in what a preset sets.
void expect_same(const edit::Params& a, const edit::Params& b) {
  EXPECT_EQ(a.intervals, b.intervals);
  EXPECT_EQ(a.views, b.views);
  EXPECT_EQ(a.max_image_side, b.max_image_side);
  EXPECT_EQ(a.iterations, b.iterations);
  EXPECT_EQ(a.annealing_steps, b.annealing_steps);
  EXPECT_EQ(a.strength_initial, b.strength_initial);
  EXPECT_EQ(a.strength_final, b.strength_final);
  EXPECT_EQ(a.annealing, b.annealing);
}

TEST(Convert, LeavesWhatNeitherRequestNorPresetSaysToTheEngine) {
  const auto request = to_engine(proto::parse_edit_request(proto::example("stretch_apple.json")).value());
  ASSERT_TRUE(request);
  const edit::Params defaults;
  EXPECT_EQ(request->mode, edit::Mode::extend);
  EXPECT_EQ(request->params.rotation, defaults.rotation);
  EXPECT_EQ(request->params.rotate_sh, defaults.rotate_sh);
  EXPECT_EQ(request->params.seed, defaults.seed);
}

TEST(Convert, OnlyThePaperPresetInterpolatesAsPrinted) {
  for (const auto preset : every_preset)
    EXPECT_EQ(preset_params(preset).interpolation,
              preset == proto::Preset::paper ? edit::Interpolation::paper : edit::Interpolation::rigid);
}

TEST(Convert, WhatIsSelectedOrTurnsMovesAsABodyAtOnce) {
  const auto params = [](const char* more) {
    const auto request = proto::parse_edit_request(
        std::string(R"({"handles": [{"source": [0, 0, 0], "target": [5, 0, 0], "radius": 0.1 )") + more + "}");
    EXPECT_TRUE(request) << request.error().message;
    return value(to_engine(*request)).params;
  };
  EXPECT_EQ(params("}]").interpolation, edit::Interpolation::rigid);
  EXPECT_EQ(params(R"(}], "selection": [{"sphere": {"center": [0, 0, 0], "radius": 1}}])").interpolation,
            edit::Interpolation::arap);
  EXPECT_EQ(params(R"(, "scale": 2}])").interpolation, edit::Interpolation::arap);
  EXPECT_EQ(params(R"(, "scale": 2}])").intervals, 1);
  EXPECT_EQ(params(R"(}], "attach": "held")").interpolation, edit::Interpolation::arap);
}

TEST(Convert, NoPresetIsStandard) {
  const proto::EditRequest none = proto::parse_edit_request(proto::example("stretch_apple.json")).value();
  ASSERT_EQ(none.preset, std::nullopt);
  EXPECT_EQ(preset_of(none), proto::Preset::standard);
  proto::EditRequest standard = none;
  standard.preset = proto::Preset::standard;
  expect_same(value(to_engine(none)).params, value(to_engine(standard)).params);
  EXPECT_EQ(corrector_of(none), corrector_of(standard));
}

TEST(Convert, EachPresetFillsInWhatIsNotGiven) {
  for (const auto preset : every_preset) {
    SCOPED_TRACE(proto::name_of(preset));
    proto::EditRequest asked = full_request();
    asked.preset = preset;
    asked.params = {};
    const edit::Request made = value(to_engine(asked));
    expect_same(made.params, preset_params(preset, made));
    EXPECT_TRUE(edit::validate(value(to_engine(asked))));
  }
}

TEST(Convert, WhatIsGivenCountsMoreThanAnyPreset) {
  for (const auto preset : every_preset) {
    SCOPED_TRACE(proto::name_of(preset));
    const edit::Params usual = preset_params(preset);
    proto::EditRequest asked = full_request();
    asked.preset = preset;
    asked.params = {};
    asked.params.intervals = 1 + usual.intervals % 20;
    asked.params.views = usual.views + 1;
    asked.params.max_image_side = usual.max_image_side + 1;
    asked.params.iterations = usual.iterations + 1;
    asked.params.annealing_steps = usual.annealing_steps + 1;
    asked.params.strength_initial = usual.strength_initial / 2;
    asked.params.strength_final = usual.strength_final / 2;
    asked.params.annealing = proto::Annealing::paper;
    const edit::Params params = value(to_engine(asked)).params;
    EXPECT_EQ(params.intervals, asked.params.intervals);
    EXPECT_EQ(params.views, asked.params.views);
    EXPECT_EQ(params.max_image_side, asked.params.max_image_side);
    EXPECT_EQ(params.iterations, asked.params.iterations);
    EXPECT_EQ(params.annealing_steps, asked.params.annealing_steps);
    EXPECT_EQ(params.strength_initial, asked.params.strength_initial);
    EXPECT_EQ(params.strength_final, asked.params.strength_final);
    EXPECT_EQ(params.annealing, edit::Annealing::paper);
  }
}

TEST(Convert, APreviewDeformsAndEveryOtherPresetOptimisesAtMostAsMuchAsTheNext) {
  const auto work = [](proto::Preset preset) {
    const edit::Params params = preset_params(preset);
    return params.intervals * params.annealing_steps * params.iterations;
  };
  EXPECT_EQ(preset_params(proto::Preset::preview).iterations, 0);
  EXPECT_EQ(preset_params(proto::Preset::preview).intervals, 0) << "from the length of the drag";
  EXPECT_GT(work(proto::Preset::draft), 0);
  EXPECT_LE(work(proto::Preset::draft), work(proto::Preset::standard));
  EXPECT_LE(work(proto::Preset::standard), work(proto::Preset::paper));
  // What the contract promises of the default, and the numbers of the paper.
  const edit::Params standard = preset_params(proto::Preset::standard), paper = preset_params(proto::Preset::paper);
  EXPECT_LE(work(proto::Preset::standard), 3000);
  EXPECT_LE(standard.intervals * standard.annealing_steps * standard.views, 300);
  EXPECT_EQ(paper.intervals, 5);
  EXPECT_EQ(paper.annealing_steps, 4);
  EXPECT_EQ(paper.iterations, 500);
  EXPECT_EQ(paper.views, 50);
  EXPECT_EQ(paper.strength_initial, 0.5);
  EXPECT_EQ(paper.strength_final, 0.3);
}

TEST(Convert, AnExtendTakesNoMoreIntervalsThanItsLengthAsksFor) {
  edit::Request drag;
  drag.mode = edit::Mode::extend;
  drag.handles = {{engine::DVec3(0), engine::DVec3(1, 0, 0), 0.3, 0}};
  for (const auto preset : {proto::Preset::preview, proto::Preset::draft, proto::Preset::standard})
    EXPECT_EQ(preset_params(preset, drag).intervals, 0) << proto::name_of(preset);
  EXPECT_EQ(preset_params(proto::Preset::paper, drag).intervals, 5);
}

TEST(Convert, StandardTakesOneIntervalForWhatMovesAsOnePiece) {
  edit::Request drag;
  drag.handles = {{engine::DVec3(0), engine::DVec3(1, 0, 0), 0.3, 1},
                  {engine::DVec3(5), engine::DVec3(5, 7, 5), 0.3, 2}};
  EXPECT_EQ(preset_params(proto::Preset::standard, drag).intervals, 1);
  EXPECT_EQ(preset_params(proto::Preset::paper, drag).intervals, 5);
  drag.handles[1].group = 1;
  EXPECT_EQ(preset_params(proto::Preset::standard, drag).intervals, 4);
}

TEST(Convert, WhatIsNotInterpolatedRigidlyTakesFourIntervalsInStandard) {
  proto::EditRequest asked = full_request();
  asked.preset = proto::Preset::standard;
  asked.params = {};
  EXPECT_EQ(value(to_engine(asked)).params.intervals, 1);
  asked.params.interpolation = proto::Interpolation::paper;
  EXPECT_EQ(value(to_engine(asked)).params.intervals, 4);
  asked.params.intervals = 7;
  EXPECT_EQ(value(to_engine(asked)).params.intervals, 7);
}

TEST(Convert, TheCorrectorIsTheGivenOneOrThatOfThePreset) {
  for (const auto preset : every_preset) {
    SCOPED_TRACE(proto::name_of(preset));
    proto::EditRequest asked;
    asked.preset = preset;
    const bool deforms_only = preset == proto::Preset::preview;
    EXPECT_EQ(corrector_of(asked), deforms_only ? proto::Corrector::none : proto::Corrector::scene);
    const auto corrects = [&] {
      return value(make_toolbox(asked, value(to_engine(asked)).params, nullptr)).corrector != nullptr;
    };
    EXPECT_EQ(corrects(), !deforms_only);
    for (const auto corrector : {proto::Corrector::none, proto::Corrector::scene}) {
      asked.params.corrector = corrector;
      EXPECT_TRUE(to_engine(asked));
      EXPECT_EQ(corrector_of(asked), corrector);
      EXPECT_EQ(corrects(), corrector == proto::Corrector::scene);
    }
  }
}

TEST(Convert, RefusesTheCorrectorWhoseModelIsNotThereAndNamesThoseThereAre) {
  proto::EditRequest asked = full_request();
  asked.params.corrector = proto::Corrector::sd;
  for (const auto preset : every_preset) {
    asked.preset = preset;
    const edit::Params params = value(to_engine(asked)).params;
    const auto there = available(asked, params, nullptr);
    ASSERT_FALSE(there);
    EXPECT_EQ(there.error().code, engine::ErrorCode::unsupported);
    EXPECT_EQ(there.error().where, "params.corrector");
    for (const char* name : {"no corrector \"sd\"", "available: \"scene\"", "\"none\""})
      EXPECT_NE(there.error().message.find(name), std::string::npos) << there.error().message;
    EXPECT_EQ(make_toolbox(asked, params, nullptr).error().message, there.error().message);
  }
}

TEST(Convert, RefusesALossWhoseModelIsNotThereAndABackgroundThisBuildHasNot) {
  proto::EditRequest asked = full_request();
  asked.params.perceptual = proto::Perceptual::lpips;
  const auto there = available(asked, value(to_engine(asked)).params, nullptr);
  ASSERT_FALSE(there);
  EXPECT_EQ(there.error().code, engine::ErrorCode::unsupported);
  EXPECT_EQ(there.error().where, "params.perceptual");
  asked.params.perceptual = proto::Perceptual::msssim;
  asked.params.background = proto::Background::photo;
  ASSERT_FALSE(to_engine(asked));
  EXPECT_EQ(to_engine(asked).error().where, "params.background");
}

TEST(Convert, EchoesTheRequestWithEveryUsedParameterFilledIn) {
  const auto asked = proto::parse_edit_request(proto::example("stretch_apple.json")).value();
  edit::Params used = to_engine(asked)->params;
  used.intervals = 3;
  const proto::EditRequest echoed = resolved(asked, used);
  EXPECT_EQ(echoed.handles, asked.handles);
  EXPECT_EQ(echoed.preset, proto::Preset::standard);
  EXPECT_EQ(echoed.params.intervals, 3);
  EXPECT_EQ(echoed.params.corrector, proto::Corrector::scene);
  EXPECT_EQ(echoed.params.iterations, used.iterations);
  EXPECT_EQ(echoed.params.annealing_steps, used.annealing_steps);
  EXPECT_EQ(echoed.params.strength_initial, used.strength_initial);
  EXPECT_EQ(echoed.params.strength_final, used.strength_final);
  EXPECT_EQ(echoed.params.annealing, proto::Annealing::linear);
  EXPECT_EQ(echoed.params.rotation, proto::Rotation::shortest_arc);
  EXPECT_EQ(echoed.params.seed, 0u);
  EXPECT_EQ(echoed.params.perceptual, proto::Perceptual::msssim);
  EXPECT_EQ(echoed.params.background, proto::Background::render);
  const auto again = to_engine(echoed);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->params.interpolation, used.interpolation);
}

TEST(Convert, WhatIsEchoedAsksForTheSameAgainWhateverPresetsBecome) {
  for (const auto preset : every_preset) {
    SCOPED_TRACE(proto::name_of(preset));
    proto::EditRequest asked = proto::parse_edit_request(proto::example("stretch_apple.json")).value();
    asked.preset = preset;
    edit::Params used = value(to_engine(asked)).params;
    used.intervals = 3;
    proto::EditRequest echoed = resolved(asked, used);
    EXPECT_EQ(echoed.preset, preset);
    for (const auto other : every_preset) {
      echoed.preset = other;
      expect_same(value(to_engine(echoed)).params, used);
      EXPECT_EQ(corrector_of(echoed), corrector_of(asked));
    }
  }
}

TEST(Convert, EveryEnumeratorComesBack) {
  for (const auto annealing : {proto::Annealing::linear, proto::Annealing::paper}) {
    proto::EditRequest asked = full_request();
    asked.params.annealing = annealing;
    EXPECT_EQ(resolved(asked, to_engine(asked)->params).params.annealing, annealing);
  }
  for (const auto corrector : {proto::Corrector::none, proto::Corrector::scene}) {
    proto::EditRequest asked = full_request();
    asked.params.corrector = corrector;
    EXPECT_EQ(resolved(asked, to_engine(asked)->params).params.corrector, corrector);
  }
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
  using Fields = std::vector<std::string>;
  proto::EditRequest asked = full_request();
  ASSERT_EQ(asked.params.corrector, proto::Corrector::scene);
  EXPECT_EQ(fields_without_effect(asked), Fields{});
  asked.prompt = "a ball";
  EXPECT_EQ(fields_without_effect(asked), Fields{"prompt"});
  asked.prompt = std::nullopt;
  proto::EditRequest painted = full_request();
  painted.prompt = "a ball", painted.negative_prompt = "a hat", painted.lora = "few";
  painted.params.guidance = 1, painted.params.tuning_steps = 5;
  EXPECT_EQ(fields_without_effect(painted),
            (Fields{"prompt", "negative_prompt", "lora", "params.guidance", "params.tuning_steps"}));
  painted.params.corrector = proto::Corrector::sd;
  EXPECT_EQ(fields_without_effect(painted), Fields{}) << "which reads them";
  const Fields of_strength = {"params.strength_initial", "params.strength_final", "params.annealing"};
  asked.params.corrector = proto::Corrector::none;
  EXPECT_EQ(fields_without_effect(asked), of_strength) << "nothing corrects; that was asked for";
  asked.params.corrector = std::nullopt;
  EXPECT_EQ(fields_without_effect(asked), Fields{});
  asked.preset = proto::Preset::preview;
  EXPECT_EQ(fields_without_effect(asked), of_strength) << "which has no corrector";
  asked.params.corrector = proto::Corrector::scene;
  EXPECT_EQ(fields_without_effect(asked), Fields{}) << "but can have one";
  asked.params.iterations = 0;
  Fields all = of_strength;
  all.push_back("params.corrector");
  EXPECT_EQ(fields_without_effect(asked), all) << "no optimisation would use what is corrected";
}

TEST(Convert, ParametersOfADiffusionModelAreResolvedWhereThereIsOne) {
  proto::EditRequest asked = full_request();
  const auto guidance = [&] { return resolved(asked, value(to_engine(asked)).params).params.guidance; };
  EXPECT_EQ(guidance(), std::nullopt);
  asked.params.corrector = proto::Corrector::sd;
  EXPECT_EQ(guidance(), 7.5);
  asked.params.iterations = 0;
  EXPECT_EQ(guidance(), std::nullopt) << "it would have nothing to do";
}

TEST(Convert, HealingNeedsACorrectorAndARemovalHoldsNothing) {
  using Fields = std::vector<std::string>;
  proto::EditRequest asked = full_request();
  asked.params = {};
  asked.heal.emplace();
  asked.attach = proto::Attach::held;
  EXPECT_EQ(fields_without_effect(asked), Fields{});
  asked.mode = proto::Mode::remove;
  EXPECT_EQ(fields_without_effect(asked), Fields{"attach"});
  asked.preset = proto::Preset::preview;
  EXPECT_EQ(fields_without_effect(asked), (Fields{"attach", "heal"}));
}

TEST(Convert, APresetAloneIsNeverWithoutEffect) {
  for (const auto preset : every_preset) {
    proto::EditRequest plain;
    plain.preset = preset;
    EXPECT_TRUE(fields_without_effect(plain).empty()) << proto::name_of(preset);
  }
  EXPECT_TRUE(fields_without_effect(proto::parse_edit_request(proto::example("stretch_apple.json")).value()).empty());
}

TEST(Convert, WarnsOnceOfAllFieldsThatHaveNoEffect) {
  proto::EditRequest asked;
  EXPECT_TRUE(warnings_about(asked).empty());
  asked.prompt = "a ball";
  asked.params.strength_final = 0.3;
  asked.params.iterations = 0;
  const auto warnings = warnings_about(asked);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].ends_with("without effect on this edit: prompt params.strength_final")) << warnings[0];
}

}  // namespace
}  // namespace server::edits
