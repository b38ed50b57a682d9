// The scenes a service holds: on disk, and as much of them in memory as its budget allows.
//
//     <data-dir>/scenes/next_scene            number of the next scene
//     <data-dir>/scenes/<id>/scene.json       manifest: name, up, versions, dataset; replaced as a whole
//                           base.*            the file as it was uploaded: version 0
//                           versions/<v>.overlay   what version v changes, over version 0
//                           dataset.<n>/      cameras and photos, unpacked from a zip file
//                           dataset.<n>.xxh3  the digests of its files
//                           files/            versions as files for download; a cache
//     <data-dir>/scenes/.made/<edit>-<n>      what attempt n at an edit has made, until it is a version
//
// A manifest is written last, to a temporary name, synced and renamed: what it does not name is not there, and is
// removed at the next start. It holds the digest of each file that it names and of itself; a file is held against its
// digest whenever it is read (docs/adr/0022-what-is-stored-is-checked.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/io/dataset.h"
#include "engine/scene/overlay.h"
#include "server/scenes/catalogue/manifest.h"
#include "server/scenes/catalogue/scene_info.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/scratch.h"

namespace server::scenes {

using engine::Result;

/// Safe to call from any thread. `where` of errors: "scene" for an unknown id, "version" for an unknown version, the
/// file's own address where a file is to blame. Memory that others use is `busy`. Errors name no folder of this
/// machine, except those of open().
class SceneStore {
 public:
  [[nodiscard]] static Result<std::unique_ptr<SceneStore>> open(const StoreOptions& options);
  ~SceneStore();

  /// Whether no other process works in the folder. The first of those who share it is alone until let_others_in(): it
  /// can put things in order that stand beside the scenes.
  [[nodiscard]] bool is_alone() const;
  void let_others_in();

  /// Scenes on disk that could not be taken up when the store was opened; their folders are left as they are: somebody
  /// may want to save them.
  [[nodiscard]] const std::vector<engine::Error>& damaged() const;
  /// What else was damaged when the store was opened, and could be made good.
  [[nodiscard]] const std::vector<engine::Error>& recovered() const;

  /// A new, empty folder for an upload to go to, below the data folder; gone when what is returned is.
  [[nodiscard]] Result<Scratch> scratch();

  /// Whether somebody may store so many bytes more.
  ///   replaced  if given: the scene whose dataset goes for them
  ///   errors    quota_exceeded (`where` is "bytes")
  [[nodiscard]] Result<void> check_quota(const Uploader& uploader, std::uint64_t bytes = 0,
                                         const std::string& replaced = {}) const;
  /// What somebody has brought in and the store still has: bytes of scenes as they came, and of unpacked datasets.
  [[nodiscard]] std::uint64_t bytes_of(const std::string& uploader) const;

  /// A new scene from an uploaded file, which is moved into the store. The file is read whole, once.
  ///   filename  as its user calls it, for the scene's name and for error addresses
  ///   errors    those of io::read_scene(); too_large: too many scenes, or one that the memory can never hold; busy;
  ///             quota_exceeded: beyond what the uploader may store
  [[nodiscard]] Result<SceneInfo> add_upload(const std::filesystem::path& file, const std::string& filename,
                                             const std::string& name, const Uploader& uploader = {});
  /// A new scene from a file below the scene root, which is copied.
  ///   errors  invalid_argument: no scene root, or the path leads out of it (`where` is "path"); not_found; as above
  [[nodiscard]] Result<SceneInfo> add_path(const std::string& path, const std::string& name,
                                           const Uploader& uploader = {});

  [[nodiscard]] std::vector<SceneInfo> list() const;
  [[nodiscard]] Result<SceneInfo> find(const std::string& id) const;
  struct Patch {
    std::optional<std::string> name;
    std::optional<std::optional<engine::DVec3>> up;  ///< Present but empty: removes what was set.
  };
  [[nodiscard]] Result<SceneInfo> patch(const std::string& id, const Patch& patch);
  /// Whoever holds a version keeps it in memory; the files are gone.
  [[nodiscard]] Result<void> remove(const std::string& id);

  /// Replaces the dataset: from a zip file, which is unpacked into the store, or a folder below the scene root, which
  /// is used where it is. Whoever holds the one before keeps its photos.
  ///   errors  those of io::read_dataset(); a zip: corrupt_data, unsupported (encrypted), too_large (names the limit),
  ///           invalid_argument: an entry that leads out of the folder, a link (`where` is "data.zip:entry name");
  ///           quota_exceeded: unpacked, it is beyond what the uploader may store
  [[nodiscard]] Result<SceneInfo> put_dataset_zip(const std::string& id, const std::filesystem::path& zip,
                                                  const std::string& filename, const Uploader& uploader = {});
  [[nodiscard]] Result<SceneInfo> put_dataset_path(const std::string& id, const std::string& path);
  /// Takes the dataset away. Whoever holds it keeps its photos.
  ///   errors  not_found: there is none (`where` is "dataset")
  [[nodiscard]] Result<SceneInfo> remove_dataset(const std::string& id);
  /// The dataset without its points; null without one.
  [[nodiscard]] Result<std::shared_ptr<const engine::io::Dataset>> dataset(const std::string& id);
  /// A photo of a dataset, as io::load_photo() gives it. Somebody who may write below the scene root may have put a
  /// link in its place: what leads out of the root, and of the store, is not shown.
  ///   errors  unavailable: it is not there any more, or leads elsewhere; those of io::load_photo() without a message
  ///           of this machine's
  [[nodiscard]] Result<engine::scene::Image> load_photo(const engine::io::View& view);
  /// Notes what a comparison of renders with photos found; nothing for figures, if no photo could be compared.
  ///   dataset  its number: what is found about a dataset that has been replaced meanwhile is dropped
  [[nodiscard]] Result<SceneInfo> set_dataset_quality(const std::string& id, int dataset, std::optional<double> mean_db,
                                                      std::optional<double> worst_db, const std::string& worst_view,
                                                      std::vector<std::string> warnings);

  /// A version ("0", "1", ...) or a preview ("p000001") in memory, read from disk if need be; others that nobody holds
  /// make room.
  ///   errors  not_found; busy: it does not fit the memory budget beside what is in use; too_large: it alone does not;
  ///           those of io
  [[nodiscard]] Result<LoadedVersion> load(const std::string& id, const std::string& version);
  /// Writes down what an edit has made, durable when this returns. Nobody sees it before it is taken in: whether it
  /// becomes a version is for others to say (server/edits). For an edit whose version the scene has it tells of that.
  ///   attempt  tells this attempt at the edit from all others
  ///   overlay  over the parent
  ///   errors   those of load(); no_space
  [[nodiscard]] Result<MadeVersion> make_version(const std::string& id, int parent, const std::string& edit,
                                                 std::int64_t attempt, const engine::scene::Overlay& overlay);
  /// Makes that a version of its scene, durable when this returns: its number. Nothing where that was done before, by
  /// whatever process, even if the version has been deleted since.
  [[nodiscard]] Result<int> take_in(const std::string& id, const MadeVersion& made);
  /// What was made and not taken in, by the names of its files: "<edit>-<attempt>".
  [[nodiscard]] std::vector<std::string> made_versions() const;
  void discard_made(const std::string& made);
  /// What is known of a version, as find() has it among all of its scene. A preview is none.
  ///   errors  not_found
  [[nodiscard]] Result<VersionInfo> find_version(const std::string& id, const std::string& version) const;
  /// Calls a version by a name, or by none ("").
  ///   errors  not_found; invalid_argument: no name for a scene either (`where` is "name")
  [[nodiscard]] Result<VersionInfo> rename_version(const std::string& id, const std::string& version,
                                                   const std::string& name);
  /// Deletes a version for good, durable when this returns; its number is not used again. Those that were made from it
  /// are said to have been made from its parent, and stay as they are. Whoever holds it keeps it in memory.
  ///   errors  not_found; conflict: version 0, which all others lie over
  [[nodiscard]] Result<void> remove_version(const std::string& id, const std::string& version);
  /// A version that lives in memory only, for a while. It is dropped early where others need its place.
  [[nodiscard]] Result<Preview> add_preview(const std::string& id, int parent, const engine::scene::Overlay& overlay);

  /// A version as a file for download; made on demand, kept as a cache.
  ///   errors  those of load(); those of io::write_scene()
  [[nodiscard]] Result<VersionFile> file(const std::string& id, const std::string& version, FileFormat format);

  struct Usage {
    std::size_t scenes = 0, previews = 0;
    std::uint64_t memory_bytes = 0;  ///< Clouds, overlays and previews together.
    std::uint64_t memory_budget = 0;
  };
  [[nodiscard]] Usage usage() const;

 private:
  struct Impl;
  explicit SceneStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::scenes
