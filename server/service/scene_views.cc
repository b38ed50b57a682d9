#include "server/service/scene_views.h"

#include <algorithm>
#include <numbers>
#include <sstream>

#include "engine/views/views.h"
#include "server/edits/points.h"

namespace server::service {
namespace {

using edits::to_vec;
using engine::DVec3;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::scene::Camera;

/// Budget of the virtual cameras that are remembered, bytes: those of a thousand scenes.
constexpr std::uint64_t virtual_memory_bytes = std::uint64_t{16} << 20;
const DVec3 default_up{0.0, -1.0, 0.0};  // COLMAP's habit: y down

Camera to_camera(const proto::PinholeCamera& given) {
  Camera camera;
  camera.width = given.width, camera.height = given.height;
  camera.fx = given.fx, camera.fy = given.fy, camera.cx = given.cx, camera.cy = given.cy;
  for (int row = 0; row < 3; ++row) {
    const auto& values = given.cam_from_world[std::size_t(row)];
    for (int column = 0; column < 3; ++column) camera.rotation[column][row] = values[std::size_t(column)];
    camera.translation[row] = values[3];
  }
  return camera;
}

Result<Camera> to_camera(const proto::LookAtCamera& given, DVec3 scene_up, const std::string& where) {
  const DVec3 up = glm::normalize(given.up ? to_vec(*given.up) : scene_up);
  const Camera camera = engine::scene::look_at(to_vec(given.eye), to_vec(given.target), up,
                                               given.fov_y_deg * std::numbers::pi / 180, given.width, given.height);
  if (!engine::scene::validate(camera))
    return fail(ErrorCode::invalid_argument,
                "the camera has no direction: eye and target are one point, or as good as one", where + "target");
  return camera;
}

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

SceneViews::SceneViews(scenes::SceneStore& store, RenderService& renders)
    : store_(store),
      renders_(renders),
      virtual_(virtual_memory_bytes, "the cache of virtual views", scenes::WhenFull::exceed) {}

Result<std::shared_ptr<const ViewSet>> SceneViews::virtual_views(const scenes::SceneInfo& scene) {
  engine::views::VirtualCameraOptions options;
  options.count = int(virtual_view_count);
  options.up = scene.up.value_or(default_up);
  options.radius = scene.radius;
  const std::uint64_t bytes = virtual_view_count * sizeof(SceneView);
  const auto make = [&]() -> Result<scenes::BoundedCache::CachedObject> {
    const auto loaded = store_.load(scene.id, "0");
    if (!loaded) return propagate(loaded);
    auto set = std::make_shared<ViewSet>();
    set->is_virtual = true;
    auto done = renders_.run_in_turn([&] {
      for (const Camera& camera :
           engine::views::virtual_cameras(*loaded->cloud.base, around(scene.centre, scene.radius), options))
        set->views.push_back({camera, false});
    });
    if (!done) return propagate(done);
    return scenes::BoundedCache::CachedObject{set, bytes};
  };
  std::ostringstream name;
  name << std::hexfloat << scene.id << ' ' << options.up.x << ' ' << options.up.y << ' ' << options.up.z;
  return virtual_.get<ViewSet>(name.str(), bytes, make);
}

Result<std::shared_ptr<const ViewSet>> SceneViews::views_of(const std::string& scene) {
  const auto about = store_.find(scene);
  if (!about) return propagate(about);
  const auto dataset = store_.dataset(scene);
  if (!dataset) return propagate(dataset);
  if (!*dataset) return virtual_views(*about);
  auto set = std::make_shared<ViewSet>();
  for (const auto& view : (*dataset)->views) set->views.push_back({view.camera, !view.photo.empty()});
  return std::shared_ptr<const ViewSet>(std::move(set));
}

Result<Camera> SceneViews::resolve(const std::string& scene, const proto::Viewpoint& viewpoint,
                                   const std::string& where) {
  if (const auto* camera = std::get_if<proto::Camera>(&viewpoint)) {
    const auto about = store_.find(scene);
    if (!about) return propagate(about);
    if (const auto* pinhole = std::get_if<proto::PinholeCamera>(camera)) return to_camera(*pinhole);
    return to_camera(std::get<proto::LookAtCamera>(*camera), about->up.value_or(default_up), where);
  }
  const auto& name = std::get<std::string>(viewpoint);
  const auto set = views_of(scene);
  if (!set) return propagate(set);
  const auto& views = (*set)->views;
  const auto found = std::ranges::find(views, name, [](const SceneView& view) { return view.camera.name; });
  if (found != views.end()) return found->camera;
  std::string first;
  for (std::size_t i = 0; i < std::min<std::size_t>(views.size(), 3); ++i)
    first += (i == 0 ? "" : ", ") + views[i].camera.name;
  return fail(ErrorCode::not_found,
              "the scene has no such view; its " + std::to_string(views.size()) + " views begin with " + first, "view");
}

proto::PinholeCamera to_proto(const Camera& camera) {
  proto::PinholeCamera out{camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, {}};
  for (int row = 0; row < 3; ++row) {
    auto& values = out.cam_from_world[std::size_t(row)];
    for (int column = 0; column < 3; ++column) values[std::size_t(column)] = camera.rotation[column][row];
    values[3] = camera.translation[row];
  }
  return out;
}

}  // namespace server::service
