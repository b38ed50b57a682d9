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
      : options_(options), memory_(memory), files_(files) {
    // Two processes must not both call something "p000001" that a client may ask either of them for.
    if (options.sharing == Sharing::shared) last_ = random_number() % 1'000'000'000'000;
  }

  /// Forgets the previews whose time is over.
  void expire();
  /// Adds a preview. At StoreOptions::max_previews, the one that would expire first is dropped for it.
  ///   overlay      over version 0
  ///   reservation  of the memory that the overlay takes
  [[nodiscard]] Preview add(const Snapshot& at, BoundedCache::CachedObject overlay,
                            BoundedCache::Reservation reservation);
  /// A preview in memory. Holding it keeps it there.
  struct LoadedPreview {
    std::shared_ptr<const engine::scene::Overlay> overlay;
    std::string key;  ///< See LoadedVersion.
  };
  /// A preview of the scene, which lives for a while longer from now; nothing if it is not there any more.
  [[nodiscard]] std::optional<LoadedPreview> find(const std::string& scene, const std::string& preview);
  [[nodiscard]] bool has(const std::string& preview) const;  ///< Of any scene.
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
  const std::string process_nonce_ = random_nonce();  ///< Previews of another process of the service are others.

  mutable std::mutex mutex_;  ///< Guards what follows.
  std::map<std::string, Record> records_;
  std::uint64_t last_ = 0;
};

}  // namespace server::scenes
