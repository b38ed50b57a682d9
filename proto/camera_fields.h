// Cameras read out of a JSON document. For the .cc files of this room.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "proto/camera.h"
#include "proto/json_fields.h"

namespace proto {

/// A camera in one of its two forms: the one that has `eye` or `target`, or the one that has a pose.
[[nodiscard]] Camera read_camera(const JsonField& field);

/// Exactly one of `camera` and `view` among the members of `object`.
[[nodiscard]] Viewpoint read_viewpoint(const JsonField& object, const Members& members);

/// The reverse of read_camera().
[[nodiscard]] nlohmann::ordered_json encode(const Camera& camera);
[[nodiscard]] nlohmann::ordered_json encode(const PinholeCamera& camera);

/// A vertical field of view, degrees.
[[nodiscard]] double read_fov(const JsonField& field);
/// A direction: a vector of length 1e-12 or more.
[[nodiscard]] Point read_direction(const JsonField& field);

}  // namespace proto
