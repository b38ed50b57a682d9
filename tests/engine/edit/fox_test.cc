// The sample drags on a real capture, from file to masks.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "engine/edit/edit.h"
#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/likeness.h"
#include "tests/engine/edit/samples.h"
#include "tests/support/data.h"

namespace engine::edit {
namespace {

DVec3 point(const nlohmann::json& json) { return {json[0], json[1], json[2]}; }

Request parse(const nlohmann::json& json) {
  Request request;
  request.mode = json.at("mode") == "extend" ? Mode::extend : Mode::move;
  for (const auto& entry : json.at("handles")) {
    Handle handle{point(entry.at("source")), std::nullopt, entry.at("radius"), 0};
    if (entry.contains("target")) handle.target = point(entry.at("target"));
    request.handles.push_back(handle);
  }
  return request;
}

class Fox : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const auto folder = support::data_dir() / "fox";
    REQUIRE_SHARED(folder);
    auto scene = io::read_scene(folder / "point_cloud.ply");
    ASSERT_TRUE(scene) << scene.error().message;
    scene_ = std::move(scene->cloud);
    const auto dataset = io::read_dataset(folder);
    ASSERT_TRUE(dataset) << dataset.error().message;
    for (const io::View& view : dataset->views) cameras_.push_back(view.camera);
    request_ = parse(nlohmann::json::parse(support::read_file(folder / "drags.json")).at(GetParam()));
    request_.params.views = 8;
    request_.params.max_image_side = 320;
  }
  scene::GaussianCloud scene_;
  std::vector<scene::Camera> cameras_;
  Request request_;
};

TEST_P(Fox, ChangesWhatItMasksAndLittleElse) {
  const auto outcome = run(scene_, cameras_, request_);
  ASSERT_TRUE(outcome) << outcome.error().message;
  const Report& report = outcome->report;
  EXPECT_TRUE(report.warnings.empty());
  EXPECT_GT(report.copies, 100u);
  const scene::GaussianCloud edited = scene::flatten(scene_, outcome->overlay);
  const auto parent = survivors_of(scene_.size(), outcome->overlay);
  EXPECT_EQ(parent.size() + report.copies, edited.size());
  EXPECT_FALSE(scene::first_not_finite(edited));

  // Rows: the survivors are the input's, in order; only opacities may differ, and only in an extend.
  for (std::size_t i = 0; i < parent.size(); ++i)
    if (request_.mode == Mode::move || scene_.opacity_logit[parent[i]] == edited.opacity_logit[i]) {
      ASSERT_TRUE(same_row(edited, i, scene_, parent[i])) << i;
    }

  // Every handle has come at least half of its way.
  for (std::size_t h = 0; h < request_.handles.size(); ++h) {
    const Handle& handle = request_.handles[h];
    const DVec3 arrived = report.handles[h].relocated.back();
    RecordProperty("handle_" + std::to_string(h), std::to_string(report.handles[h].gaussians) + " Gaussians");
    if (handle.target) {
      EXPECT_LT(glm::distance(arrived, *handle.target), 0.5 * glm::distance(handle.source, *handle.target)) << h;
    } else {
      EXPECT_EQ(arrived, handle.source);
    }
  }

  // Pictures: the edit shows inside the masks, and hardly outside.
  ASSERT_EQ(outcome->views.size(), 8u);
  for (std::size_t v = 0; v < outcome->views.size(); ++v) {
    const scene::Mask& mask = outcome->masks[v];
    EXPECT_GT(report.views[v].mask_area, 0.005) << v;
    EXPECT_LT(report.views[v].mask_area, 0.6) << v;
    const scene::Image before = render::forward(scene_, outcome->views[v]).color;
    const scene::Image after = render::forward(edited, outcome->views[v]).color;
    const double inside = psnr_where(before, after, mask, 1), outside = psnr_where(before, after, mask, 0);
    EXPECT_GT(outside, 25) << outcome->views[v].name;
    EXPECT_GT(outside, inside + 6) << outcome->views[v].name;
  }
}

TEST_P(Fox, AZeroDragGivesBackTheInputByteForByte) {
  for (Handle& handle : request_.handles)
    if (handle.target) handle.target = handle.source;
  const auto outcome = run(scene_, cameras_, request_);
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->overlay, scene::no_change(scene_));
}

TEST_P(Fox, OptimisedItLeavesPixelsOutsideTheMasksAsTheyWere) {
  request_.params.iterations = 150;
  const auto outcome = run(scene_, cameras_, request_);
  ASSERT_TRUE(outcome) << outcome.error().message;
  const scene::GaussianCloud edited = scene::flatten(scene_, outcome->overlay);
  double least_psnr = 1000, least_ssim = 1;
  for (std::size_t v = 0; v < outcome->views.size(); ++v) {
    const scene::Image before = render::forward(scene_, outcome->views[v]).color;
    const scene::Image after = render::forward(edited, outcome->views[v]).color;
    const scene::Mask& mask = outcome->masks[v];
    least_psnr = std::min(least_psnr, psnr_where(before, after, mask, 0));
    least_ssim = std::min(least_ssim, ssim_outside(before, after, mask));
    EXPECT_LT(psnr_where(before, after, mask, 1), 35) << "the edit shows: " << outcome->views[v].name;
  }
  RecordProperty("outside_db", std::to_string(least_psnr));
  RecordProperty("outside_ssim", std::to_string(least_ssim));
  EXPECT_GE(least_psnr, 50);
  EXPECT_GE(least_ssim, 0.999);
}

TEST_P(Fox, AZeroDragThatIsOptimisedByForceLooksLikeTheInput) {
  for (Handle& handle : request_.handles)
    if (handle.target) handle.target = handle.source;
  request_.params.optimise_unmoved = true;
  request_.params.iterations = 100;
  const auto outcome = run(scene_, cameras_, request_);
  ASSERT_TRUE(outcome) << outcome.error().message;
  ASSERT_EQ(outcome->views.size(), 8u);
  const scene::GaussianCloud after = scene::flatten(scene_, outcome->overlay);
  double least = 1000;
  for (std::size_t v = 0; v < outcome->views.size(); ++v)
    least = std::min(least, psnr_where(render::forward(scene_, outcome->views[v]).color,
                                       render::forward(after, outcome->views[v]).color, outcome->masks[v], 1));
  RecordProperty("inside_db", std::to_string(least));
  EXPECT_GT(least, 55);
}

INSTANTIATE_TEST_SUITE_P(Drags, Fox, testing::Values("ear_up", "snout_out"));

}  // namespace
}  // namespace engine::edit
