// New scenes, from files that were sent or that lie below the scene root.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "engine/io/scene_file.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/scratch.h"

namespace server::scenes {

/// Safe to call from any thread.
class Uploads {
 public:
  /// All outlive this.
  Uploads(const StoreOptions& options, BoundedCache& memory, Catalogue& catalogue, ScratchFolders& scratch,
          const PublicErrors& public_error)
      : options_(options), memory_(memory), catalogue_(catalogue), scratch_(scratch), public_error_(public_error) {}

  /// A new scene of an uploaded file, which is moved into the store.
  ///   filename  as its user calls it
  ///   name      of the scene; empty: that of the file
  ///   uploader  who brings it in
  ///   errors    those of io::read_scene(); too_large: too many scenes, or one that the memory can never hold; busy;
  ///             quota_exceeded: beyond what the uploader may store
  [[nodiscard]] Result<ManifestPtr> add(const std::filesystem::path& file, const std::string& filename,
                                        const std::string& name, const Uploader& uploader);
  /// A new scene of a file below the scene root, which is copied.
  ///   errors  those of below_root() and add()
  [[nodiscard]] Result<ManifestPtr> add_path(const std::string& path, const std::string& name,
                                             const Uploader& uploader);

 private:
  /// A file in memory, and the memory reserved for it until the cache counts it.
  struct Upload {
    std::shared_ptr<const engine::io::SceneFile> file;
    BoundedCache::Reservation reservation;
  };
  [[nodiscard]] Result<Upload> read(const std::filesystem::path& file);
  [[nodiscard]] Result<ManifestPtr> add_staged(const std::filesystem::path& file, const std::filesystem::path& staging,
                                               const std::string& name, const Uploader& uploader);

  const StoreOptions& options_;
  BoundedCache& memory_;
  Catalogue& catalogue_;
  ScratchFolders& scratch_;
  const PublicErrors& public_error_;
  /// One upload at a time is read: how much memory a file takes shows only when it is there.
  std::mutex reading_;
};

}  // namespace server::scenes
