// Versions in memory: read from disk when somebody asks for one, and new ones made.
#pragma once

#include <memory>
#include <string>

#include "engine/io/scene_file.h"
#include "engine/scene/overlay.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/scratch.h"
#include "server/scenes/versions/previews.h"

namespace server::scenes {

/// Keeps clouds and overlays in `memory`. Safe to call from any thread.
class Versions {
 public:
  /// All outlive this.
  Versions(const StoreOptions& options, BoundedCache& memory, Catalogue& catalogue, Previews& previews,
           ScratchFolders& scratch, const PlainErrors& told)
      : options_(options),
        memory_(memory),
        catalogue_(catalogue),
        previews_(previews),
        scratch_(scratch),
        told_(told) {}

  /// Version 0 with its file's layout. Errors as load().
  [[nodiscard]] Result<std::shared_ptr<const engine::io::SceneFile>> base(const Snapshot& at);
  /// See SceneStore::load().
  [[nodiscard]] Result<LoadedVersion> load(const Snapshot& at, const std::string& version);

  /// See SceneStore::add_version() and add_preview().
  [[nodiscard]] Result<int> add(const Snapshot& at, int parent, const std::string& edit,
                                const engine::scene::Overlay& overlay);
  [[nodiscard]] Result<Preview> add_preview(const Snapshot& at, int parent, const engine::scene::Overlay& overlay);

 private:
  /// An overlay over version 0, and the room it takes until the cache takes that over.
  struct OverBase {
    std::shared_ptr<const engine::scene::Overlay> overlay;
    std::uint64_t bytes = 0;
    std::shared_ptr<const engine::scene::GaussianCloud> base;
    BoundedCache::Room room;
  };

  [[nodiscard]] Result<std::shared_ptr<const engine::scene::Overlay>> overlay(const Snapshot& at, int version,
                                                                              const engine::scene::GaussianCloud& base);
  [[nodiscard]] Result<LoadedVersion> load_preview(const Snapshot& at, const std::string& preview);
  [[nodiscard]] Result<OverBase> over_base(const Snapshot& at, int parent, const engine::scene::Overlay& overlay);
  void forget_if_removed(const Snapshot& at);

  const StoreOptions& options_;
  BoundedCache& memory_;
  Catalogue& catalogue_;
  Previews& previews_;
  ScratchFolders& scratch_;
  const PlainErrors& told_;
};

}  // namespace server::scenes
