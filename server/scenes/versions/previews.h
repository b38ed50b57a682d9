// Versions that live in memory only, for a while.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "engine/scene/overlay.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/names.h"
#include "server/scenes/catalogue/scene_info.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/bounded_cache.h"

namespace server::scenes {

/// Whether a version's name is that of a preview: "p000001".
[[nodiscard]] inline bool is_preview(const std::string& version) { return version.starts_with('p'); }

/// Which previews there are, and until when. Their overlays are in `memory` and their files in `files`, by the name
/// "<scene>/<preview>". Safe to call from any thread.
class Previews {
 public:
  /// All outlive this.
  Previews(const StoreOptions& options, BoundedCache& memory, BoundedCache& files)
      : options_(options), memory_(memory), files_(files) {}

  /// Forgets those whose time is over.
  void expire();
  /// A new one; if there are as many as there may be, the one that would expire first makes room.
  ///   overlay  over version 0
  ///   room     that of the overlay, taken before
  [[nodiscard]] Preview add(const Snapshot& at, BoundedCache::Made overlay, BoundedCache::Room room);
  struct Held {
    std::shared_ptr<const engine::scene::Overlay> overlay;
    std::string key;  ///< See LoadedVersion.
  };
  /// One of a scene's, which is kept for a while longer; nothing for one that is not there any more.
  [[nodiscard]] std::optional<Held> find(const std::string& scene, const std::string& preview);
  [[nodiscard]] bool has(const std::string& preview) const;  ///< Whatever its scene.
  [[nodiscard]] std::size_t size();

  void forget(const std::string& scene, const std::string& preview);
  void forget_all_of(const std::string& scene);

 private:
  struct Record {
    std::string scene, key;
    Time expires{};
  };

  [[nodiscard]] Time expiry() const { return options_.clock() + options_.preview_lifetime; }

  const StoreOptions& options_;
  BoundedCache& memory_;
  BoundedCache& files_;
  const std::string run_ = random_nonce();  ///< Previews of another run of the service are others.

  mutable std::mutex mutex_;  ///< Guards what follows.
  std::map<std::string, Record> records_;
  std::uint64_t last_ = 0;
};

}  // namespace server::scenes
