#include "server/service/scene_views.h"

#include <algorithm>
#include <sstream>

#include "engine/views/views.h"
#include "server/edits/cameras.h"

namespace server::service {
namespace {

using engine::DVec3;
using engine::propagate;
using engine::scene::Camera;

/// Budget of the virtual cameras that are remembered, bytes: those of a thousand scenes.
constexpr std::uint64_t virtual_memory_bytes = std::uint64_t{16} << 20;

/// Requests that may wait until others' views are found; more are busy. A choice: half a minute of work.
constexpr std::size_t max_waiting = 32;

/// The ends of a cross through the scene's middle: a camera that holds them frames half of the scene.
std::vector<DVec3> around(DVec3 centre, double radius) {
  std::vector<DVec3> points;
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      points.push_back(centre);
      points.back()[axis] += sign * radius;
    }
  return points;
}

}  // namespace

SceneViews::SceneViews(scenes::SceneStore& store)
    : store_(store),
      turns_({.waiting = max_waiting}, "views"),
      virtual_(virtual_memory_bytes, "the cache of virtual views", scenes::WhenFull::exceed) {}

Result<std::shared_ptr<const ViewSet>> SceneViews::find_virtual_views(const scenes::SceneInfo& scene,
                                                                      const Gone& gone) {
  const auto loaded = store_.load(scene.id, "0");
  if (!loaded) return propagate(loaded);
  const auto turn = turns_.acquire();
  if (!turn) return propagate(turn);
  engine::views::VirtualCameraOptions options;
  options.count = int(virtual_view_count);
  options.up = scene.up.value_or(edits::default_up);
  options.radius = scene.radius;
  options.max_gaussians = looked_at_for_views;
  options.on_one_thread = true;
  bool left = false;
  options.cancelled = [&] { return left = gone && gone(); };
  const auto cameras = engine::views::virtual_cameras(*loaded->cloud.base, around(scene.centre, scene.radius), options);
  if (left) return engine::fail(engine::ErrorCode::cancelled, "the client has gone");
  auto set = std::make_shared<ViewSet>();
  set->is_virtual = true;
  for (const Camera& camera : cameras)
    // Where a scene's middle is at 1e38, single precision has no place to stand: such a scene has no virtual views.
    if (engine::scene::validate(camera)) set->views.push_back({camera, false});
  return std::shared_ptr<const ViewSet>(std::move(set));
}

Result<std::shared_ptr<const ViewSet>> SceneViews::virtual_views(const scenes::SceneInfo& scene, const Gone& gone) {
  const DVec3 up = scene.up.value_or(edits::default_up);
  std::ostringstream name;
  name << std::hexfloat << scene.id << ' ' << up.x << ' ' << up.y << ' ' << up.z;
  const std::uint64_t bytes = virtual_view_count * sizeof(SceneView);
  for (;;) {
    const auto set = virtual_.get<ViewSet>(name.str(), bytes, [&]() -> Result<scenes::BoundedCache::CachedObject> {
      auto found = find_virtual_views(scene, gone);
      if (!found) return propagate(found);
      return scenes::BoundedCache::CachedObject{std::move(*found), bytes};
    });
    // Several clients wait for the work of the first. Where that one has gone, the next takes its place.
    const bool another_left = !set && set.error().code == engine::ErrorCode::cancelled && !(gone && gone());
    if (!another_left) return set;
  }
}

Result<std::shared_ptr<const ViewSet>> SceneViews::views_of(const std::string& scene, const Gone& gone) {
  const auto about = store_.find(scene);
  if (!about) return propagate(about);
  const auto dataset = store_.dataset(scene);
  if (!dataset) return propagate(dataset);
  if (!*dataset) return virtual_views(*about, gone);
  auto set = std::make_shared<ViewSet>();
  for (const auto& view : (*dataset)->views) set->views.push_back({view.camera, !view.photo.empty()});
  return std::shared_ptr<const ViewSet>(std::move(set));
}

Result<Camera> SceneViews::resolve(const std::string& scene, const proto::Viewpoint& viewpoint,
                                   const std::string& where, const Gone& gone) {
  if (const auto* camera = std::get_if<proto::Camera>(&viewpoint)) {
    const auto about = store_.find(scene);
    if (!about) return propagate(about);
    return edits::to_camera(*camera, about->up.value_or(edits::default_up), where);
  }
  const auto& name = std::get<std::string>(viewpoint);
  const auto set = views_of(scene, gone);
  if (!set) return propagate(set);
  const auto& views = (*set)->views;
  const auto found = std::ranges::find(views, name, [](const SceneView& view) { return view.camera.name; });
  if (found != views.end()) return found->camera;
  std::vector<std::string> first;
  for (std::size_t i = 0; i < std::min<std::size_t>(views.size(), 3); ++i) first.push_back(views[i].camera.name);
  return tl::make_unexpected(edits::no_such_view(first, views.size(), "view"));
}

}  // namespace server::service
