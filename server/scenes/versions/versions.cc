#include "server/scenes/versions/versions.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "engine/core/atomic_file.h"
#include "engine/core/numbers.h"
#include "engine/io/overlay_file.h"
#include "server/scenes/catalogue/names.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/disk/disk.h"
#include "server/scenes/disk/scene_format.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::scene::GaussianCloud;
using engine::scene::LayeredCloud;
using engine::scene::Overlay;

/// A poisoned version is never kept.
Result<void> check_overlay(const Overlay& overlay, const GaussianCloud& base) {
  if (overlay.rows.sh_degree != base.sh_degree || overlay.rows.extra_stride != base.extra_stride)
    return fail(ErrorCode::internal, "the overlay was made for another scene", "rows");
  if (const auto bad = engine::scene::first_not_finite(overlay.rows))
    return fail(ErrorCode::internal, "the result holds NaN or infinity and is not kept", "rows" + *bad);
  return {};
}

/// "0 to 3, 7": the first dozen of runs.
std::string numbers_of(const std::vector<VersionInfo>& versions) {
  constexpr int most_runs = 12;
  std::string text;
  int runs = 0;
  for (std::size_t from = 0, to = 0; from < versions.size(); from = to + 1) {
    if (++runs > most_runs) return text + ", ...";
    for (to = from; to + 1 < versions.size() && versions[to + 1].version == versions[to].version + 1;) ++to;
    text += (text.empty() ? "" : ", ") + std::to_string(versions[from].version);
    if (to > from) text += " to " + std::to_string(versions[to].version);
  }
  return text;
}

Result<int> known_version(const Snapshot& at, const std::string& version) {
  const auto number = engine::number_in<int>(version);
  if (number && place_of(*at.manifest, *number) && std::to_string(*number) == version) return *number;
  return fail(ErrorCode::not_found,
              "scene " + at.scene->id + " has no version " + safe_file_name(version) + "; there are " +
                  numbers_of(at.manifest->scene.versions),
              "version");
}

/// The name of a version's overlay in the cache. No other one's begins so.
std::string cached_name(const std::string& scene, int version) {
  return scene + "/" + std::to_string(version) + ".overlay";
}

/// The version that an edit has made.
std::optional<int> made_by(const std::string& edit, const Manifest& manifest) {
  for (const VersionInfo& version : manifest.scene.versions)
    if (version.version > 0 && !edit.empty() && version.edit == edit) return version.version;
  return std::nullopt;
}

std::shared_ptr<const GaussianCloud> cloud_of(const std::shared_ptr<const io::SceneFile>& file) {
  return {file, &file->cloud};
}

}  // namespace

void Versions::forget_if_removed(const Snapshot& at, int version) {
  if (!catalogue_.has(at)) return memory_.forget(at.scene->id + "/");
  if (!is_still_there(at, version)) memory_.forget(cached_name(at.scene->id, version));
}

bool Versions::is_still_there(const Snapshot& at, int version) const {
  const auto now = catalogue_.snapshot(at.scene->id);
  return now && place_of(*now->manifest, version);
}

bool Versions::has(const Snapshot& at, const std::string& version) const {
  const auto number = engine::number_in<int>(version);
  return number && is_still_there(at, *number);
}

Result<void> Versions::check(const Snapshot& at, int version, RunningDigest& seen) {
  const Manifest& manifest = *at.manifest;
  const std::string name = version == 0 ? manifest.base : overlay_name(version);
  const std::string& digest =
      version == 0 ? manifest.base_digest : manifest.overlay_digests[place_of(manifest, version).value()];
  const fs::path file = at.scene->folder->path() / name;
  if (!digest.empty()) return seen.check(file, digest, stored_name(at, name));
  const auto found = digest_of_file(file);
  if (!found) return public_error_(found);
  // Where it cannot be noted now, it is next time.
  (void)catalogue_.change(at, [&](Manifest& changed) -> Result<void> {
    if (const auto place = place_of(changed, version))
      (version == 0 ? changed.base_digest : changed.overlay_digests[*place]) = *found;
    return {};
  });
  return {};
}

Result<std::shared_ptr<const io::SceneFile>> Versions::base(const Snapshot& at) {
  const Manifest& manifest = *at.manifest;
  const auto read = [&]() -> Result<BoundedCache::CachedObject> {
    RunningDigest seen;
    io::ReadOptions reading = options_.read;
    reading.witness = [&](std::uint64_t offset, std::span<const std::byte> bytes) { seen.see(offset, bytes); };
    auto file = io::read_scene(at.scene->folder->path() / manifest.base, reading);
    // Also where it could not be read: damage is then the likely reason.
    if (auto sound = check(at, 0, seen); !sound) return propagate(sound);
    if (!file) return public_error_(file);
    const std::uint64_t bytes = memory_bytes(*file);
    if (file->cloud.size() != manifest.scene.versions[0].gaussians || bytes > manifest.base_memory_bytes)
      return fail(ErrorCode::corrupt_data, "the scene's file is not the one that was uploaded", manifest.base);
    return BoundedCache::CachedObject{std::make_shared<const io::SceneFile>(std::move(*file)), bytes};
  };
  auto held = memory_.get<io::SceneFile>(at.scene->id + "/base", manifest.base_memory_bytes, read);
  forget_if_removed(at);
  return held;
}

Result<std::shared_ptr<const Overlay>> Versions::overlay(const Snapshot& at, int version, const GaussianCloud& base) {
  if (version == 0) return std::shared_ptr<const Overlay>();
  const std::uint64_t expected = at.manifest->overlay_memory_bytes[place_of(*at.manifest, version).value()];
  const auto read = [&]() -> Result<BoundedCache::CachedObject> {
    RunningDigest seen;
    if (auto sound = check(at, version, seen); !sound) return propagate(sound);
    auto rows = io::read_overlay(at.scene->folder->path() / overlay_name(version), base);
    if (!rows) return public_error_(rows);
    const std::uint64_t bytes = engine::scene::memory_bytes(*rows);
    return BoundedCache::CachedObject{std::make_shared<const Overlay>(std::move(*rows)), bytes};
  };
  auto held = memory_.get<Overlay>(cached_name(at.scene->id, version), expected, read);
  forget_if_removed(at, version);
  if (held) return held;
  const auto now = catalogue_.snapshot(at.scene->id);
  if (now && !place_of(*now->manifest, version))  // its file went while it was read
    return propagate(known_version(*now, std::to_string(version)));
  return held;
}

Result<VersionInfo> Versions::find(const Snapshot& at, const std::string& version) {
  const auto number = known_version(at, version);
  if (!number) return propagate(number);
  return at.manifest->scene.versions[place_of(*at.manifest, *number).value()];
}

Result<LoadedVersion> Versions::load(const Snapshot& at, const std::string& version) {
  if (is_preview(version)) return load_preview(at, version);
  const auto number = known_version(at, version);
  if (!number) return propagate(number);
  const auto file = base(at);
  if (!file) return propagate(file);
  auto rows = overlay(at, *number, (*file)->cloud);
  if (!rows) return propagate(rows);
  const std::string& program = options_.program_release;
  return LoadedVersion{
      {cloud_of(*file), std::move(*rows)},
      at.scene->id + "-" + at.manifest->nonce + "-" + version + (program.empty() ? "" : "-") + program};
}

Result<LoadedVersion> Versions::load_preview(const Snapshot& at, const std::string& preview) {
  auto held = previews_.find(at.scene->id, preview);
  if (!held)
    return fail(
        ErrorCode::not_found,
        "scene " + at.scene->id + " has no preview " + safe_file_name(preview) + ": it has expired, ask for a new one",
        "version");
  const auto file = base(at);
  if (!file) return propagate(file);
  return LoadedVersion{{cloud_of(*file), std::move(held->overlay)}, std::move(held->key)};
}

/// An overlay over a version as one over version 0.
Result<Versions::OverBase> Versions::over_base(const Snapshot& at, int parent, const Overlay& overlay) {
  const auto lower = load(at, std::to_string(parent));
  if (!lower) return propagate(lower);
  const LayeredCloud& below = lower->cloud;
  if (auto sound = check_overlay(overlay, *below.base); !sound) return propagate(sound);
  // The rows of both at most, and as many lists of rows.
  auto reservation = memory_.reserve(engine::scene::memory_bytes(overlay) +
                                     (below.overlay ? engine::scene::memory_bytes(*below.overlay) : 0));
  if (!reservation) return propagate(reservation);
  auto composed = below.overlay ? engine::scene::compose(below.base->size(), *below.overlay, overlay) : overlay;
  const std::uint64_t bytes = engine::scene::memory_bytes(composed);
  return OverBase{std::make_shared<const Overlay>(std::move(composed)), bytes, below.base, std::move(*reservation)};
}

Result<MadeVersion> Versions::make(const Snapshot& at, int parent, const std::string& edit, std::int64_t attempt,
                                   const Overlay& overlay) {
  MadeVersion made;
  made.version.version = at.manifest->next_version;
  made.version.parent = parent;
  made.version.edit = edit;
  made.version.created = options_.clock();
  if (const auto before = made_by(edit, *at.manifest)) {
    made.version.version = *before;
    return made;
  }
  auto composed = over_base(at, parent, overlay);
  if (!composed) return propagate(composed);
  const Overlay& rows = *composed->overlay;
  const fs::path folder = folder_of_made();
  if (auto ready = make_folder(folder); !ready) return public_error_(ready);
  made.file = edit + "-" + std::to_string(attempt);
  const fs::path file = folder / made.file;
  if (auto written = io::write_overlay(file, rows, *composed->base); !written) return public_error_(written, folder);
  auto digest = digest_of_file(file);
  if (!digest) return public_error_(digest, folder);
  made.digest = std::move(*digest);
  made.version.gaussians = composed->base->size() - rows.removed.size() + rows.added();
  made.version.disk_bytes = bytes_below(file);
  made.memory_bytes = composed->bytes;
  return made;
}

Result<int> Versions::take_in(const Snapshot& at, const MadeVersion& made) {
  int number = made.version.version;
  const fs::path waiting = folder_of_made() / made.file, folder = at.scene->folder->path();
  const auto is_waiting = [&] {
    std::error_code ignored;
    return !made.file.empty() && fs::exists(waiting, ignored);
  };
  if (!is_waiting()) return number;
  const auto changed = catalogue_.change(at, [&](Manifest& manifest) -> Result<void> {
    // By another thread or process meanwhile; or killed after its manifest was written.
    if (const auto before = made_by(made.version.edit, manifest)) {
      number = *before;
      return {};
    }
    if (!is_waiting()) return {};
    number = std::max(number, manifest.next_version);
    const fs::path file = folder / overlay_name(number);
    if (auto ready = make_folder(file.parent_path()); !ready) return public_error_(ready);
    // Its first name goes once the manifest names the second: a process may be killed in between.
    if (auto linked = link_durably(waiting, file); !linked) return public_error_(linked, folder);
    if (auto synced = engine::sync_folder(folder); !synced) return public_error_(synced);
    manifest.next_version = number + 1;
    VersionInfo version = made.version;
    version.version = number;
    if (!place_of(manifest, *version.parent)) version.parent = 0;  // it was deleted meanwhile, as remove() would say
    manifest.scene.versions.push_back(std::move(version));
    manifest.overlay_memory_bytes.push_back(made.memory_bytes);
    manifest.overlay_digests.push_back(made.digest);
    return {};
  });
  if (!changed) return propagate(changed);
  discard(made.file);
  return number;
}

std::vector<std::string> Versions::made() const {
  std::vector<std::string> names;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder_of_made(), error); !error && entry != fs::end(entry);
       entry.increment(error))
    if (std::string name = entry->path().filename(); !name.starts_with(engine::temporary_prefix))
      names.push_back(std::move(name));
  std::ranges::sort(names);
  return names;
}

void Versions::remove_half_made() const {
  std::error_code error;
  std::vector<fs::path> found;
  for (auto entry = fs::directory_iterator(folder_of_made(), error); !error && entry != fs::end(entry);
       entry.increment(error))
    if (entry->path().filename().string().starts_with(engine::temporary_prefix)) found.push_back(entry->path());
  for (const fs::path& file : found) remove_quietly(file);
}

void Versions::discard(const std::string& made) const { remove_quietly(folder_of_made() / made); }

Result<VersionInfo> Versions::rename(const Snapshot& at, const std::string& version, const std::string& name) {
  const auto number = known_version(at, version);
  if (!number) return propagate(number);
  VersionInfo renamed;
  const auto changed = catalogue_.change(at, [&](Manifest& manifest) -> Result<void> {
    const auto place = place_of(manifest, *number);
    if (!place) return fail(ErrorCode::not_found, "version " + version + " was deleted meanwhile", "version");
    manifest.scene.versions[*place].name = name;
    renamed = manifest.scene.versions[*place];
    return {};
  });
  if (!changed) return propagate(changed);
  return renamed;
}

Result<void> Versions::remove(const Snapshot& at, const std::string& version) {
  const auto number = known_version(at, version);
  if (!number) return propagate(number);
  if (*number == 0)
    return fail(ErrorCode::conflict, "all versions lie over version 0: delete the scene to be rid of it", "version");
  const auto changed = catalogue_.change(at, [&](Manifest& manifest) -> Result<void> {
    const auto place = place_of(manifest, *number);
    if (!place) return {};  // by another thread meanwhile
    auto& versions = manifest.scene.versions;
    const auto parent = versions[*place].parent;
    for (VersionInfo& other : versions)
      if (other.parent == *number) other.parent = parent;
    const auto offset = std::ptrdiff_t(*place);
    versions.erase(versions.begin() + offset);
    manifest.overlay_memory_bytes.erase(manifest.overlay_memory_bytes.begin() + offset);
    manifest.overlay_digests.erase(manifest.overlay_digests.begin() + offset);
    return {};
  });
  if (!changed) return propagate(changed);
  // What cannot be removed now is no longer named, and goes at the next start.
  remove_quietly(at.scene->folder->path() / overlay_name(*number));
  memory_.forget(cached_name(at.scene->id, *number));
  return {};
}

Result<Preview> Versions::add_preview(const Snapshot& at, int parent, const Overlay& overlay) {
  previews_.expire();
  auto composed = over_base(at, parent, overlay);
  if (!composed) return propagate(composed);
  auto preview = previews_.add(at, {composed->overlay, composed->bytes}, std::move(composed->reservation));
  if (const auto still = catalogue_.snapshot(at.scene->id); !still) {  // removed meanwhile
    previews_.forget(at.scene->id, preview.version);
    return propagate(still);
  }
  return preview;
}

}  // namespace server::scenes
