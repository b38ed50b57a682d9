// The scenes a service holds: on disk, and as much of them in memory as its budget allows.
//
//     <data-dir>/scenes/next_scene            number of the next scene
//     <data-dir>/scenes/<id>/scene.json       manifest: name, up, versions, dataset; replaced as a whole
//                           base.*            the file as it was uploaded: version 0
//                           versions/<v>.overlay   what version v changes, over version 0
//                           dataset.<n>/      cameras and photos, unpacked from a zip file
//                           files/            versions as files for download; a cache
//
// A manifest is written last, to a temporary name, synced and renamed: what it does not name is not there, and is
// removed at the next start.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/io/dataset.h"
#include "engine/io/read_options.h"
#include "engine/io/scene_file.h"
#include "engine/scene/overlay.h"

namespace server::scenes {

using engine::Result;
using Time = std::chrono::sys_time<std::chrono::milliseconds>;

struct StoreOptions {
  std::filesystem::path folder;                              ///< <data-dir>/scenes
  std::filesystem::path scene_root;                          ///< Files may be opened below it; empty: none may.
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;       ///< Budget of clouds, overlays and previews in memory.
  std::uint64_t max_dataset_bytes = std::uint64_t{8} << 30;  ///< Unpacked.
  std::size_t max_dataset_files = 20'000;
  std::uint64_t file_cache_bytes = std::uint64_t{8} << 30;  ///< Of versions written for download; those in use may
                                                            ///< exceed it.
  std::size_t max_scenes = 1000;
  std::size_t max_previews = 16;
  std::chrono::seconds preview_lifetime{600};  ///< Since it was last looked at.
  engine::io::ReadOptions read = {};           ///< Its max_memory_bytes becomes `memory_bytes`.
  std::string program_version = {};  ///< Part of all keys: another version may write or draw a scene differently.
  std::function<Time()> clock = {};  ///< Empty: the machine's.
};

/// One link of a scene's chain. Version 0 is the file as it came.
struct VersionInfo {
  int version = 0;
  std::optional<int> parent;  ///< None for version 0.
  std::string edit;           ///< Id of the edit that made it; empty for version 0.
  Time created{};
  std::size_t gaussians = 0;
  std::uint64_t disk_bytes = 0;  ///< Of what this version needs beside version 0.
};

struct DatasetInfo {
  std::string kind;  ///< "colmap", "transforms", "inria"
  std::size_t views = 0, photos = 0;
  std::optional<double> psnr_mean_db;  ///< Renders of version 0 against photos; none without photos.
  std::optional<double> psnr_worst_db;
  std::string psnr_worst_view;
  std::vector<std::string> warnings;
  int number = 0;  ///< Which of the scene's datasets, one after the other, it is; not kept in a manifest.
};

struct SceneInfo {
  std::string id;  ///< "s000001": counts up, never used twice.
  std::string name;
  Time created{};
  std::string format;  ///< "ply", "splat", "spz", "compressed_ply"
  int sh_degree = 0;
  engine::DVec3 low{0.0}, high{0.0};  ///< Box of the means, world units.
  engine::DVec3 centre{0.0};          ///< Median of the means.
  double radius = 0;                  ///< Half of the means are nearer to the centre than this.
  std::optional<engine::DVec3> up;    ///< As the user set it.
  std::uint64_t disk_bytes = 0;
  std::uint64_t memory_bytes = 0;  ///< Held in memory right now.
  std::optional<DatasetInfo> dataset;
  std::vector<VersionInfo> versions;  ///< By number.
};

/// A version in memory. Holding it keeps it there.
struct LoadedVersion {
  engine::scene::LayeredCloud cloud;
  std::string key;  ///< Names these very Gaussians, as this version of the program reads and draws them, for ever,
                    ///< across restarts: for ETags.
};

enum class FileFormat { ply, splat, spz };

/// Safe to call from any thread. `where` of errors: "scene" for an unknown id, "version" for an unknown version, the
/// file's own address where a file is to blame. Memory that others use is `busy`. Errors name no folder of this
/// machine, except those of open().
class SceneStore {
 public:
  [[nodiscard]] static Result<std::unique_ptr<SceneStore>> open(const StoreOptions& options);
  ~SceneStore();

  /// Scenes on disk that could not be taken up when the store was opened; their folders are left as they are: somebody
  /// may want to save them.
  [[nodiscard]] const std::vector<engine::Error>& damaged() const;

  /// A new, empty folder for an upload to go to, below the data folder; gone when the returned guard is.
  class Scratch {
   public:
    explicit Scratch(std::filesystem::path folder) : folder_(std::move(folder)) {}
    ~Scratch();
    Scratch(Scratch&& other) noexcept : folder_(std::exchange(other.folder_, {})) {}
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

   private:
    std::filesystem::path folder_;
  };
  [[nodiscard]] Result<Scratch> scratch();

  /// A new scene from an uploaded file, which is moved into the store. The file is read whole, once.
  ///   filename  as its user calls it, for the scene's name and for error addresses
  ///   errors    those of io::read_scene(); too_large: too many scenes, or one that the memory can never hold; busy
  [[nodiscard]] Result<SceneInfo> add_upload(const std::filesystem::path& file, const std::string& filename,
                                             const std::string& name);
  /// A new scene from a file below the scene root, which is copied.
  ///   errors  invalid_argument: no scene root, or the path leads out of it (`where` is "path"); not_found; as above
  [[nodiscard]] Result<SceneInfo> add_path(const std::string& path, const std::string& name);

  [[nodiscard]] std::vector<SceneInfo> list() const;
  [[nodiscard]] Result<SceneInfo> find(const std::string& id) const;
  struct Patch {
    std::optional<std::string> name;
    std::optional<std::optional<engine::DVec3>> up;  ///< Given as nothing: forget it.
  };
  [[nodiscard]] Result<SceneInfo> patch(const std::string& id, const Patch& patch);
  /// Whoever holds a version keeps it in memory; the files are gone.
  [[nodiscard]] Result<void> remove(const std::string& id);

  /// Replaces the dataset: from a zip file, which is unpacked into the store, or a folder below the scene root, which
  /// is used where it is. Whoever holds the one before keeps its photos.
  ///   errors  those of io::read_dataset(); a zip: corrupt_data, unsupported (encrypted), too_large (names the limit),
  ///           invalid_argument: an entry that leads out of the folder, a link (`where` is "data.zip:entry name")
  [[nodiscard]] Result<SceneInfo> put_dataset_zip(const std::string& id, const std::filesystem::path& zip,
                                                  const std::string& filename);
  [[nodiscard]] Result<SceneInfo> put_dataset_path(const std::string& id, const std::string& path);
  /// The dataset without its points; null without one.
  [[nodiscard]] Result<std::shared_ptr<const engine::io::Dataset>> dataset(const std::string& id);
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
  /// A new version, durable when this returns. Called again for the same edit, it gives back the version made before.
  ///   overlay  over the parent
  [[nodiscard]] Result<int> add_version(const std::string& id, int parent, const std::string& edit,
                                        const engine::scene::Overlay& overlay);
  /// A version that lives in memory only, for a while.
  ///   returns  "p000001"
  struct Preview {
    std::string version;
    Time expires;
  };
  [[nodiscard]] Result<Preview> add_preview(const std::string& id, int parent, const engine::scene::Overlay& overlay);

  /// A version as a file for download; made on demand, kept as a cache. `hold` keeps it from being removed.
  struct VersionFile {
    std::filesystem::path path;
    std::string etag, download_name;
    std::shared_ptr<const void> hold;
  };
  [[nodiscard]] Result<VersionFile> file(const std::string& id, const std::string& version, FileFormat format);

  struct Usage {
    std::size_t scenes = 0, previews = 0;
    std::uint64_t memory_bytes = 0;  ///< Of clouds, overlays and previews.
    std::uint64_t memory_budget = 0;
  };
  [[nodiscard]] Usage usage() const;

 private:
  struct Impl;
  explicit SceneStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::scenes
