// A selected part that is drawn out of what it grows out of (mode extend, Interpolation::arap).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/edit/checkpoint.h"
#include "engine/edit/drag.h"
#include "engine/edit/edit.h"
#include "engine/edit/preview.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

using How = deform::Attachment::How;

constexpr int columns = 60, rows = 8;
constexpr float spacing = 0.1f;

/// A strip of Gaussians along x, in colours that change along it: coefficients of SH band 0, red.
template <class Color>
scene::GaussianCloud strip(Color&& color) {
  scene::GaussianCloud cloud;
  for (int x = 0; x < columns; ++x)
    for (int y = 0; y < rows; ++y) {
      const std::size_t row = cloud.size();
      cloud.resize(row + 1);
      const float at = spacing * float(x);
      cloud.mean.set(row, {at, spacing * (float(y) - 0.5f * float(rows - 1)), 0});
      cloud.log_scale.set(row, {-2.7f, -2.7f, -5.0f});
      cloud.rotation.set(row, {1, 0, 0, 0});
      cloud.opacity_logit[row] = 4;
      cloud.sh_row(row)[0] = color(x);
    }
  return cloud;
}

scene::GaussianCloud striped() {
  return strip([](int x) { return x / 3 % 2 == 0 ? 1.0f : -1.0f; });
}
scene::GaussianCloud shaded() {
  return strip([](int x) { return 0.05f * float(x) - 1.5f; });
}

/// What is right of x = 4 drawn out at its end.
Request drawn_out(const scene::GaussianCloud& cloud, DVec3 by = {1.3, 0, 0}) {
  Request request;
  request.mode = Mode::extend;
  request.selected.emplace();
  for (std::uint32_t row = 0; row < cloud.size(); ++row)
    if (cloud.mean.get(row).x > 3.95f) request.selected->push_back(row);
  const DVec3 end(5.9, 0.05, 0);
  request.handles = {{end, end + by, 0.1}};
  request.params.interpolation = Interpolation::arap;
  request.params.iterations = 0;
  request.params.max_image_side = 32;
  return request;
}

scene::LayeredCloud plain(const scene::GaussianCloud& cloud) {
  return {std::make_shared<const scene::GaussianCloud>(cloud), nullptr};
}

Outcome carried_out(const scene::GaussianCloud& cloud, const Request& request, const Observer& observer = {},
                    std::optional<State> from = {}) {
  auto done = run(cloud, arc_of_cameras(2, 32, DVec3(4, 0, 0)), request, {}, observer, std::move(from));
  if (done) return std::move(*done);
  ADD_FAILURE() << done.error().message;
  return {};
}

TEST(DrawnOut, WhatRepeatsGoesOn) {
  const auto cloud = striped();
  const Outcome done = carried_out(cloud, drawn_out(cloud));
  ASSERT_EQ(done.report.parts.size(), 1u);
  EXPECT_EQ(done.report.parts[0].how, How::continued);
  const scene::GaussianCloud after = scene::flatten(cloud, done.overlay);
  // As dense as before, all the way, and no farther.
  for (float x = 0; x < 5.9f + 1.3f; x += spacing) {
    std::size_t near = 0;
    for (std::size_t row = 0; row < after.size(); ++row) near += std::abs(after.mean.get(row).x - x) < spacing;
    EXPECT_GE(near, std::size_t(rows)) << x;
    EXPECT_LE(near, std::size_t(3 * rows)) << x;
  }
  for (std::size_t row = 0; row < after.size(); ++row) {
    EXPECT_LE(after.mean.get(row).x, 5.9f + 1.3f + 1e-5f);
    EXPECT_EQ(after.opacity_logit[row], 4) << "nothing is left half transparent";
    EXPECT_EQ(after.log_scale.get(row), cloud.log_scale.get(0)) << "nothing is stretched";
  }
}

TEST(DrawnOut, WhatChangesAllAlongIsStretched) {
  const auto cloud = shaded();
  const Outcome done = carried_out(cloud, drawn_out(cloud));
  ASSERT_EQ(done.report.parts.size(), 1u);
  EXPECT_EQ(done.report.parts[0].how, How::drawn_out);
  EXPECT_EQ(done.report.output_gaussians, cloud.size());
  const scene::GaussianCloud after = scene::flatten(cloud, done.overlay);
  float longest = 0, farthest = 0;
  for (std::size_t row = 0; row < after.size(); ++row) {
    EXPECT_EQ(after.opacity_logit[row], 4) << "nothing is left half transparent";
    longest = std::max(longest, after.log_scale.get(row).x);
    farthest = std::max(farthest, after.mean.get(row).x);
  }
  EXPECT_GT(longest, -2.7f + 0.3f);
  EXPECT_NEAR(farthest, 5.9f + 1.3f, 0.05f);
}

TEST(DrawnOut, AsTheRequestAsks) {
  const auto cloud = striped();
  const auto how = [&](Attach attach, DVec3 by) {
    Request request = drawn_out(cloud, by);
    request.attach = attach;
    return carried_out(cloud, request).report.parts.at(0).how;
  };
  EXPECT_EQ(how(Attach::held, {1.3, 0, 0}), How::drawn_out);
  EXPECT_EQ(how(Attach::free, {1.3, 0, 0}), How::one_piece);
  EXPECT_EQ(how(Attach::automatic, {0, 0, 1}), How::drawn_out) << "not the way it repeats";
  EXPECT_EQ(how(Attach::automatic, {500, 0, 0}), How::drawn_out) << "hundreds of pieces";
}

TEST(DrawnOut, ThatGoesNowhereIsTheInput) {
  const auto cloud = striped();
  EXPECT_EQ(carried_out(cloud, drawn_out(cloud, DVec3(0.0))).overlay, scene::no_change(cloud));
}

TEST(DrawnOut, APreviewIsTheEdit) {
  for (const auto& cloud : {striped(), shaded()})
    for (const int intervals : {0, 3}) {
      Request request = drawn_out(cloud);
      request.params.intervals = intervals;
      const auto seen = preview(plain(cloud), request);
      ASSERT_TRUE(seen) << seen.error().message;
      EXPECT_EQ(seen->overlay, carried_out(cloud, request).overlay);
    }
}

TEST(DrawnOut, InSeveralIntervalsGoesOnAsFarAsAtOnce) {
  const auto cloud = striped();
  Request request = drawn_out(cloud);
  const auto at_once = preview(plain(cloud), request);
  request.params.intervals = 4;
  const auto in_four = preview(plain(cloud), request);
  ASSERT_TRUE(at_once && in_four);
  const auto sorted_means = [](const scene::GaussianCloud& of) {
    std::vector<std::pair<float, float>> means;
    for (std::size_t row = 0; row < of.size(); ++row) means.emplace_back(of.mean.get(row).x, of.mean.get(row).y);
    std::sort(means.begin(), means.end());
    return means;
  };
  const auto one = sorted_means(at_once->overlay.rows), four = sorted_means(in_four->overlay.rows);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_NEAR(one[k].first, four[k].first, 1e-4) << k;
}

TEST(DrawnOut, ResumesToTheSameBytes) {
  const auto cloud = striped();
  Request request = drawn_out(cloud);
  request.params.intervals = 3;
  request.params.iterations = 6;
  std::map<int, std::string> checkpoints;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_TRUE(done.state.scene.check()) << done.interval;
    EXPECT_FALSE(done.state.scene.rows_of(working::Role::continued).empty()) << done.interval;
    checkpoints[done.interval] = encode(done.state);
    return Result<void>{};
  };
  const Outcome whole = carried_out(cloud, request, observer);
  for (const int u : {1, 2}) {
    auto state = decode(checkpoints.at(u), cloud, request);
    ASSERT_TRUE(state) << state.error().message;
    EXPECT_EQ(carried_out(cloud, request, {}, std::move(*state)).overlay, whole.overlay) << u;
  }
}

}  // namespace
}  // namespace engine::edit
