// The views of a scene: those of its dataset, or virtual ones around it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/camera.h"
#include "proto/camera.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/scene_store.h"
#include "server/service/render_service.h"

namespace server::service {

/// Number of cameras around a scene without a dataset. A choice: as many as an edit looks through by default.
constexpr std::size_t virtual_view_count = 50;

/// A camera of a scene.
struct SceneView {
  engine::scene::Camera camera;
  bool photo = false;  ///< Whether the dataset has a photo of it.
};

/// The views of one scene.
struct ViewSet {
  bool is_virtual = false;  ///< Cameras around the scene, for want of a dataset.
  std::vector<SceneView> views;
};

/// Safe to call from any thread.
class SceneViews {
 public:
  /// The store and the renders outlive this object.
  SceneViews(scenes::SceneStore& store, RenderService& renders);

  /// The dataset's views, else 50 cameras on a dome around the scene's centre, with the scene's up. The dome is
  /// found by looking at version 0, which takes a second or two, once.
  ///   errors  those of SceneStore::dataset() and load(); busy
  [[nodiscard]] Result<std::shared_ptr<const ViewSet>> views_of(const std::string& scene);

  /// The camera that a request means.
  ///   where   address of the viewpoint's fields: "camera.", or "" in a query
  ///   errors  not_found: no view of that name (`where` is "view"); invalid_argument: a camera without direction; as
  ///   views_of()
  [[nodiscard]] Result<engine::scene::Camera> resolve(const std::string& scene, const proto::Viewpoint& viewpoint,
                                                      const std::string& where);

 private:
  Result<std::shared_ptr<const ViewSet>> virtual_views(const scenes::SceneInfo& scene);

  scenes::SceneStore& store_;
  RenderService& renders_;
  scenes::BoundedCache virtual_;
};

}  // namespace server::service
