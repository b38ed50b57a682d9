// An edit between two intervals, as bytes: what it takes to go on after a restart.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/soa.h"
#include "engine/core/vec.h"
#include "engine/edit/report.h"
#include "engine/edit/working_scene.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::edit {

/// The rows of M, in the frame the edit works in. Never the frozen rows: they are the input's.
struct MemberRows {
  std::vector<std::uint32_t> inputs;  ///< Rows of the input that belong to M, ascending.
  scene::GaussianCloud cloud;         ///< Those rows, then all copies in the order they were made.
  std::vector<Role> role;             ///< [M]
  deform::HandleColumn handle;        ///< [M]
  std::vector<std::uint32_t> parent;  ///< [M]
  Array3 mean_at_deform;              ///< [M]
  bool operator==(const MemberRows&) const = default;
};

/// Everything an edit has come to know by the end of an interval.
struct Checkpoint {
  int interval = 0;  ///< Finished, 1 to T.
  MemberRows members;
  std::vector<DVec3> positions;      ///< Of the handles, in the frame the edit works in.
  std::vector<scene::Camera> views;  ///< Chosen, best first.
  std::vector<scene::Mask> masks;    ///< Per view, not dilated yet.
  Report report;                     ///< So far.
};

/// Magic, version, contents, checksum. Masks are packed, one bit a pixel.
[[nodiscard]] std::string encode(const Checkpoint& checkpoint);

/// What encode() made, and nothing else: a bit that was lost is found, and no length is believed before it is checked.
///   errors  corrupt_data; unsupported: the version of another program. `where` is "checkpoint"
[[nodiscard]] Result<Checkpoint> decode(std::string_view bytes);

/// A copy of what has to be kept of the working scene, and its return into one that begin() has just set up.
[[nodiscard]] MemberRows members_of(const WorkingScene& working);
///   errors  invalid_argument: not a state of this scene. `where` is "checkpoint"
[[nodiscard]] Result<void> restore(const MemberRows& members, WorkingScene& working);

}  // namespace engine::edit
