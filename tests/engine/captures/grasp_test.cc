#include "engine/captures/grasp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "engine/captures/looking.h"
#include "engine/core/rng.h"
#include "tests/engine/captures/samples.h"

namespace engine::captures {
namespace {

/// Gaussians at x = -1, -0.9, ..., 1.
scene::GaussianCloud line() {
  scene::GaussianCloud cloud;
  cloud.resize(21);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean.set(i, {-1 + 0.1f * float(i), 0, 0});
    cloud.rotation.set(i, {1, 0, 0, 0});
  }
  return cloud;
}

CapturedCase with_handles(std::vector<edit::Handle> handles) {
  CapturedCase out;
  out.cameras = sample_cameras(1);  // looks along z: the picture's right is x
  out.handles = std::move(handles);
  return out;
}

TEST(GraspByBalls, TakesWhatIsInABall) {
  const auto grasp = grasp_by_balls(with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.25, 0}}), line());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->rows, (std::vector<std::uint32_t>{8, 9, 10, 11, 12}));
  EXPECT_EQ(grasp->request.handles.size(), 1u);
}

TEST(GraspByBalls, DoesNotCountWhatAnAnchorHolds) {
  const auto grasp = grasp_by_balls(
      with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.25, 0}, {{0.3, 0, 0}, std::nullopt, 0.25, 0}}), line());
  ASSERT_TRUE(grasp);
  EXPECT_EQ(grasp->rows, (std::vector<std::uint32_t>{8, 9, 10, 11}));
}

TEST(GraspByBalls, StaysInTheRegion) {
  CapturedCase the_case = with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.25, 0}});
  the_case.region = edit::Region{{-0.5, 0, 0}, {1.1, 1, 1}};
  the_case.mode = edit::Mode::extend;
  const auto grasp = grasp_by_balls(the_case, line());
  ASSERT_TRUE(grasp);
  EXPECT_EQ(grasp->rows, (std::vector<std::uint32_t>{8, 9, 10}));
  EXPECT_TRUE(grasp->request.region);
  EXPECT_EQ(grasp->request.mode, edit::Mode::extend);
}

TEST(GraspByBalls, CarelesslyMissesAboutHalfAndTakesWhatIsBeside) {
  CapturedCase the_case = with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.25, 0}});
  const auto careful = grasp_by_balls(the_case, line());
  the_case.careless = Carelessness{};
  const auto careless = grasp_by_balls(the_case, line());
  ASSERT_TRUE(careful && careless);
  const auto is_chosen = [&](std::uint32_t row) { return std::ranges::count(careless->rows, row) > 0; };
  const auto kept = std::ranges::count_if(careful->rows, is_chosen);
  EXPECT_GT(kept, 1);
  EXPECT_LT(kept, 4);
  EXPECT_GT(careless->rows.size(), std::size_t(kept)) << "things beside it, too";
  const edit::Handle& handle = careless->request.handles[0];
  EXPECT_LT(glm::distance(*handle.target - handle.source, DVec3(0, 1, 0)), 1e-12) << "the way is as long as before";
}

TEST(GraspByBalls, SaysWhichBallIsEmpty) {
  const auto grasp = grasp_by_balls(with_handles({{{5, 0, 0}, DVec3(0, 1, 0), 0.25, 0}}), line());
  ASSERT_FALSE(grasp);
  EXPECT_EQ(grasp.error().where, "handles[0].radius");
}

TEST(GraspByBareBalls, ChoosesTheSizeThatMatchesWhatMovesBest) {
  CapturedCase the_case = with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.9, 0}, {{0.8, 0, 0}, std::nullopt, 0.05, 0}});
  the_case.region = edit::Region{{0, 0, 0}, {0.1, 1, 1}};
  the_case.moving = MovingPart(line(), std::vector<std::uint32_t>{7, 8, 9, 10, 11, 12, 13});
  const auto grasp = grasp_by_bare_balls(the_case, line());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->by, "bare");
  EXPECT_EQ(grasp->rows, (std::vector<std::uint32_t>{7, 8, 9, 10, 11, 12, 13}));
  EXPECT_FALSE(grasp->request.region);
  EXPECT_LT(grasp->request.handles[0].radius, 0.4);
  EXPECT_EQ(grasp->request.handles[1].radius, 0.05) << "anchors hold what they held";
}

TEST(GraspByBareBalls, CarelesslyThoseBallsAreOffCentreAndTooLarge) {
  CapturedCase the_case = with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.9, 0}});
  the_case.moving = MovingPart(line(), std::vector<std::uint32_t>{8, 9, 10, 11, 12});
  const auto careful = grasp_by_bare_balls(the_case, line());
  the_case.careless = Carelessness{};
  const auto careless = grasp_by_bare_balls(the_case, line());
  ASSERT_TRUE(careful && careless);
  EXPECT_GT(careless->request.handles[0].radius, careful->request.handles[0].radius);
  EXPECT_GT(careless->request.handles[0].source.x, 0.1);
}

TEST(GraspByBareBalls, SaysWhichBallIsEmptyAtAnySize) {
  const auto grasp = grasp_by_bare_balls(with_handles({{{5, 0, 0}, DVec3(0, 1, 0), 0.25, 0}}), line());
  ASSERT_FALSE(grasp);
  EXPECT_EQ(grasp.error().where, "handles[0].radius");
}

/// Two dense balls of Gaussians, of another colour each, that do not touch: the first 300 rows, the others.
scene::GaussianCloud two_balls() {
  scene::GaussianCloud cloud;
  cloud.resize(600);
  Rng rng(5);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    Vec3 at;
    do at = {rng.uniform(-0.3f, 0.3f), rng.uniform(-0.3f, 0.3f), rng.uniform(-0.3f, 0.3f)};
    while (glm::length(at) > 0.3f);
    cloud.mean.set(i, at + Vec3(i < 300 ? 0.0f : 1.5f, 0, 0));
    cloud.rotation.set(i, {1, 0, 0, 0});
    cloud.log_scale.set(i, Vec3(-3.5f));
    cloud.opacity_logit[i] = 4;
    for (std::size_t c = 0; c < 3; ++c) cloud.sh_row(i)[c] = (c == 0) == (i < 300) ? 1.0f : -1.0f;
  }
  return cloud;
}

CapturedCase with_clicks() {
  CapturedCase out = with_handles({{{0, 0, 0}, DVec3(0, 1, 0), 0.05, 0}, {{1.5, 0, 0}, std::nullopt, 0.3, 0}});
  out.clicks = {{{0, 0, 0.1}}, {{1.5, 0, 0.1}}};
  return out;
}

std::vector<std::uint32_t> rows_below(std::uint32_t end) {
  std::vector<std::uint32_t> rows(end);
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

TEST(GraspByClicks, TakesTheThingThatWasClickedAtWhateverTheRadiusOfItsHandle) {
  const auto grasp = grasp_by_clicks(with_clicks(), two_balls());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->by, "clicks");
  ASSERT_EQ(grasp->rows.size(), 300u);
  EXPECT_EQ(grasp->rows.back(), 299u);
  EXPECT_EQ(grasp->request.selected, grasp->rows);
}

TEST(GraspByClicks, CountsWhatIsSelectedNextToAnAnchorToo) {
  CapturedCase the_case = with_clicks();
  the_case.handles.push_back({{0.2, 0, 0}, std::nullopt, 0.1, 0});
  const auto grasp = grasp_by_clicks(the_case, two_balls());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->rows.size(), 300u);
}

TEST(GraspByClicks, CarelesslyMissesAboutHalf) {
  CapturedCase the_case = with_clicks();
  the_case.careless = Carelessness{};
  const auto grasp = grasp_by_clicks(the_case, two_balls());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_GT(grasp->rows.size(), 100u);
  EXPECT_LT(grasp->rows.size(), 200u);
}

TEST(GraspByClicks, ClicksThatSayNothingAreAnError) {
  CapturedCase the_case = with_clicks();
  the_case.clicks.inside.clear();
  EXPECT_FALSE(grasp_by_clicks(the_case, two_balls()));
}

TEST(GraspByAClick, TakesTheWholeOfWhatWasClickedAtAlone) {
  CapturedCase the_case = with_clicks();
  the_case.clicks.outside.clear();  // not needed
  the_case.moving = MovingPart(two_balls(), rows_below(300));
  const auto grasp = grasp_by_a_click(the_case, two_balls());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->by, "click");
  EXPECT_EQ(grasp->rows, rows_below(300));
}

TEST(GraspByAClick, AsksForMoreOrLessUntilItIsWhatIsMeant) {
  // A strip of three colours: what the click is on, or all of it.
  scene::GaussianCloud strip;
  strip.resize(1800);
  for (std::size_t i = 0; i < strip.size(); ++i) {
    const std::size_t column = i / 15, place = i % 15;
    strip.mean.set(i, 0.02f * Vec3(float(column), float(place), 0));
    strip.rotation.set(i, {1, 0, 0, 0});
    strip.log_scale.set(i, Vec3(-4.2f));
    strip.opacity_logit[i] = 4;
    strip.sh_row(i)[i / 600] = 1;
  }
  CapturedCase the_case = with_handles({{{0.1, 0.1, 0}, DVec3(0, 1, 0), 0.05, 0}});
  the_case.clicks = {{{0.1, 0.1, 0}}, {}};
  for (const std::uint32_t meant : {600u, 1800u}) {
    SCOPED_TRACE(meant);
    the_case.moving = MovingPart(strip, rows_below(meant));
    const auto grasp = grasp_by_a_click(the_case, strip);
    ASSERT_TRUE(grasp) << grasp.error().message;
    EXPECT_NEAR(double(grasp->rows.size()), meant, 60) << "but for a column or two";
  }
}

TEST(GraspByAClick, OneThatIsNotThereIsAnError) {
  CapturedCase the_case = with_clicks();
  the_case.clicks.inside.clear();
  EXPECT_FALSE(grasp_by_a_click(the_case, two_balls()));
}

/// The first ball is what moves.
CapturedCase seen_by_cameras() {
  CapturedCase out = with_clicks();
  out.clicks = {};  // not needed
  out.cameras = sample_cameras(11);
  out.before = two_balls();
  std::vector<std::uint32_t> part(300);
  std::iota(part.begin(), part.end(), 0u);
  out.moving = MovingPart(out.before, part);
  return out;
}

TEST(GraspByLooking, FindsTheThingByItself) {
  const auto grasp = grasp_by_looking(seen_by_cameras(), two_balls());
  ASSERT_TRUE(grasp) << grasp.error().message;
  EXPECT_EQ(grasp->by, "looking");
  EXPECT_EQ(grasp->rows.size(), 300u);
  EXPECT_EQ(grasp->rows.back(), 299u);
}

TEST(GraspByLooking, ClicksAtMostSixTimesAndTheSameEachTime) {
  const CapturedCase the_case = seen_by_cameras();
  scene::GaussianCloud one_color = two_balls();
  for (std::size_t i = 300; i < one_color.size(); ++i) {  // the other ball touches this one and has its colour
    one_color.mean.x[i] -= 0.95f;
    for (std::size_t c = 0; c < 3; ++c) one_color.sh_row(i)[c] = one_color.sh_row(0)[c];
  }
  for (const WhenWorse when_worse : {WhenWorse::undone, WhenWorse::corrected}) {
    const auto clicks = clicks_of_a_looking_person(the_case, one_color, when_worse);
    ASSERT_TRUE(clicks) << clicks.error().message;
    EXPECT_LE(clicks->inside.size() + clicks->outside.size(), std::size_t(most_clicks));
    const auto again = clicks_of_a_looking_person(the_case, one_color, when_worse);
    EXPECT_EQ(again->inside, clicks->inside);
    EXPECT_EQ(again->outside, clicks->outside);
  }
}

TEST(GraspByCorrecting, AClickThatTookTooMuchIsCorrectedByOneThatSaysWhatItIsNot) {
  const scene::GaussianCloud balls = two_balls();
  CapturedCase the_case = seen_by_cameras();
  std::vector<std::uint32_t> part = rows_below(300);  // and a slice of the other ball, smaller than the rest of it
  for (std::uint32_t row = 300; row < balls.size(); ++row)
    if (balls.mean.x[row] < 1.45f) part.push_back(row);
  the_case.moving = MovingPart(balls, part);
  const auto undone = grasp_by_looking(the_case, balls), corrected = grasp_by_correcting(the_case, balls);
  ASSERT_TRUE(undone && corrected);
  EXPECT_EQ(corrected->by, "correcting");
  EXPECT_EQ(undone->rows, rows_below(300)) << "all of the other ball is worse than none";
  EXPECT_GT(corrected->rows.size(), 300 + (part.size() - 300) / 2);
  EXPECT_LT(corrected->rows.size(), 500u);
}

TEST(GraspByLooking, NothingToBeSeenIsAnError) {
  CapturedCase the_case = seen_by_cameras();
  the_case.moving = {};
  EXPECT_FALSE(grasp_by_looking(the_case, two_balls()));
}

}  // namespace
}  // namespace engine::captures
