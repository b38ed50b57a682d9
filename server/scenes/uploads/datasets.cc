#include "server/scenes/uploads/datasets.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <span>
#include <system_error>
#include <utility>

#include "engine/core/atomic_file.h"
#include "server/scenes/catalogue/names.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/disk/digest_list.h"
#include "server/scenes/disk/disk.h"
#include "server/scenes/uploads/scene_root.h"
#include "server/scenes/uploads/zip_folder.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

/// A dataset and what keeps its photos on disk.
struct HeldDataset {
  io::Dataset dataset;
  std::shared_ptr<Lease> folder;
};

std::uint64_t dataset_memory_bytes(std::size_t views) { return 1024 * std::uint64_t(views); }  // names and paths

/// The folder with the dataset in an unpacked zip file: people pack a folder, or what is in it.
fs::path dataset_root(fs::path folder) {
  static const std::set<std::string> parts{"sparse", "colmap", "images"};
  for (;;) {
    std::vector<fs::path> entries;
    std::error_code error;
    for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::end(entry);
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (name != "__MACOSX" && !name.starts_with(".")) entries.push_back(entry->path());
    }
    if (entries.size() != 1 || !fs::is_directory(entries[0], error) || parts.contains(entries[0].filename().string()))
      return folder;
    folder = entries[0];
  }
}

/// Holds the files of an unpacked dataset against their digests.
///   found  if given: its photos are left out; they are gigabytes, and are read once, right after they came
Result<void> check_files(const Snapshot& at, const io::Dataset* found) {
  const DatasetLocation& location = *at.manifest->dataset;
  if (location.list_digest.empty()) return {};
  const std::string list_name = dataset_list_name(location), folder = fs::path(location.folder).begin()->string();
  const auto list =
      read_digest_list(at.scene->folder->path() / list_name, location.list_digest, stored_name(at, list_name));
  if (!list) return propagate(list);
  std::set<fs::path> photos;
  if (found)
    for (const io::View& view : found->views) photos.insert(view.photo.lexically_normal());
  for (const auto& [name, digest] : *list) {
    const fs::path file = at.scene->folder->path() / folder / name;
    if (photos.contains(file.lexically_normal())) continue;
    if (auto sound = check_digest(file, digest, stored_name(at, folder + "/" + name)); !sound) return sound;
  }
  return {};
}

DatasetInfo about(const io::Dataset& found) {
  DatasetInfo about;
  about.kind = found.kind;
  about.views = found.views.size();
  about.photos = std::size_t(std::ranges::count_if(found.views, [](const auto& view) { return !view.photo.empty(); }));
  return about;
}

}  // namespace

std::uint64_t freed_by_replacing(const Manifest& manifest, const Uploader& uploader) {
  return manifest.dataset && manifest.dataset->uploader == uploader.name ? manifest.dataset->disk_bytes : 0;
}

Result<ManifestPtr> Datasets::put_zip(const Snapshot& at, const fs::path& zip, const std::string& filename,
                                      const Uploader& uploader) {
  const auto staging = scratch_.make();
  if (!staging) return propagate(staging);
  const fs::path into = staging->folder() / "dataset";
  if (auto status = make_folder(into); !status) return public_error_(status, staging->folder());
  const ZipLimits limits{.max_bytes = options_.max_dataset_bytes, .max_files = options_.max_dataset_files};
  if (auto unpacked = unzip(zip, safe_file_name(filename), into, limits); !unpacked)
    return public_error_(unpacked, into);
  const fs::path root = dataset_root(into);
  const auto found = io::read_dataset(root, {.points = false, .memory = options_.read.memory});
  if (!found) return public_error_(found, into);
  const auto digests = digests_below(into);
  if (!digests) return public_error_(digests, into);
  if (auto synced = sync_file_system(into); !synced) return public_error_(synced, staging->folder());
  const std::string list = to_text(*digests);
  const std::uint64_t bytes = bytes_below(into);
  const auto quota = catalogue_.hold_quota(uploader, bytes, freed_by_replacing(*at.manifest, uploader));
  if (!quota) return propagate(quota);
  return replace(at, *found, {root.lexically_relative(into).string(), false, bytes, digest_of(list), uploader.name},
                 into, list);
}

Result<ManifestPtr> Datasets::put_path(const Snapshot& at, const std::string& path) {
  const fs::path& scene_root = options_.scene_root;
  const auto folder = below_root(scene_root, path);
  if (!folder) return propagate(folder);
  if (auto links = check_links(scene_root, *folder, options_.max_dataset_files); !links) return propagate(links);
  auto found = io::read_dataset(*folder, {.points = false, .memory = options_.read.memory});
  if (!found) {
    if (found.error().where == folder->string()) found.error().where = "path";
    return public_error_(found);
  }
  for (const io::View& view : found->views)
    if (!view.photo.empty() && !lies_below(scene_root, view.photo))
      return fail(ErrorCode::invalid_argument, "the photo " + view.camera.name + " lies outside of the scene root",
                  "path");
  std::error_code error;
  const fs::path relative = folder->lexically_relative(fs::canonical(scene_root, error));
  return replace(at, *found, {relative.string(), true, 0, {}, {}}, std::nullopt, {});
}

Result<ManifestPtr> Datasets::replace(const Snapshot& at, const io::Dataset& found, DatasetLocation location,
                                      const std::optional<fs::path>& unpacked, const std::string& list) {
  std::shared_ptr<Lease> lease;  // of the new folder; once that is the scene's, of the one before
  std::shared_ptr<Lease> fresh;
  fs::path list_before;
  auto replaced = catalogue_.change(
      at,
      [&](Manifest& manifest) -> Result<void> {
        if (unpacked) {
          const fs::path name = "dataset." + std::to_string(manifest.next_dataset);
          const fs::path folder = at.scene->folder->path() / name;
          fresh = lease = std::make_shared<Lease>(folder);
          if (auto moved = move_durably(*unpacked, folder); !moved)
            return public_error_(moved, unpacked->parent_path());
          location.folder = (name / location.folder).lexically_normal().string();
          const fs::path list_file = at.scene->folder->path() / dataset_list_name(location);
          if (auto written = engine::write_file(list_file, std::as_bytes(std::span(list))); !written)
            return public_error_(written);
        }
        if (manifest.dataset) list_before = dataset_list_name(*manifest.dataset);
        ++manifest.next_dataset;
        manifest.dataset = location;
        manifest.scene.dataset = about(found);
        return {};
      },
      &lease);
  // After a change that failed, the new one goes, unless the manifest on disk names it: then both stay, since it may
  // still turn out that the old manifest is the one that is left.
  if (lease && (replaced || lease == fresh)) lease->end();
  if (replaced && !list_before.empty()) remove_quietly(at.scene->folder->path() / list_before);
  memory_.forget(at.scene->id + "/dataset");
  return replaced;
}

Result<ManifestPtr> Datasets::remove(const Snapshot& at) {
  std::shared_ptr<Lease> lease;  // once the change is made, of the folder that was the scene's
  fs::path list;
  auto changed = catalogue_.change(
      at,
      [&](Manifest& manifest) -> Result<void> {
        if (!manifest.dataset) return fail(ErrorCode::not_found, "the scene has no dataset", "dataset");
        list = dataset_list_name(*manifest.dataset);
        ++manifest.next_dataset;  // what is still being found out about it is then dropped
        manifest.dataset.reset();
        manifest.scene.dataset.reset();
        return {};
      },
      &lease);
  if (!changed) return changed;
  if (lease) lease->end();
  if (!list.empty()) remove_quietly(at.scene->folder->path() / list);
  memory_.forget(at.scene->id + "/dataset");
  return changed;
}

Result<std::shared_ptr<const io::Dataset>> Datasets::get(const Snapshot& at) {
  const Manifest& manifest = *at.manifest;
  if (!manifest.dataset) return std::shared_ptr<const io::Dataset>();
  const std::uint64_t bytes = dataset_memory_bytes(manifest.scene.dataset->views);
  const auto read = [&]() -> Result<BoundedCache::CachedObject> {
    fs::path folder = at.scene->folder->path() / manifest.dataset->folder;
    if (manifest.dataset->below_root) {
      auto below = below_root(options_.scene_root, manifest.dataset->folder);
      if (!below) return fail(below.error().code, "the dataset cannot be read: " + below.error().message, "dataset");
      folder = std::move(*below);
    }
    auto found = io::read_dataset(folder, {.points = false, .memory = options_.read.memory});
    // Also where it could not be read: damage is then the likely reason.
    if (auto sound = check_files(at, found ? &*found : nullptr); !sound) return propagate(sound);
    if (!found) return public_error_(found);
    return BoundedCache::CachedObject{
        std::make_shared<const HeldDataset>(HeldDataset{std::move(*found), at.dataset_folder}), bytes};
  };
  const std::string& id = at.scene->id;
  const std::string name = id + "/dataset." + std::to_string(manifest.next_dataset);
  const auto held = memory_.get<HeldDataset>(name, bytes, read);
  const auto now = catalogue_.snapshot(id);  // what is put into a cache too late is forgotten again, see has()
  if (!now || now->manifest->next_dataset != manifest.next_dataset) memory_.forget(name);
  if (!held) return propagate(held);
  return std::shared_ptr<const io::Dataset>(*held, &(*held)->dataset);
}

Result<ManifestPtr> Datasets::set_quality(const Snapshot& at, int dataset, std::optional<double> mean_db,
                                          std::optional<double> worst_db, const std::string& worst_view,
                                          std::vector<std::string> warnings) {
  return catalogue_.change(at, [&](Manifest& manifest) -> Result<void> {
    if (!manifest.scene.dataset) return fail(ErrorCode::not_found, "the scene has no dataset", "dataset");
    if (manifest.next_dataset - 1 != dataset) return {};
    DatasetInfo& about = *manifest.scene.dataset;
    about.psnr_mean_db = mean_db, about.psnr_worst_db = worst_db;
    about.psnr_worst_view = worst_view;
    about.warnings = std::move(warnings);
    return {};
  });
}

}  // namespace server::scenes
