#include "engine/edit/parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "engine/edit/drag.h"
#include "engine/edit/edit.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/preview.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

using How = deform::Attachment::How;

void add_disc(scene::GaussianCloud& cloud, Vec3 mean) {
  const std::size_t row = cloud.size();
  cloud.resize(row + 1);
  cloud.mean.set(row, mean);
  cloud.log_scale.set(row, {-2.7f, -2.7f, -5.0f});
  cloud.rotation.set(row, {1, 0, 0, 0});
  cloud.opacity_logit[row] = 4;
}

/// A wall of Gaussians; what is right of the middle is selected, and dragged at its far end.
scene::GaussianCloud wall() {
  scene::GaussianCloud cloud;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 40; ++x) add_disc(cloud, {0.1f * float(x), 0.1f * float(y), 0});
  return cloud;
}

Request pulled(const scene::GaussianCloud& cloud, DVec3 by) {
  Request request;
  request.selected.emplace();
  for (std::uint32_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x > 1.95f) request.selected->push_back(row);
  const DVec3 end(3.9, 0.95, 0);
  request.handles = {{end, end + by, 0.1}};
  request.params.interpolation = Interpolation::arap;
  return request;
}

TEST(PartsOf, HoldWhatGrowsOutOfTheRest) {
  const auto cloud = wall();
  const Request request = pulled(cloud, {0, 0, 1});
  const Parts parts = parts_of(cloud, assign(cloud, request)->handle, request);
  ASSERT_EQ(parts.attachments.size(), 1u);
  EXPECT_EQ(parts.attachments[0].how, How::held);
  EXPECT_FALSE(parts.attachments[0].why.empty());
  EXPECT_GE(parts.rim.size(), 20u);
  for (const std::uint32_t row : parts.rim) EXPECT_LT(cloud.mean.get(row).x, 2.2f);
}

TEST(PartsOf, HoldWhatGrowsOutOfTheRestNearTheirAnchors) {
  const auto cloud = wall();
  Request request = pulled(cloud, {0, 0, 1});
  std::erase_if(*request.selected, [&](std::uint32_t row) { return cloud.mean.get(row).x > 3.05f; });
  request.handles[0].source = DVec3(2.5, 1.9, 0);
  request.handles[0].target = DVec3(2.5, 1.9, 0.4);
  const auto rims = [&] {
    std::pair<std::size_t, std::size_t> at{0, 0};
    for (const std::uint32_t row : parts_of(cloud, assign(cloud, request)->handle, request).rim)
      ++(cloud.mean.get(row).x < 2.5f ? at.first : at.second);
    return at;
  };
  const auto all = rims();
  EXPECT_GE(all.first, 20u);
  EXPECT_GE(all.second, 20u);
  request.handles.push_back({DVec3(2.0, 0.5, 0), std::nullopt, 0.15});
  const auto anchored = rims();
  EXPECT_GE(anchored.first, 12u);
  EXPECT_LE(anchored.second, 8u) << "as far from the anchor as from half of the part";
}

TEST(PartsOf, CrumbsFarAwayMakeAPartNoLonger) {
  auto cloud = wall();
  // Taken with what it is a piece of, it goes farther than it is long.
  Request request = pulled(cloud, {0, 0, 3});
  ASSERT_EQ(parts_of(cloud, assign(cloud, request)->handle, request).attachments.at(0).how, How::one_piece);
  for (const float far : {40.0f, -40.0f}) {  // two of four hundred
    request.selected->push_back(std::uint32_t(cloud.size()));
    add_disc(cloud, Vec3(far));
  }
  EXPECT_EQ(parts_of(cloud, assign(cloud, request)->handle, request).attachments.at(0).how, How::one_piece);
}

TEST(PartsOf, SayWhenAPartComesOffWhatItGrowsOutOf) {
  const auto cloud = wall();
  const auto warnings = [&](DVec3 by, Attach attach) {
    Request request = pulled(cloud, by);
    request.attach = attach;
    return warnings_of(parts_of(cloud, assign(cloud, request)->handle, request));
  };
  const auto off = warnings({0, 0, 3}, Attach::automatic);
  ASSERT_EQ(off.size(), 1u);
  EXPECT_EQ(off[0],
            "the part comes off what it grows out of, as it goes farther than a part that is held like this bends "
            "(attach \"held\" keeps it)");
  EXPECT_TRUE(warnings({0, 0, 1}, Attach::automatic).empty()) << "it bends";
  EXPECT_TRUE(warnings({0, 0, 3}, Attach::held).empty());
  EXPECT_TRUE(warnings({0, 0, 3}, Attach::free).empty()) << "as asked";
}

TEST(HandlesStopShort, SaysByHowMuchWherePartsAreHeld) {
  Request request;
  request.handles = {{DVec3(0.0), DVec3(2, 0, 0), 0.1}, {DVec3(0, 1, 0), std::nullopt, 0.1}};
  Parts parts;
  parts.attachments.push_back({0, How::held, false, true, "it is"});
  const auto at = [&](double x) {
    return handles_stop_short(request, parts, std::vector<DVec3>{{x, 0, 0}, {0.3, 1, 0}});
  };
  EXPECT_TRUE(at(2).empty());
  EXPECT_TRUE(at(1.85).empty());
  EXPECT_TRUE(at(0).empty()) << "it has lost its Gaussians";
  ASSERT_EQ(at(1.6).size(), 1u) << "nor of an anchor";
  EXPECT_EQ(at(1.6)[0], "handle 1 stops 20 % of the way short of its target, as its part is held");
  request.handles[0].rotation = DQuat(1, 0, 0, 0);
  EXPECT_TRUE(at(1.6).empty()) << "what is around it turns";
  request.handles[0].rotation.reset();
  parts.attachments[0].how = How::one_piece;
  EXPECT_TRUE(at(1.6).empty()) << "nothing holds it";
}

TEST(PartsOf, AreNoneForOtherInterpolations) {
  const auto cloud = wall();
  Request request = pulled(cloud, {0, 0, 1});
  request.params.interpolation = Interpolation::rigid;
  EXPECT_TRUE(parts_of(cloud, assign(cloud, request)->handle, request).attachments.empty());
}

TEST(Among, NumbersRowsAsASceneOfTheseAloneDoes) {
  const Parts all{.attachments = {},
                  .rim = {3, 9},
                  .continuations = {{0, 1, DVec3(1, 0, 0), {1, 4}, {0.5, 1}}},
                  .idle = {},
                  .astray = {}};
  const Parts few = among(all, std::vector<std::uint32_t>{1, 3, 4, 9});
  EXPECT_EQ(few.rim, (std::vector<std::uint32_t>{1, 3}));
  EXPECT_EQ(few.continuations[0].tile, (std::vector<std::uint32_t>{0, 2}));
}

TEST(RowsInUse, AreTheDraggedOnesAndThoseThatGoOn) {
  const std::vector<std::uint16_t> handle{0, 1, 0, 2, 0};
  EXPECT_EQ(rows_in_use(handle, {}), (std::vector<std::uint32_t>{1, 3}));
  Parts parts;
  parts.continuations.push_back({0, 1, DVec3(1, 0, 0), {0, 3}, {1, 0.5}});
  EXPECT_EQ(rows_in_use(handle, parts), (std::vector<std::uint32_t>{0, 1, 3}));
}

TEST(ElasticBody, LeavesItsRimAndComesToItsTarget) {
  const auto cloud = wall();
  const Request request = pulled(cloud, {-0.3, 0, 1});
  const auto done = run(cloud, arc_of_cameras(2, 32), request);
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_EQ(done->report.resolved.intervals, 1);
  ASSERT_EQ(done->report.parts.size(), 1u);
  EXPECT_EQ(done->report.parts[0].how, How::held);
  EXPECT_LT(glm::distance(done->report.handles[0].relocated.back(), *request.handles[0].target), 0.1);
  const Parts parts = parts_of(cloud, assign(cloud, request)->handle, request);
  ASSERT_FALSE(parts.rim.empty());
  for (const std::uint32_t row : parts.rim)
    EXPECT_FALSE(std::ranges::binary_search(done->overlay.removed, row)) << row << ": the rim stays";
}

TEST(ElasticBody, ThatGoesNowhereIsTheInput) {
  const auto cloud = wall();
  for (const int intervals : {0, 4}) {
    Request request = pulled(cloud, DVec3(0.0));
    request.params.intervals = intervals;
    request.handles[0].rotation = DQuat(2, 0, 0, 0);
    const auto done = run(cloud, arc_of_cameras(2, 32), request);
    ASSERT_TRUE(done) << done.error().message;
    EXPECT_EQ(done->overlay, scene::no_change(cloud));
  }
}

TEST(ElasticBody, TurnsAboutAHandleThatStays) {
  const auto cloud = wall();
  Request request = pulled(cloud, DVec3(0.0));
  request.handles[0].target.reset();
  request.handles[0].rotation = glm::angleAxis(0.5, DVec3(1, 0, 0));
  request.handles[0].radius = 0.4;
  const auto seen = preview({std::make_shared<const scene::GaussianCloud>(cloud), nullptr}, request);
  ASSERT_TRUE(seen) << seen.error().message;
  EXPECT_GT(seen->overlay.added(), 100u);
}

TEST(ElasticBody, PaysNoHeedToAnAnchorFarFromIt) {
  const auto cloud = wall();
  Request request = pulled(cloud, {-0.3, 0, 1});
  const auto without = preview({std::make_shared<const scene::GaussianCloud>(cloud), nullptr}, request);
  request.handles.push_back({DVec3(0.2, 0.95, 0), std::nullopt, 0.1});
  const auto with = preview({std::make_shared<const scene::GaussianCloud>(cloud), nullptr}, request);
  ASSERT_TRUE(without && with);
  EXPECT_EQ(with->overlay, without->overlay);
  ASSERT_EQ(with->warnings.size(), 1u);
  EXPECT_NE(with->warnings[0].find("handle 2 is an anchor that holds nothing"), std::string::npos);
}

TEST(ElasticBody, SaysOfAHandleThatItLiesFarFromAllThatItMoves) {
  const auto cloud = wall();
  Request request = pulled(cloud, {-0.3, 0, 1});
  const auto scene = std::make_shared<const scene::GaussianCloud>(cloud);
  const auto near = preview({scene, nullptr}, request);
  request.handles[0].source += DVec3(0, 0, 100);
  *request.handles[0].target += DVec3(0, 0, 100);
  const auto far = preview({scene, nullptr}, request);
  ASSERT_TRUE(near && far);
  EXPECT_TRUE(near->warnings.empty());
  ASSERT_EQ(far->warnings.size(), 1u);
  EXPECT_NE(far->warnings[0].find("handle 1 lies 100 from the nearest Gaussian"), std::string::npos)
      << far->warnings[0];
}

TEST(ElasticBody, TakesAsManyIntervalsAsAsked) {
  const auto cloud = wall();
  Request request = pulled(cloud, {-0.3, 0, 1});
  const auto at_once = run(cloud, arc_of_cameras(2, 32), request);
  request.params.intervals = 4;
  const auto in_four = run(cloud, arc_of_cameras(2, 32), request);
  ASSERT_TRUE(at_once && in_four);
  EXPECT_EQ(in_four->report.handles[0].relocated.size(), 4u);
  EXPECT_LT(glm::distance(in_four->report.handles[0].relocated.back(), at_once->report.handles[0].relocated.back()),
            0.1);
}

TEST(Validate, TurnsAndScalesBodiesAlone) {
  const auto cloud = wall();
  const auto where = [&](auto change) {
    Request request = pulled(cloud, {0, 0, 1});
    change(request);
    const auto valid = validate(request);
    return valid ? std::string() : valid.error().where;
  };
  EXPECT_EQ(where([](Request& r) { r.handles[0].rotation = DQuat(0, 0, 0, 0); }), "handles[0].rotation");
  EXPECT_EQ(where([](Request& r) { r.handles[0].scale = 0; }), "handles[0].scale");
  EXPECT_EQ(where([](Request& r) { r.handles[0].scale = 1e4; }), "handles[0].scale");
  const auto rigid = [](Request& r) { r.params.interpolation = Interpolation::rigid; };
  EXPECT_EQ(where([&](Request& r) { rigid(r), r.handles[0].scale = 2; }), "handles[0].scale");
  EXPECT_EQ(where([&](Request& r) { rigid(r), r.handles[0].rotation = DQuat(1, 0, 0, 0); }), "handles[0].rotation");
  EXPECT_EQ(where([&](Request& r) { rigid(r), r.attach = Attach::free; }), "attach");
  EXPECT_EQ(where([](Request& r) { r.handles[0].scale = 2; }), "");
}

}  // namespace
}  // namespace engine::edit
