// Whole drags of whole scenes, without a look at any picture.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/paste.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// The scene as an edit by this request begins it.
inline WorkingScene begun(const scene::GaussianCloud& scene, const Request& request) {
  auto assignment = assign(scene, request);
  if (!assignment) {
    ADD_FAILURE() << assignment.error().message;
    return {};
  }
  return {scene, frame_of(request), std::move(assignment->handle)};
}

struct CarriedOut {
  std::vector<std::uint32_t> copies;  ///< All of them, ascending.
  std::vector<DVec3> positions;       ///< Of the handles, in the frame of the working scene.
};

/// A drag of so many intervals: deform, copy and paste, relocate.
inline CarriedOut carry_out(WorkingScene& working, const Request& request, int intervals) {
  CarriedOut out;
  Memory memory;
  out.positions = handle_sources(working.frame(), request);
  for (int u = 1; u <= intervals; ++u) {
    copy_and_paste(working, plan_motion(working, request, {}, out.positions, u, intervals, memory), request.mode,
                   request.params.rotate_sh);
    EXPECT_TRUE(working.check()) << u;
    relocate(working, request, out.positions);
  }
  out.copies = working.rows_of(working::Role::copy);
  return out;
}

}  // namespace engine::edit
