#include "server/scenes/catalogue/catalogue.h"

#include <algorithm>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/core/atomic_file.h"
#include "engine/core/numbers.h"
#include "engine/io/read_bytes.h"
#include "server/scenes/disk/digest.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

constexpr const char* counter_name = "next_scene";  ///< Holds the number of the next scene.
constexpr char id_kind = 's';
/// What is skipped where only the scenes that are left tell how many there have been: the ids of those removed last are
/// not to be given away again. A choice.
constexpr std::uint64_t skipped_numbers = 1000;
/// Its bytes are what processes lock that share the folder: that of a scene's number, and the first for the counter.
constexpr const char* writers_name = ".writers";
constexpr std::uint64_t lock_of_counter = 0;
/// What they lock who bring in what counts for a quota.
constexpr const char* quotas_name = ".quotas";
/// So long a change waits for others of the same scene: many times what one takes. A choice.
constexpr std::chrono::seconds others_are_done_within{10};

/// The number in the counter's file, which releases before checksums wrote alone; nothing for any other text.
std::optional<std::uint64_t> counted(std::string_view text) {
  if (!text.ends_with('\n')) return std::nullopt;
  text.remove_suffix(1);
  const std::size_t space = text.find(' ');
  const std::string_view number = text.substr(0, space);
  if (space != std::string_view::npos && text.substr(space + 1) != digest_of(number)) return std::nullopt;
  const auto found = engine::number_in<std::uint64_t>(number);
  return found && *found > 0 ? found : std::nullopt;
}
std::optional<std::uint64_t> read_count(const fs::path& folder) {
  const auto bytes = engine::io::read_bytes(folder / counter_name, 64);
  return bytes ? counted({reinterpret_cast<const char*>(bytes->data()), bytes->size()}) : std::nullopt;
}

/// Folder of the dataset that was unpacked into the scene's; empty if there is none.
fs::path unpacked_folder(const Manifest& manifest) {
  if (!manifest.dataset || manifest.dataset->below_root) return {};
  return *fs::path(manifest.dataset->folder).begin();
}
std::shared_ptr<Lease> lease_of_dataset(const Manifest& manifest, const fs::path& folder) {
  const fs::path unpacked = unpacked_folder(manifest);
  return unpacked.empty() ? nullptr : std::make_shared<Lease>(folder / unpacked);
}

/// What a manifest does not name in its scene's folder.
std::vector<fs::path> leftovers_in(const fs::path& folder, const Manifest& manifest) {
  std::error_code ignored;
  std::set<fs::path> named{manifest_name, manifest.base};
  for (const VersionInfo& version : manifest.scene.versions)
    if (version.version > 0) named.insert(overlay_name(version.version));
  if (const fs::path unpacked = unpacked_folder(manifest); !unpacked.empty()) {
    named.insert(unpacked);
    if (!manifest.dataset->list_digest.empty()) named.insert(dataset_list_name(*manifest.dataset));
  }
  std::vector<fs::path> leftovers;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const fs::path name = entry.path().filename();
    if (name != "versions" && !named.contains(name)) leftovers.push_back(entry.path());
  }
  for (const auto& entry : fs::directory_iterator(folder / "versions", ignored))
    if (!named.contains("versions" / entry.path().filename())) leftovers.push_back(entry.path());
  return leftovers;
}

}  // namespace

bool is_scene_id(const std::string& name) { return engine::number_of_id(id_kind, name).has_value(); }

bool counter_is_sound(const fs::path& folder) { return read_count(folder).has_value(); }

void Catalogue::read_counter() {
  if (const auto number = read_count(folder_)) {
    next_scene_ = std::max(next_scene_, *number);
    return;
  }
  std::error_code ignored;
  if (next_scene_ == 1 && !fs::exists(folder_ / counter_name, ignored)) return;  // a new folder
  next_scene_ += skipped_numbers;
  recovered_.push_back({ErrorCode::corrupt_data,
                        "the number of the next scene cannot be read; numbers go on from " +
                            std::to_string(next_scene_) + ", above all scenes there are",
                        std::string("scenes/") + counter_name});
}

/// A scene as it was left, without what a crash left beside it.
void Catalogue::take_up(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / removed_manifest_name, ignored)) {
    if (is_alone()) remove_renamed(folder);
    return;
  }
  auto manifest = read_manifest(folder);
  if (!manifest &&
      manifest.error().code == ErrorCode::not_found)  // as in half a backup: nobody removes it but a person
    manifest = fail(ErrorCode::corrupt_data, "the scene's folder has no " + std::string(manifest_name),
                    (folder.filename() / manifest_name).string());
  if (manifest && manifest->scene.id != folder.filename())
    manifest = fail(ErrorCode::corrupt_data, "the folder holds scene " + manifest->scene.id, folder.filename());
  if (manifest && !fs::is_regular_file(folder / manifest->base, ignored))
    manifest = fail(ErrorCode::corrupt_data, "the scene's file is gone", folder.filename() / manifest->base);
  if (!manifest) return damaged_.push_back(manifest.error());  // left as it is: somebody may want to save it
  if (is_alone())
    for (const fs::path& leftover : leftovers_in(folder, *manifest)) remove_quietly(leftover);
  const std::lock_guard lock(mutex_);
  (void)put(std::move(*manifest), std::nullopt);
}

Snapshot Catalogue::put(Manifest manifest, std::optional<FileStamp> stamp) {
  const fs::path folder = folder_ / manifest.scene.id;
  std::shared_ptr<CatalogueEntry>& scene = scenes_[manifest.scene.id];
  auto lease = lease_of_dataset(manifest, folder);
  if (!scene || scene->manifest->nonce != manifest.nonce) {
    scene = std::make_shared<CatalogueEntry>(std::move(manifest), folder, std::move(lease));
  } else {
    // Whoever holds the folder of a dataset keeps it from being removed, by this process.
    const bool is_the_same = lease && scene->dataset_folder && lease->path() == scene->dataset_folder->path();
    if (!is_the_same) scene->dataset_folder = std::move(lease);
    scene->manifest = std::make_shared<const Manifest>(std::move(manifest));
  }
  scene->stamp = stamp;
  return {scene, scene->manifest, scene->dataset_folder};
}

Result<Snapshot> Catalogue::look_again(const std::string& id) {
  const auto unknown = [&] {
    const std::lock_guard lock(mutex_);
    scenes_.erase(id);
    return fail(ErrorCode::not_found, "there is no scene " + id, "scene");
  };
  if (!is_scene_id(id)) return unknown();
  const auto stamp = stamp_of(folder_ / id / manifest_name);  // before it is read, see is_settled()
  if (!stamp && stamp.error().code == ErrorCode::not_found) return unknown();
  if (!stamp) return public_error_(stamp);
  {
    const std::lock_guard lock(mutex_);
    const auto known = scenes_.find(id);
    if (known != scenes_.end() && known->second->stamp == *stamp)
      return Snapshot{known->second, known->second->manifest, known->second->dataset_folder};
  }
  auto manifest = read_manifest(folder_ / id);
  if (!manifest && manifest.error().code == ErrorCode::not_found) return unknown();
  if (!manifest) return public_error_(manifest);
  const std::lock_guard lock(mutex_);
  return put(std::move(*manifest), is_settled(*stamp) ? std::optional(*stamp) : std::nullopt);
}

void Catalogue::look_around() {
  std::set<std::string> there;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder_, error); !error && entry != fs::end(entry); entry.increment(error))
    if (std::string name = entry->path().filename(); is_scene_id(name)) there.insert(std::move(name));
  if (error) return;  // whoever looks at a scene meets it again
  for (const std::string& id : there) (void)look_again(id);
  const std::lock_guard lock(mutex_);
  std::erase_if(scenes_, [&](const auto& known) { return !there.contains(known.first); });
}

Result<void> Catalogue::open() {
  if (auto status = make_folder(folder_); !status) return status;
  if (auto synced = engine::sync_folder(folder_.parent_path()); !synced) return synced;
  auto locked = FolderLock::take(folder_, sharing_);
  if (!locked) return propagate(locked);
  folder_lock_ = std::move(*locked);
  std::vector<fs::path> folders, removed;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder_, error); !error && entry != fs::end(entry); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(removed_prefix)) removed.push_back(entry->path());
    const auto number = engine::number_of_id(id_kind, name);
    if (!number) continue;
    next_scene_ = std::max(next_scene_, *number + 1);
    folders.push_back(entry->path());
  }
  if (error) return tl::make_unexpected(engine::file_error(error.value(), "read", folder_));
  read_counter();
  if (is_alone())
    for (const fs::path& folder : removed) remove_quietly(folder);
  for (const fs::path& folder : folders) take_up(folder);
  return {};
}

Result<Snapshot> Catalogue::snapshot(const std::string& id) {
  if (sharing_ == Sharing::shared) return look_again(id);
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  if (found == scenes_.end()) return fail(ErrorCode::not_found, "there is no scene " + id, "scene");
  return Snapshot{found->second, found->second->manifest, found->second->dataset_folder};
}

bool Catalogue::has(const Snapshot& at) {
  if (sharing_ == Sharing::shared) (void)look_again(at.scene->id);
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(at.scene->id);
  return found != scenes_.end() && found->second == at.scene;
}

std::vector<ManifestPtr> Catalogue::manifests() {
  if (sharing_ == Sharing::shared) look_around();
  std::vector<ManifestPtr> all;
  const std::lock_guard lock(mutex_);
  for (const auto& [id, scene] : scenes_) all.push_back(scene->manifest);
  return all;
}

std::size_t Catalogue::size() {
  if (sharing_ == Sharing::shared) look_around();
  const std::lock_guard lock(mutex_);
  return scenes_.size();
}

Catalogue::Reservation::~Reservation() {
  if (catalogue_ == nullptr) return;
  const std::lock_guard lock(catalogue_->mutex_);
  --catalogue_->reserved_;
}

Result<Catalogue::Reservation> Catalogue::reserve() {
  if (sharing_ == Sharing::shared) look_around();
  const std::lock_guard lock(mutex_);
  if (scenes_.size() + reserved_ >= max_scenes_)
    return fail(ErrorCode::too_large, "there are " + std::to_string(scenes_.size()) +
                                          " scenes, as many as the limit (--max-scenes) allows: delete one first");
  ++reserved_;
  return Reservation(*this);
}

Result<std::optional<engine::FileLock>> Catalogue::lock_out_others(std::uint64_t number) const {
  if (sharing_ == Sharing::alone) return std::nullopt;
  auto lock = engine::FileLock::take(folder_ / writers_name, number, engine::LockKind::alone, others_are_done_within);
  if (!lock) return public_error_(lock);
  return std::optional(std::move(*lock));
}

Result<Catalogue::Writing> Catalogue::begin_to_write(CatalogueEntry& scene) {
  std::unique_lock here(scene.writer);
  auto among_processes = lock_out_others(engine::number_of_id(id_kind, scene.id).value_or(lock_of_counter));
  if (!among_processes) return propagate(among_processes);
  return Writing{std::move(here), std::move(*among_processes)};
}

Result<std::uint64_t> Catalogue::next_number() {
  const std::lock_guard lock(counter_writer_);
  const auto among_processes = lock_out_others(lock_of_counter);
  if (!among_processes) return propagate(among_processes);
  if (sharing_ == Sharing::shared) next_scene_ = std::max(next_scene_, read_count(folder_).value_or(1));
  const std::string number = std::to_string(next_scene_ + 1), text = number + " " + digest_of(number) + "\n";
  if (auto written = engine::write_file(folder_ / counter_name, std::as_bytes(std::span(text))); !written)
    return propagate(written);
  return next_scene_++;
}

std::uint64_t Catalogue::bytes_of(const std::string& uploader) {
  std::uint64_t bytes = 0;
  for (const ManifestPtr& manifest : manifests()) {
    if (manifest->scene.uploader == uploader) bytes += manifest->base_disk_bytes;
    if (manifest->dataset && manifest->dataset->uploader == uploader) bytes += manifest->dataset->disk_bytes;
  }
  return bytes;
}

Result<Catalogue::QuotaHold> Catalogue::hold_quota(const Uploader& uploader, std::uint64_t bytes, std::uint64_t freed) {
  if (!uploader.max_bytes) return QuotaHold{};
  QuotaHold hold{std::unique_lock(quota_), std::nullopt};
  if (sharing_ == Sharing::shared) {
    auto lock = engine::FileLock::take(folder_ / quotas_name, 0, engine::LockKind::alone, others_are_done_within);
    if (!lock) return public_error_(lock);
    hold.among_processes = std::move(*lock);
  }
  const std::uint64_t stored = bytes_of(uploader.name);
  if (stored - std::min(freed, stored) + bytes <= *uploader.max_bytes) return hold;
  return fail(ErrorCode::quota_exceeded,
              uploader.name + " may store " + std::to_string(*uploader.max_bytes) +
                  " bytes of scenes and datasets, has " + std::to_string(stored) + ", and this takes " +
                  std::to_string(bytes) + ": delete a scene first",
              "bytes");
}

Result<Snapshot> Catalogue::add(Manifest manifest, const fs::path& base_file, const fs::path& staging,
                                std::optional<std::uint64_t> max_bytes) {
  const auto number = next_number();
  if (!number) return public_error_(number);
  const std::string id = manifest.scene.id = engine::numbered_id(id_kind, *number);
  // Everything is on disk before the folder gets its name.
  const fs::path whole = staging / "scene", folder = folder_ / id;
  if (auto status = make_folder(whole); !status) return public_error_(status, staging);
  if (auto moved = move_durably(base_file, whole / manifest.base); !moved) return public_error_(moved, staging);
  if (auto synced = sync_file(whole / manifest.base); !synced) return public_error_(synced, staging);
  if (auto written = write_manifest(whole, manifest); !written) return public_error_(written, staging);
  const auto quota = hold_quota({manifest.scene.uploader, max_bytes}, manifest.base_disk_bytes);
  if (!quota) return propagate(quota);
  if (auto moved = move_durably(whole, folder); !moved) {
    remove_renamed(folder);
    return public_error_(moved, staging);
  }
  const std::lock_guard lock(mutex_);
  return put(std::move(manifest), std::nullopt);
}

Result<ManifestPtr> Catalogue::change(const Snapshot& at, const std::function<Result<void>(Manifest&)>& change,
                                      std::shared_ptr<Lease>* dataset_folder) {
  const auto writing = begin_to_write(*at.scene);
  if (!writing) return propagate(writing);
  const auto current = snapshot(at.scene->id);  // not removed meanwhile, and nobody else changes it now
  if (!current) return propagate(current);
  auto manifest = std::make_shared<Manifest>(*current->manifest);
  if (auto changed = change(*manifest); !changed) return propagate(changed);
  const auto written = write_manifest(at.scene->folder->path(), *manifest);
  // What the next start would find is what counts, even if it was not known to be on disk.
  if (!written && !is_written(at.scene->folder->path(), *manifest)) return public_error_(written);
  {
    const std::lock_guard lock(mutex_);
    current->scene->manifest = manifest;
    current->scene->stamp.reset();
    if (dataset_folder) std::swap(current->scene->dataset_folder, *dataset_folder);
  }
  if (!written) return public_error_(written);
  return manifest;
}

Result<void> Catalogue::remove(const std::string& id) {
  const auto at = snapshot(id);
  if (!at) return propagate(at);
  const auto writing = begin_to_write(*at->scene);
  if (!writing) return propagate(writing);
  if (const auto still = snapshot(id); !still) return propagate(still);
  // Marked by its manifest's name: should we be killed now, the next start removes it.
  const fs::path folder = at->scene->folder->path();
  if (auto marked = move_durably(folder / manifest_name, folder / removed_manifest_name); !marked)
    return public_error_(marked);
  {
    const std::lock_guard lock(mutex_);
    scenes_.erase(id);
  }
  at->scene->folder->end();
  return {};
}

}  // namespace server::scenes
