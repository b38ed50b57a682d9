// Cameras of the wire as the engine's, and back; views by name.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "proto/camera.h"

namespace server::edits {

/// World direction that points up where a scene says nothing of it: COLMAP's habit, y down.
inline const engine::DVec3 default_up{0.0, -1.0, 0.0};

/// A camera of the wire.
///   scene_up  for one that says nothing of it
///   where     address of the camera's fields: "camera.", or "" in a query
///   errors    invalid_argument: eye and target are one point
[[nodiscard]] engine::Result<engine::scene::Camera> to_camera(const proto::Camera& given, engine::DVec3 scene_up,
                                                              const std::string& where);

/// The pinhole camera of the wire.
[[nodiscard]] proto::PinholeCamera to_proto(const engine::scene::Camera& camera);

/// not_found: no view goes by the name that was asked for.
///   some   a few of the names there are
///   count  how many there are
[[nodiscard]] engine::Error no_such_view(const std::vector<std::string>& some, std::size_t count, std::string where);

}  // namespace server::edits
