// Which cameras an edit looks through, and virtual ones for a scene that comes without any.
// This room renders nothing: how much of each picture the edit covers is measured by its caller.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::views {

/// A camera that could be used, and what it sees of the edit.
struct Candidate {
  std::string name;        ///< Of the view.
  double source_area = 0;  ///< Part of the picture that shows the dragged Gaussians where they are: 0 to 1, or pixels.
  double target_area = 0;  ///< The same after the full drag; unit as source_area.
  DVec3 direction{0.0};    ///< Unit vector from the centre of the handles to the camera, world axes.
};

/// Up to `count` of the candidates as indices, best first.
///
/// Worth of a view: sqrt(source_area * target_area) plus a tenth of their mean, so that a view of only one end of the
/// drag counts, but far less than one that sees both. The first view is the one of largest worth. Then, one by one, the
/// view with the largest worth * spread follows, where spread = sin(a / 2) + 0.05 and a is the angle to the nearest
/// view already chosen: a second camera at the same place is worth a twentieth of one on the far side, yet is chosen
/// before none. Equal scores go to the lower index.
///   excluded  names that are never chosen
///   returns   distinct indices; fewer than `count` where fewer candidates see anything (an area that is negative or
///             not a number counts as zero)
/// Costs O(count * candidates).
[[nodiscard]] std::vector<std::size_t> choose_views(std::span<const Candidate> candidates, int count,
                                                    std::span<const std::string> excluded = {});

struct VirtualCameraOptions {
  int count = 50;            ///< Cameras wanted.
  int width = 512;           ///< Pixels.
  int height = 512;          ///< Pixels.
  double fov_y_rad = 0.87;   ///< Vertical field of view, radians, between 0 and pi.
  DVec3 up{0.0, -1.0, 0.0};  ///< World direction that points up, any length. Default: COLMAP's habit, y down.
  double near_plane = 0.2;   ///< World units: what is closer to a camera along its axis is not drawn.
  double radius = 0;         ///< Of the handles' spheres, world units: what lies so close to a point is edited, and is
                             ///< no geometry in front of it. 0: an eighth of the radius that a camera frames.
  /// Most Gaussians that are looked at, evenly spread over the rows, each of which then stands for those between it and
  /// the next; 0: all. With a bound the work is bounded, whatever the cloud is.
  std::size_t max_gaussians = 0;
  /// Works on the calling thread alone, and leaves the others to whoever is in a greater hurry. The result is the same.
  bool on_one_thread = false;
  /// Asked before each direction, by the threads that work; true: nobody wants the cameras any more. Empty: never.
  std::function<bool()> cancelled = {};
};

/// A dome of cameras "virtual_00", "virtual_01", ... around the handles, for a scene without a dataset.
///
/// Every camera looks at the middle of `points`' bounding box and holds all points in its picture. Directions are a
/// Fibonacci lattice on the dome from 10 to 80 degrees above the handles. The distance follows the scene's own scale: a
/// camera frames the points with half as much again around them, or half the median distance of the cloud from them if
/// that is more. It moves closer where geometry stands in between (fewer than half of the points can be seen, judged by
/// the opacity that the rays to them gather) or the camera would be within or right beside geometry. A direction that
/// is not free at any distance is dropped, and a denser lattice is tried in its place. In a scene so small that the
/// near plane would cut it, cameras stay back and their field of view narrows instead.
///   points   sources and targets of the handles, world units, finite
///   returns  options.count cameras; fewer where the handles are walled in on most sides. If they are on all, the
///            cameras that see most are returned, so that an edit always has something to look through.
///            None for no points or count < 1, or once cancelled.
/// Deterministic. All lengths are relative to the points: a scene 1e6 units from the origin gets the same dome.
/// Costs O(directions tried * Gaussians looked at). Up to 8 times `count` directions are tried: 50 cameras in a dense
/// cloud of a million Gaussians take 11 s, by 50,000 of them less than two.
[[nodiscard]] std::vector<scene::Camera> virtual_cameras(const scene::GaussianCloud& cloud,
                                                         std::span<const DVec3> points,
                                                         const VirtualCameraOptions& options = {});

}  // namespace engine::views
