// The datasets of scenes: cameras and photos, unpacked into the store or used where they are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/dataset.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/store_options.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/scratch.h"

namespace server::scenes {

/// How much less somebody has stored once the scene's dataset is another's.
[[nodiscard]] std::uint64_t freed_by_replacing(const Manifest& manifest, const Uploader& uploader);

/// Keeps what it has read of them in `memory`. Safe to call from any thread.
class Datasets {
 public:
  /// All outlive this.
  Datasets(const StoreOptions& options, BoundedCache& memory, Catalogue& catalogue, ScratchFolders& scratch,
           const PublicErrors& public_error)
      : options_(options), memory_(memory), catalogue_(catalogue), scratch_(scratch), public_error_(public_error) {}

  /// Replaces the scene's dataset by what is in a zip file, which is unpacked into the store; the new manifest.
  ///   uploader  who brings it in
  ///   errors    those of unzip() and io::read_dataset(); quota_exceeded: beyond what the uploader may store
  [[nodiscard]] Result<ManifestPtr> put_zip(const Snapshot& at, const std::filesystem::path& zip,
                                            const std::string& filename, const Uploader& uploader);
  /// Replaces it by a folder below the scene root, which is used where it is; the new manifest.
  ///   errors  those of below_root() and io::read_dataset()
  [[nodiscard]] Result<ManifestPtr> put_path(const Snapshot& at, const std::string& path);
  /// Takes the scene's dataset away; the new manifest. Whoever holds it keeps its photos; a folder below the scene root
  /// stays as it is.
  ///   errors  not_found: there is none (`where` is "dataset"); those of write_manifest()
  [[nodiscard]] Result<ManifestPtr> remove(const Snapshot& at);
  /// The dataset without its points; null without one.
  ///   errors  those of io::read_dataset(); busy; corrupt_data: a file of the dataset, photos apart, is not what was
  ///           stored
  [[nodiscard]] Result<std::shared_ptr<const engine::io::Dataset>> get(const Snapshot& at);
  /// Notes how near renders come to the photos, PSNR in dB; the new manifest.
  ///   dataset  its number: what is found about one that has been replaced meanwhile is dropped
  ///   errors   those of write_manifest()
  [[nodiscard]] Result<ManifestPtr> set_quality(const Snapshot& at, int dataset, std::optional<double> mean_db,
                                                std::optional<double> worst_db, const std::string& worst_view,
                                                std::vector<std::string> warnings);

 private:
  /// unpacked  if given: a folder, which becomes the scene's and which `location` is relative to
  /// list      of its files, as text
  [[nodiscard]] Result<ManifestPtr> replace(const Snapshot& at, const engine::io::Dataset& found,
                                            DatasetLocation location,
                                            const std::optional<std::filesystem::path>& unpacked,
                                            const std::string& list);

  const StoreOptions& options_;
  BoundedCache& memory_;
  Catalogue& catalogue_;
  ScratchFolders& scratch_;
  const PublicErrors& public_error_;
};

}  // namespace server::scenes
