// Picking: what is under a pixel, and how many Gaussians a sphere holds. Request and answer.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/camera.h"

namespace proto {

/// A pixel, with or without a radius; or a point with a radius.
struct PickRequest {
  std::optional<Viewpoint> viewpoint;  ///< Camera of the pixel; none where `point` is given.
  double x = 0, y = 0;                 ///< Pixels from the upper left corner of the picture; the first centre is 0.5.
  std::optional<Point> point;          ///< Centre of the sphere, world units.
  std::optional<double> radius;        ///< Radius of the sphere, world units, above 0.
  bool operator==(const PickRequest&) const = default;
};

/// Strict, as parse_edit_request(), with its errors. `where` is such as "camera.fx" or "x".
[[nodiscard]] Result<PickRequest> parse_pick_request(std::string_view text, const JsonLimits& limits = {});

/// What was found; fields without a value say that nothing was.
struct PickResult {
  bool hit = false;
  std::optional<Point> point;             ///< On the surface, world units.
  std::optional<double> depth;            ///< Along the camera's axis, world units.
  std::optional<Point> normal;            ///< Unit, towards the camera.
  std::optional<std::uint32_t> gaussian;  ///< Row of the Gaussian that weighs most.
  std::optional<std::size_t> gaussians_in_radius;
};

[[nodiscard]] std::string to_json(const PickResult& result);

}  // namespace proto
