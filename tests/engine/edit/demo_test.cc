// Optimised drags of the demo scene.
#include <gtest/gtest.h>

#include "engine/edit/edit.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "tests/engine/edit/likeness.h"

namespace engine::edit {
namespace {

TEST(Demo, OptimisedADragLeavesPixelsOutsideTheMasksAsTheyWere) {
  procedural::DemoOptions options;
  options.gaussians = 60'000;
  options.views = 8, options.width = 320, options.height = 240;
  const procedural::DemoScene demo = procedural::make_demo_scene(options);
  for (const procedural::SuggestedDrag& drag : demo.drags) {
    Request request;
    request.mode = drag.mode == "extend" ? Mode::extend : Mode::move;
    for (const auto& handle : drag.handles) request.handles.push_back({handle.source, handle.target, handle.radius, 0});
    request.params.iterations = 60;
    const auto outcome = run(demo.cloud, demo.cameras, request);
    ASSERT_TRUE(outcome) << outcome.error().message;
    ASSERT_FALSE(outcome->views.empty());
    const scene::GaussianCloud edited = scene::flatten(demo.cloud, outcome->overlay);
    for (std::size_t v = 0; v < outcome->views.size(); ++v) {
      const scene::Image before = render::forward(demo.cloud, outcome->views[v]).color;
      const scene::Image after = render::forward(edited, outcome->views[v]).color;
      EXPECT_GE(psnr_where(before, after, outcome->masks[v], 0), 50) << drag.name << " " << v;
      EXPECT_GE(ssim_outside(before, after, outcome->masks[v]), 0.999) << drag.name << " " << v;
      EXPECT_LT(psnr_where(before, after, outcome->masks[v], 1), 40) << drag.name << " " << v << ": the edit shows";
    }
  }
}

}  // namespace
}  // namespace engine::edit
