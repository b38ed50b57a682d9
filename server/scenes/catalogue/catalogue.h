// Which scenes there are: a folder and a manifest each, on disk, and a list of them in memory. Knows no Gaussians.
//
// Where several processes share the folder (Sharing::shared), the manifests on disk are what counts: whoever asks for a
// scene gets it as its manifest says now, which is read again when it is another file than before; and whoever changes
// one holds the scene's lock between processes, a FileLock of its number in ".writers", while it reads and writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/file_lock.h"
#include "engine/core/result.h"
#include "server/scenes/catalogue/manifest.h"
#include "server/scenes/disk/disk.h"
#include "server/scenes/disk/folder_lock.h"
#include "server/scenes/disk/public_errors.h"

namespace server::scenes {

using engine::Result;
using ManifestPtr = std::shared_ptr<const Manifest>;

/// One scene in the list.
struct CatalogueEntry {
  CatalogueEntry(Manifest about, const std::filesystem::path& path, std::shared_ptr<Lease> unpacked)
      : id(about.scene.id),
        folder(std::make_shared<Lease>(path)),
        manifest(std::make_shared<const Manifest>(std::move(about))),
        dataset_folder(std::move(unpacked)) {}

  const std::string id;
  const std::shared_ptr<Lease> folder;
  /// Whoever changes the manifest holds this lock from reading the old manifest until the new one is on disk, against
  /// the rule that no lock is held over I/O: two changes at once would lose one of them. Readers never wait for it.
  std::mutex writer;
  // The lock of the catalogue guards what follows.
  ManifestPtr manifest;
  std::optional<FileStamp> stamp;         ///< Of the manifest's file, if a change of that would show in it.
  std::shared_ptr<Lease> dataset_folder;  ///< Folder of an unpacked dataset; else null.
};

/// A scene as it was at one time. Holding it keeps its files, even if it is removed or changed meanwhile.
struct Snapshot {
  std::shared_ptr<CatalogueEntry> scene;
  ManifestPtr manifest;
  std::shared_ptr<Lease> dataset_folder;
};

/// What a file in the scene's folder is called in errors: its path inside the data folder.
[[nodiscard]] inline std::string stored_name(const Snapshot& at, const std::string& name) {
  return "scenes/" + at.scene->id + "/" + name;
}

/// Whether a folder's name is that of a scene: "s000001".
[[nodiscard]] bool is_scene_id(const std::string& name);
/// Whether the number of the next scene can be read.
[[nodiscard]] bool counter_is_sound(const std::filesystem::path& folder);

/// Safe to call from any thread once it is open. Its lock is never held over I/O.
class Catalogue {
 public:
  /// folder        absolute
  /// public_error  words errors for strangers; outlives this
  Catalogue(std::filesystem::path folder, Sharing sharing, std::size_t max_scenes, const PublicErrors& public_error)
      : folder_(std::move(folder)), sharing_(sharing), max_scenes_(max_scenes), public_error_(public_error) {}

  /// Makes the folder or takes up what is in it, without what a crash left there: unless others are at work in it.
  ///   errors  conflict: another process has it; those of file_error(), with full paths
  [[nodiscard]] Result<void> open();
  /// Whether no other process has the folder: until let_others_in(), where it is shared.
  [[nodiscard]] bool is_alone() const { return folder_lock_.is_alone(); }
  void let_others_in() {
    if (sharing_ == Sharing::shared) folder_lock_.share();
  }
  /// Scenes that could not be taken up; their folders are left as they are.
  [[nodiscard]] const std::vector<engine::Error>& damaged() const { return damaged_; }

  /// What was damaged and could be made good.
  [[nodiscard]] const std::vector<engine::Error>& recovered() const { return recovered_; }

  /// The scene as it is now.
  ///   errors  not_found: `where` is "scene"
  [[nodiscard]] Result<Snapshot> snapshot(const std::string& id);
  /// Whether the scene has not been removed since. A removal empties the caches of the scene once, before the scene
  /// goes. So whoever has put something into a cache for a snapshot calls this afterwards, and forgets it again if it
  /// is false.
  [[nodiscard]] bool has(const Snapshot& at);
  [[nodiscard]] std::vector<ManifestPtr> manifests();  ///< In the order of ids.
  [[nodiscard]] std::size_t size();

  /// Counts a scene that is being added, as long as this lives: a thousand uploads at once do not pass the limit
  /// together.
  class Reservation {
   public:
    explicit Reservation(Catalogue& catalogue) : catalogue_(&catalogue) {}
    Reservation(Reservation&& other) noexcept : catalogue_(std::exchange(other.catalogue_, nullptr)) {}
    Reservation& operator=(Reservation&&) = delete;
    ~Reservation();

   private:
    Catalogue* catalogue_;
  };
  /// Reserves a place in the count of scenes.
  ///   errors  too_large: there are as many scenes as there may be
  [[nodiscard]] Result<Reservation> reserve();
  /// What somebody has brought in and the store still has: bytes of scenes as they came, and of unpacked datasets.
  [[nodiscard]] std::uint64_t bytes_of(const std::string& uploader);
  /// Held from the look at what somebody has stored until what they bring in is there, too.
  struct QuotaHold {
    std::unique_lock<std::mutex> here;
    std::optional<engine::FileLock> among_processes;
  };
  /// Whether somebody may store so much more. Nothing is held for whom no limit is set.
  ///   bytes   what comes
  ///   freed   what of theirs goes for it
  ///   errors  quota_exceeded (`where` is "bytes")
  [[nodiscard]] Result<QuotaHold> hold_quota(const Uploader& uploader, std::uint64_t bytes, std::uint64_t freed = 0);
  /// A new scene, on disk when this returns: it appears whole or not at all.
  ///   manifest   without id
  ///   max_bytes  that its uploader may store
  ///   base_file  what becomes its version 0; moved
  ///   staging    a folder to put things together in, on the same file system
  ///   errors     quota_exceeded: beyond that; those of file_error(), in words for strangers
  [[nodiscard]] Result<Snapshot> add(Manifest manifest, const std::filesystem::path& base_file,
                                     const std::filesystem::path& staging,
                                     std::optional<std::uint64_t> max_bytes = std::nullopt);
  /// Replaces a scene's manifest by one that `change` has changed.
  ///   dataset_folder  if given: that of the changed manifest, swapped for the one before
  ///   returns         the new manifest
  ///   errors          not_found: removed meanwhile; those of `change` and of write_manifest()
  [[nodiscard]] Result<ManifestPtr> change(const Snapshot& at, const std::function<Result<void>(Manifest&)>& change,
                                           std::shared_ptr<Lease>* dataset_folder = nullptr);
  /// Removes the scene from the list; its files go once nobody reads from them any more.
  [[nodiscard]] Result<void> remove(const std::string& id);

 private:
  /// How a scene is changed: by one at a time, of all processes.
  struct Writing {
    std::unique_lock<std::mutex> here;
    std::optional<engine::FileLock> among_processes;
  };
  [[nodiscard]] Result<Writing> begin_to_write(CatalogueEntry& scene);
  [[nodiscard]] Result<std::optional<engine::FileLock>> lock_out_others(std::uint64_t number) const;

  void read_counter();
  void take_up(const std::filesystem::path& folder);
  [[nodiscard]] Result<std::uint64_t> next_number();
  /// Where others may have changed something: the scene as it is on disk; not_found where it is not.
  [[nodiscard]] Result<Snapshot> look_again(const std::string& id);
  /// Looks again at all scenes.
  void look_around();
  /// Puts a manifest that was read into the list. The lock is held.
  [[nodiscard]] Snapshot put(Manifest manifest, std::optional<FileStamp> stamp);

  const std::filesystem::path folder_;
  const Sharing sharing_;
  const std::size_t max_scenes_;
  const PublicErrors& public_error_;
  FolderLock folder_lock_;
  std::vector<engine::Error> damaged_, recovered_;  ///< Only open() writes them.

  mutable std::mutex mutex_;  ///< Guards what follows, and the scenes' own manifests.
  std::map<std::string, std::shared_ptr<CatalogueEntry>> scenes_;
  std::size_t reserved_ = 0;  ///< Scenes that are being added.

  std::mutex quota_;  ///< Held as QuotaHold, against the rule that no lock is held over I/O: two must not fit together.

  /// Held while the number of the next scene goes to disk: it must not be written twice, nor go back.
  std::mutex counter_writer_;
  std::uint64_t next_scene_ = 1;
};

}  // namespace server::scenes
