// The views of a scene: those of its dataset, or virtual ones around it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/fair_semaphore.h"
#include "engine/core/result.h"
#include "engine/scene/camera.h"
#include "proto/camera.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/scene_store.h"

namespace server::service {

using engine::Result;

/// Number of cameras around a scene without a dataset. A choice: as many as an edit looks through by default.
constexpr std::size_t virtual_view_count = 50;

/// Gaussians that are looked at to find them, of all that the scene has. A choice: ten million take as long as a
/// hundred thousand, at most 1.6 s as measured, and the dome is as free.
constexpr std::size_t looked_at_for_views = 50'000;

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
  /// Whether the client that asks has left.
  using Gone = std::function<bool()>;

  /// The store outlives this object.
  explicit SceneViews(scenes::SceneStore& store);

  /// The dataset's views, else 50 cameras on a dome around the scene's centre, with the scene's up. The dome is
  /// found by looking at some Gaussians of version 0, once: which takes up to two seconds of one thread. One scene
  /// after the other, so that renders go on beside it.
  ///   gone    asked now and then by the calling thread; then the work ends
  ///   errors  those of SceneStore::dataset() and load(); busy; cancelled: the client has gone
  [[nodiscard]] Result<std::shared_ptr<const ViewSet>> views_of(const std::string& scene, const Gone& gone = {});

  /// The camera that a request means.
  ///   where   address of the viewpoint's fields: "camera.", or "" in a query
  ///   gone    as of views_of()
  ///   errors  not_found: no view of that name (`where` is "view"); invalid_argument: a camera without direction; as
  ///   views_of()
  [[nodiscard]] Result<engine::scene::Camera> resolve(const std::string& scene, const proto::Viewpoint& viewpoint,
                                                      const std::string& where, const Gone& gone = {});

 private:
  Result<std::shared_ptr<const ViewSet>> virtual_views(const scenes::SceneInfo& scene, const Gone& gone);
  Result<std::shared_ptr<const ViewSet>> find_virtual_views(const scenes::SceneInfo& scene, const Gone& gone);

  scenes::SceneStore& store_;
  engine::FairSemaphore turns_;
  scenes::BoundedCache virtual_;
};

}  // namespace server::service
