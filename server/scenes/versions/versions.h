// Versions in memory: read from disk when somebody asks for one, and new ones made.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "engine/scene/overlay.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/versions/previews.h"

namespace server::scenes {

/// Keeps clouds and overlays in `memory`. Safe to call from any thread.
class Versions {
 public:
  /// All outlive this.
  Versions(const StoreOptions& options, BoundedCache& memory, Catalogue& catalogue, Previews& previews,
           const PublicErrors& public_error)
      : options_(options), memory_(memory), catalogue_(catalogue), previews_(previews), public_error_(public_error) {}

  /// Version 0 with its file's layout. Errors as load().
  [[nodiscard]] Result<std::shared_ptr<const engine::io::SceneFile>> base(const Snapshot& at);
  /// A version ("0", "1", ...) or a preview ("p000001"), read from disk if need be.
  ///   errors  not_found; busy: it does not fit the memory beside what is in use; too_large: it alone does not; those
  ///           of io
  [[nodiscard]] Result<LoadedVersion> load(const Snapshot& at, const std::string& version);

  /// Whether a version that was there then is there now.
  [[nodiscard]] bool has(const Snapshot& at, const std::string& version) const;
  /// Writes down what becomes a version of the scene when it is taken in, and not before: durable when this returns.
  /// For an edit whose version is one of the scene already it tells of that.
  ///   attempt  tells this attempt at the edit from all others, whose files are their own
  ///   overlay  over the parent
  ///   errors   those of load() and write_overlay()
  [[nodiscard]] Result<MadeVersion> make(const Snapshot& at, int parent, const std::string& edit, std::int64_t attempt,
                                         const engine::scene::Overlay& overlay);
  /// Makes it a version of the scene, durable when this returns: its number. Nothing where that was done before, by
  /// whatever process, even if the version has been deleted since.
  ///   errors  those of write_manifest(); not_found: the scene is gone
  [[nodiscard]] Result<int> take_in(const Snapshot& at, const MadeVersion& made);
  /// What was made and has not been taken in: names of files, "<edit>-<attempt>".
  [[nodiscard]] std::vector<std::string> made() const;
  void discard(const std::string& made) const;
  /// Removes what killed processes left half-written among it. Only while no other process is at work.
  void remove_half_made() const;
  /// What is known of a version. A preview is none.
  ///   errors  not_found
  [[nodiscard]] static Result<VersionInfo> find(const Snapshot& at, const std::string& version);
  /// Calls a version by a name ("": by none), and says what is known of it then.
  ///   errors  not_found; those of write_manifest()
  [[nodiscard]] Result<VersionInfo> rename(const Snapshot& at, const std::string& version, const std::string& name);
  /// Deletes a version for good: its number is not used again, and those that were made from it are said to have been
  /// made from its parent. Each is an overlay over version 0, so none needs another one's file. Whoever holds it keeps
  /// it in memory.
  ///   errors  not_found; conflict: version 0, which all others lie over; those of write_manifest()
  [[nodiscard]] Result<void> remove(const Snapshot& at, const std::string& version);
  /// A version that lives in memory only, for a while. Errors as load().
  [[nodiscard]] Result<Preview> add_preview(const Snapshot& at, int parent, const engine::scene::Overlay& overlay);

 private:
  [[nodiscard]] std::filesystem::path folder_of_made() const { return options_.folder / ".made"; }
  /// An overlay over version 0, and the memory reserved for it until the cache counts it.
  struct OverBase {
    std::shared_ptr<const engine::scene::Overlay> overlay;
    std::uint64_t bytes = 0;
    std::shared_ptr<const engine::scene::GaussianCloud> base;
    BoundedCache::Reservation reservation;
  };

  [[nodiscard]] Result<std::shared_ptr<const engine::scene::Overlay>> overlay(const Snapshot& at, int version,
                                                                              const engine::scene::GaussianCloud& base);
  [[nodiscard]] Result<LoadedVersion> load_preview(const Snapshot& at, const std::string& preview);
  [[nodiscard]] Result<OverBase> over_base(const Snapshot& at, int parent, const engine::scene::Overlay& overlay);
  /// Drops from the cache what has been removed while it was read.
  void forget_if_removed(const Snapshot& at, int version = 0);
  [[nodiscard]] bool is_still_there(const Snapshot& at, int version) const;
  /// Holds the file of a version against its digest. One that has none, of an earlier release, gets it now.
  ///   seen  of what has been read of it already
  [[nodiscard]] Result<void> check(const Snapshot& at, int version, RunningDigest& seen);

  const StoreOptions& options_;
  BoundedCache& memory_;
  Catalogue& catalogue_;
  Previews& previews_;
  const PublicErrors& public_error_;
};

}  // namespace server::scenes
