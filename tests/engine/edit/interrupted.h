// Edits that a corrector repairs and that go on after an interruption.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "engine/correct/scene_corrector.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/backed.h"

namespace engine::edit {

/// Its drag, taken in two intervals: from the checkpoint of the first it comes to the same as without one.
inline void expect_same_after_an_interruption(BackedThing scene) {
  scene.request.params.intervals = 2;
  correct::SceneCorrector corrector;
  const Tools tools{.corrector = &corrector};
  std::string checkpoint;
  Observer observer;
  observer.interval_done = [&](const IntervalDone& done) {
    EXPECT_TRUE(done.state.scene.check());
    if (done.interval == 1) checkpoint = encode(done.state);
    return Result<void>{};
  };
  const auto whole = run(scene.cloud, scene.cameras, scene.request, tools, observer);
  ASSERT_TRUE(whole);
  auto state = decode(checkpoint, scene.cloud, scene.request);
  ASSERT_TRUE(state);
  const auto resumed = run(scene.cloud, scene.cameras, scene.request, tools, {}, std::move(*state));
  ASSERT_TRUE(resumed);
  EXPECT_EQ(whole->overlay, resumed->overlay);
  EXPECT_EQ(whole->report.crumbs, resumed->report.crumbs);
  EXPECT_EQ(whole->report.warnings, resumed->report.warnings);
}

}  // namespace engine::edit
