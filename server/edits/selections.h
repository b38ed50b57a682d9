// Selections that somebody is making: what is worth keeping from one click to the next, and what was selected last.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/preview.h"
#include "engine/scene/camera.h"
#include "engine/select/select.h"
#include "proto/selection.h"
#include "server/scenes/scene_store.h"

namespace server::edits {

using engine::Result;

/// A selection that was carried out on a version of a scene.
struct MadeSelection {
  std::string id;          ///< The same for the same operations on the same Gaussians, and for no others.
  std::string version;     ///< LoadedVersion::key of what it was made on.
  proto::Selection asked;  ///< Every camera a pinhole one.
  engine::select::Selected selected;
};

/// How much is kept. Choices: a few people who click at a time, and what they could go back to.
struct SelectionsOptions {
  std::size_t max_desks = 3;  ///< Selectors, of a version each: 100 MB, and up to 8 bytes for each Gaussian.
  std::uint64_t desk_bytes = std::uint64_t{1} << 29;  ///< Of merged clouds, which selectors of later versions need.
  std::size_t max_made = 64;                          ///< Selections.
  std::uint64_t made_bytes = std::uint64_t{1} << 27;  ///< A byte for each Gaussian of the scene.
  std::chrono::seconds lifetime{600};                 ///< Since somebody last asked for it.
  std::function<std::chrono::steady_clock::time_point()> clock = std::chrono::steady_clock::now;
};

/// Safe to call from any thread. Nothing is computed under a lock: of two who select in one version at a time, one
/// begins without what the other knows. What is kept holds no version of a scene in memory, but for merged clouds, and
/// changes no result.
class Selections {
 public:
  /// The store outlives this object.
  explicit Selections(scenes::SceneStore& store, SelectionsOptions options = {});
  ~Selections();

  /// The selection with its cameras, as it is carried out on versions of this scene. Errors as with_cameras(), and
  /// those of the store.
  [[nodiscard]] Result<proto::Selection> resolve(const std::string& scene, const proto::Selection& selection) const;

  /// Where to look at what is selected from: the dataset's cameras, or without one those of the selection.
  ///   selection  as resolve() gives it
  ///   errors     those of the store
  [[nodiscard]] Result<std::vector<engine::scene::Camera>> cameras_about(const std::string& scene,
                                                                         const proto::Selection& selection) const;

  /// Carries a selection out, unless that was done before.
  ///   selection  as resolve() gives it
  ///   errors     those of to_engine() and of select::Selector::select()
  [[nodiscard]] Result<std::shared_ptr<const MadeSelection>> make(const scenes::LoadedVersion& version,
                                                                  const proto::Selection& selection);
  /// The selection of that id, made on this version.
  ///   errors  not_found: it was made on another one, or is no longer kept (`where` is "selection")
  [[nodiscard]] Result<std::shared_ptr<const MadeSelection>> find(const scenes::LoadedVersion& version,
                                                                  const std::string& id);

  /// The drag of such a selection, at once: what is found out stays for the next position of its handles.
  ///   errors  those of edit::preview()
  [[nodiscard]] Result<engine::edit::PreviewOutcome> preview(const scenes::LoadedVersion& version,
                                                             const engine::edit::Request& request);

  /// select::shown_shares() of what is selected.
  ///   made  on this version
  [[nodiscard]] std::vector<double> shown_shares(const scenes::LoadedVersion& version, const MadeSelection& made,
                                                 const std::vector<engine::scene::Camera>& views);

 private:
  struct Desk;
  using TimePoint = std::chrono::steady_clock::time_point;
  struct Kept {
    std::shared_ptr<const MadeSelection> made;
    TimePoint used;
  };

  [[nodiscard]] std::unique_ptr<Desk> take_desk(const scenes::LoadedVersion& version);
  void put_back(std::unique_ptr<Desk> desk);
  [[nodiscard]] std::shared_ptr<const MadeSelection> known(const std::string& version, const std::string& id);
  void keep(const std::shared_ptr<const MadeSelection>& made);

  scenes::SceneStore& store_;
  const SelectionsOptions options_;
  std::mutex mutex_;                        ///< Guards what follows.
  std::list<std::unique_ptr<Desk>> desks_;  ///< Nobody works at these; the one used last is last.
  std::list<Kept> made_;                    ///< The one used last is last.
};

}  // namespace server::edits
