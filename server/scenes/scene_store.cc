#include "server/scenes/scene_store.h"

#include <cmath>
#include <system_error>
#include <utility>

#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/names.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/public_errors.h"
#include "server/scenes/uploads/datasets.h"
#include "server/scenes/uploads/scene_root.h"
#include "server/scenes/uploads/uploads.h"
#include "server/scenes/versions/previews.h"
#include "server/scenes/versions/version_files.h"
#include "server/scenes/versions/versions.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::propagate;
using engine::scene::Overlay;

constexpr const char* scratch_name = ".scratch";

/// With what was left open filled in.
StoreOptions completed(StoreOptions options) {
  options.folder = fs::absolute(options.folder);
  options.read.max_memory_bytes = options.memory_bytes;
  if (!options.clock)
    options.clock = [] { return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now()); };
  return options;
}

/// A folder as errors spell it; empty if there is none.
fs::path real_path(const fs::path& folder) {
  std::error_code error;
  return fs::canonical(folder, error);
}

}  // namespace

/// The parts of the store; each gets those it works with.
struct SceneStore::Impl {
  explicit Impl(const StoreOptions& chosen)
      : options(completed(chosen)),
        memory(options.memory_bytes, "the scene memory (--scene-memory)", WhenFull::refuse),
        files(options.file_cache_bytes, "the cache of downloads", WhenFull::exceed) {}

  const StoreOptions options;
  BoundedCache memory, files;
  const PublicErrors public_error{{options.folder, real_path(options.scene_root)}};
  ScratchFolders scratch{options.folder / scratch_name, random_nonce() + "-", public_error};
  Catalogue catalogue{options.folder, options.sharing, options.max_scenes, public_error};
  Previews previews{options, memory, files};
  Versions versions{options, memory, catalogue, previews, public_error};
  VersionFiles version_files{files, memory, catalogue, previews, versions, public_error};
  Datasets datasets{options, memory, catalogue, scratch, public_error};
  Uploads uploads{options, memory, catalogue, scratch, public_error};

  /// What the manifest keeps, and what follows from it.
  SceneInfo info(const Manifest& manifest) {
    SceneInfo about = manifest.scene;
    about.disk_bytes = manifest.base_disk_bytes + (manifest.dataset ? manifest.dataset->disk_bytes : 0);
    for (const VersionInfo& version : about.versions) about.disk_bytes += version.disk_bytes;
    about.memory_bytes = memory.used_by(about.id + "/");
    if (about.dataset) about.dataset->number = manifest.next_dataset - 1;
    return about;
  }
  Result<SceneInfo> info(const Result<ManifestPtr>& manifest) {
    if (!manifest) return propagate(manifest);
    return info(**manifest);
  }

  void forget(const std::string& id) {
    previews.forget_all_of(id);
    memory.forget(id + "/");
    files.forget(id + "/");
  }

  /// What `work` makes of a scene as it is now.
  template <class Work>
  auto with(const std::string& id, Work work) -> decltype(work(std::declval<const Snapshot&>())) {
    const auto at = catalogue.snapshot(id);
    if (!at && at.error().code == engine::ErrorCode::not_found) forget(id);  // another process may have removed it
    if (!at) return propagate(at);
    return work(*at);
  }
};

SceneStore::SceneStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneStore::~SceneStore() = default;

Result<std::unique_ptr<SceneStore>> SceneStore::open(const StoreOptions& options) {
  auto impl = std::make_unique<Impl>(options);
  if (auto opened = impl->catalogue.open(); !opened) return propagate(opened);
  if (auto opened = impl->scratch.open(impl->catalogue.is_alone()); !opened) return propagate(opened);
  if (impl->catalogue.is_alone()) impl->versions.remove_half_made();
  return std::unique_ptr<SceneStore>(new SceneStore(std::move(impl)));
}

bool SceneStore::is_alone() const { return impl_->catalogue.is_alone(); }

void SceneStore::let_others_in() { impl_->catalogue.let_others_in(); }

const std::vector<engine::Error>& SceneStore::damaged() const { return impl_->catalogue.damaged(); }

const std::vector<engine::Error>& SceneStore::recovered() const { return impl_->catalogue.recovered(); }

Result<Scratch> SceneStore::scratch() { return impl_->scratch.make(); }

Result<void> SceneStore::check_quota(const Uploader& uploader, std::uint64_t bytes, const std::string& replaced) const {
  if (!uploader.max_bytes) return {};
  std::uint64_t freed = 0;
  if (!replaced.empty())
    if (const auto at = impl_->catalogue.snapshot(replaced)) freed = freed_by_replacing(*at->manifest, uploader);
  const auto fits = impl_->catalogue.hold_quota(uploader, bytes, freed);
  if (!fits) return propagate(fits);
  return {};
}

std::uint64_t SceneStore::bytes_of(const std::string& uploader) const { return impl_->catalogue.bytes_of(uploader); }

Result<SceneInfo> SceneStore::add_upload(const fs::path& file, const std::string& filename, const std::string& name,
                                         const Uploader& uploader) {
  return impl_->info(impl_->uploads.add(file, filename, name, uploader));
}

Result<SceneInfo> SceneStore::add_path(const std::string& path, const std::string& name, const Uploader& uploader) {
  return impl_->info(impl_->uploads.add_path(path, name, uploader));
}

std::vector<SceneInfo> SceneStore::list() const {
  std::vector<SceneInfo> all;
  for (const auto& manifest : impl_->catalogue.manifests()) all.push_back(impl_->info(*manifest));
  return all;
}

Result<SceneInfo> SceneStore::find(const std::string& id) const {
  return impl_->with(id, [&](const Snapshot& at) -> Result<SceneInfo> { return impl_->info(*at.manifest); });
}

Result<SceneInfo> SceneStore::patch(const std::string& id, const Patch& patch) {
  return impl_->with(id, [&](const Snapshot& at) -> Result<SceneInfo> {
    if (patch.name)
      if (auto name = checked_name(*patch.name); !name) return propagate(name);
    if (patch.up && *patch.up)
      if (const double length = glm::length(**patch.up); !(length > 0 && std::isfinite(length)))
        return engine::fail(engine::ErrorCode::invalid_argument,
                            "expected a direction, three numbers that are not all 0", "up");
    return impl_->info(impl_->catalogue.change(at, [&](Manifest& manifest) -> Result<void> {
      if (patch.name) manifest.scene.name = *patch.name;
      if (patch.up) manifest.scene.up = *patch.up;
      return {};
    }));
  });
}

Result<void> SceneStore::remove(const std::string& id) {
  if (auto removed = impl_->catalogue.remove(id); !removed) return removed;
  impl_->forget(id);
  return {};
}

Result<SceneInfo> SceneStore::put_dataset_zip(const std::string& id, const fs::path& zip, const std::string& filename,
                                              const Uploader& uploader) {
  return impl_->info(
      impl_->with(id, [&](const Snapshot& at) { return impl_->datasets.put_zip(at, zip, filename, uploader); }));
}

Result<SceneInfo> SceneStore::put_dataset_path(const std::string& id, const std::string& path) {
  return impl_->info(impl_->with(id, [&](const Snapshot& at) { return impl_->datasets.put_path(at, path); }));
}

Result<SceneInfo> SceneStore::remove_dataset(const std::string& id) {
  return impl_->info(impl_->with(id, [&](const Snapshot& at) { return impl_->datasets.remove(at); }));
}

Result<std::shared_ptr<const engine::io::Dataset>> SceneStore::dataset(const std::string& id) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->datasets.get(at); });
}

Result<engine::scene::Image> SceneStore::load_photo(const engine::io::View& view) {
  const StoreOptions& options = impl_->options;
  const bool is_ours = lies_below(options.folder, view.photo) ||
                       (!options.scene_root.empty() && lies_below(options.scene_root, view.photo));
  if (!is_ours) return engine::fail(engine::ErrorCode::unavailable, "the photo is not where it was", "view");
  auto photo = engine::io::load_photo(view);
  if (photo) return photo;
  return engine::fail(photo.error().code, "the photo cannot be read", "view");
}

Result<SceneInfo> SceneStore::set_dataset_quality(const std::string& id, int dataset, std::optional<double> mean_db,
                                                  std::optional<double> worst_db, const std::string& worst_view,
                                                  std::vector<std::string> warnings) {
  return impl_->info(impl_->with(id, [&](const Snapshot& at) {
    return impl_->datasets.set_quality(at, dataset, mean_db, worst_db, worst_view, std::move(warnings));
  }));
}

Result<LoadedVersion> SceneStore::load(const std::string& id, const std::string& version) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->versions.load(at, version); });
}

Result<MadeVersion> SceneStore::make_version(const std::string& id, int parent, const std::string& edit,
                                             std::int64_t attempt, const Overlay& overlay) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->versions.make(at, parent, edit, attempt, overlay); });
}

Result<int> SceneStore::take_in(const std::string& id, const MadeVersion& made) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->versions.take_in(at, made); });
}

std::vector<std::string> SceneStore::made_versions() const { return impl_->versions.made(); }

void SceneStore::discard_made(const std::string& made) { impl_->versions.discard(made); }

Result<VersionInfo> SceneStore::find_version(const std::string& id, const std::string& version) const {
  return impl_->with(id, [&](const Snapshot& at) { return Versions::find(at, version); });
}

Result<VersionInfo> SceneStore::rename_version(const std::string& id, const std::string& version,
                                               const std::string& name) {
  return impl_->with(id, [&](const Snapshot& at) -> Result<VersionInfo> {
    if (!name.empty())
      if (auto checked = checked_name(name); !checked) return propagate(checked);
    return impl_->versions.rename(at, version, name);
  });
}

Result<void> SceneStore::remove_version(const std::string& id, const std::string& version) {
  auto removed = impl_->with(id, [&](const Snapshot& at) { return impl_->versions.remove(at, version); });
  if (removed) impl_->files.forget(id + "/" + version + ".");
  return removed;
}

Result<Preview> SceneStore::add_preview(const std::string& id, int parent, const Overlay& overlay) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->versions.add_preview(at, parent, overlay); });
}

Result<VersionFile> SceneStore::file(const std::string& id, const std::string& version, FileFormat format) {
  return impl_->with(id, [&](const Snapshot& at) { return impl_->version_files.get(at, version, format); });
}

SceneStore::Usage SceneStore::usage() const {
  const std::size_t previews = impl_->previews.size();  // first: it forgets those whose time is over
  return {.scenes = impl_->catalogue.size(),
          .previews = previews,
          .memory_bytes = impl_->memory.used(),
          .memory_budget = impl_->memory.budget()};
}

}  // namespace server::scenes
