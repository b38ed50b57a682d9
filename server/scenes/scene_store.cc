#include "server/scenes/scene_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <charconv>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <span>
#include <string_view>
#include <system_error>

#include "engine/io/atomic_file.h"
#include "engine/io/file_descriptor.h"
#include "engine/io/overlay_file.h"
#include "engine/io/read_bytes.h"
#include "server/scenes/bounded_cache.h"
#include "server/scenes/disk.h"
#include "server/scenes/manifest.h"
#include "server/scenes/plain_error.h"
#include "server/scenes/scene_format.h"
#include "server/scenes/scene_root.h"
#include "server/scenes/scene_statistics.h"
#include "server/scenes/zip_folder.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::Error;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::scene::LayeredCloud;
using engine::scene::Overlay;

constexpr const char* scratch_name = ".scratch";
constexpr const char* lock_name = ".lock";
constexpr const char* counter_name = "next_scene";  ///< Holds the number of the next scene.
constexpr std::size_t max_name_bytes = 200;
constexpr std::uint64_t most_packed_bytes = 64;  ///< Per Gaussian, of a .splat or .spz file.

std::string numbered(char kind, std::uint64_t number) {
  const std::string digits = std::to_string(number);
  return kind + std::string(digits.size() < 6 ? 6 - digits.size() : 0, '0') + digits;
}

/// 7 of "s000007" or "7"; nothing for text that numbered() or std::to_string() does not write.
std::optional<std::uint64_t> number_in(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}
std::optional<std::uint64_t> number_of(char kind, const std::string& id) {
  const auto number = id.empty() || id.front() != kind ? std::nullopt : number_in(std::string_view(id).substr(1));
  return number && numbered(kind, *number) == id ? number : std::nullopt;
}

std::string random_nonce() {
  std::random_device device;
  constexpr std::string_view digits = "0123456789abcdef";
  std::string nonce;
  for (int i = 0; i < 16; ++i) nonce += digits[device() % digits.size()];
  return nonce;
}

bool is_control(unsigned char c) { return c < 0x20 || c == 0x7f; }

/// The base name of a file as a stranger calls it, fit for a folder and for messages.
std::string safe_file_name(const std::string& filename) {
  std::string name = filename.substr(filename.find_last_of("/\\") + 1);  // npos + 1 is 0
  std::replace_if(name.begin(), name.end(), is_control, '_');
  if (name.size() > max_name_bytes) {
    name = name.substr(name.size() - max_name_bytes);
    while ((static_cast<unsigned char>(name.front()) & 0xc0) == 0x80) name.erase(0, 1);  // the rest of a cut character
  }
  const bool usable = name.find_first_not_of('.') != std::string::npos;
  return usable ? name : "upload";
}

Result<std::string> checked_name(const std::string& name) {
  if (name.empty() || name.size() > max_name_bytes || std::any_of(name.begin(), name.end(), is_control))
    return fail(ErrorCode::invalid_argument,
                "expected a name of 1 to " + std::to_string(max_name_bytes) + " bytes without control characters",
                "name");
  return name;
}

/// The name asked for, else that of the file.
Result<std::string> name_for(const std::string& asked, const std::string& file_name) {
  if (!asked.empty()) return checked_name(asked);
  const std::string stem = fs::path(file_name).stem().string();
  return stem.empty() ? "scene" : stem;
}

tl::unexpected<Error> no_scene(const std::string& id) {
  return fail(ErrorCode::not_found, "there is no scene " + id, "scene");
}

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

std::uint64_t dataset_memory_bytes(std::size_t views) { return 1024 * std::uint64_t(views); }  // names and paths

/// A dataset and what keeps its photos on disk.
struct HeldDataset {
  io::Dataset dataset;
  std::shared_ptr<Lease> folder;
};

/// A file in a scene's folder that goes when nobody holds it.
struct HeldFile {
  HeldFile(std::shared_ptr<Lease> in, const fs::path& path) : scene(std::move(in)), file(path) { file.end(); }
  std::shared_ptr<Lease> scene;
  Lease file;
};

const char* extension_of(FileFormat format) {
  return format == FileFormat::ply ? "ply" : format == FileFormat::splat ? "splat" : "spz";
}
io::SceneFormat to_io(FileFormat format) {
  return format == FileFormat::ply     ? io::SceneFormat::ply
         : format == FileFormat::splat ? io::SceneFormat::splat
                                       : io::SceneFormat::spz;
}

/// A poisoned version is never kept.
Result<void> check_overlay(const Overlay& overlay, const engine::scene::GaussianCloud& base) {
  if (overlay.rows.sh_degree != base.sh_degree || overlay.rows.extra_stride != base.extra_stride)
    return fail(ErrorCode::internal, "the overlay was made for another scene", "rows");
  if (const auto bad = engine::scene::first_not_finite(overlay.rows))
    return fail(ErrorCode::internal, "the result holds NaN or infinity and is not kept", "rows" + *bad);
  return {};
}

struct Scene {
  Scene(Manifest about, const fs::path& path, std::shared_ptr<Lease> unpacked)
      : id(about.scene.id),
        folder(std::make_shared<Lease>(path)),
        manifest(std::make_shared<const Manifest>(std::move(about))),
        dataset_folder(std::move(unpacked)) {}

  const std::string id;
  const std::shared_ptr<Lease> folder;
  /// Whoever changes the manifest holds this from reading the old one until the new one is on disk, against the rule
  /// that no lock is held over I/O: two changes at once would lose one of them. Nobody who only reads ever waits for
  /// it.
  std::mutex writer;
  // Under the lock of the catalogue:
  std::shared_ptr<const Manifest> manifest;
  std::shared_ptr<Lease> dataset_folder;  ///< Of an unpacked dataset.
};

struct PreviewRecord {
  std::string scene, key;
  Time expires{};
};

}  // namespace

struct SceneStore::Impl {
  explicit Impl(const StoreOptions& chosen)
      : options(chosen),
        memory(chosen.memory_bytes, "the scene memory (--scene-memory)", WhenFull::refuse),
        files(chosen.file_cache_bytes, "the cache of downloads", WhenFull::exceed) {
    options.folder = fs::absolute(options.folder);
    options.read.max_memory_bytes = options.memory_bytes;
  }

  using ScenePtr = std::shared_ptr<Scene>;
  struct Snapshot {
    ScenePtr scene;
    std::shared_ptr<const Manifest> manifest;
    std::shared_ptr<Lease> dataset_folder;
  };

  // Start
  Result<void> start();
  Result<void> lock_folder();
  Result<void> read_counter();
  void take_up(const fs::path& folder);

  // Reading
  Time now() const {
    return options.clock ? options.clock()
                         : std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
  }
  Result<Snapshot> snapshot(const std::string& id) const;
  bool is_there(const Snapshot& at) const;
  bool has_preview(const std::string& preview) const;
  std::string key_of(const Snapshot& at, const std::string& version) const;
  /// An error on its way out: without the paths of this machine, and with limits called as they are set.
  ///   within  paths are relative to it, if given
  template <class T>
  tl::unexpected<Error> told(const Result<T>& failed, const fs::path& within = {}) const;
  SceneInfo info(const Manifest& manifest);
  Result<std::shared_ptr<const io::SceneFile>> base(const Snapshot& at);
  Result<std::shared_ptr<const Overlay>> overlay(const Snapshot& at, int version, const io::SceneFile& base_file);
  Result<LoadedVersion> load(const Snapshot& at, const std::string& version);
  Result<int> known_version(const Snapshot& at, const std::string& version) const;
  Result<LoadedVersion> load_preview(const Snapshot& at, const std::string& preview);
  struct OverBase {
    std::shared_ptr<const Overlay> overlay;
    std::uint64_t bytes = 0;
    std::shared_ptr<const engine::scene::GaussianCloud> base;
    BoundedCache::Room room;  ///< That of the overlay, until the cache takes it over.
  };
  Result<OverBase> over_base(const Snapshot& at, int parent, const Overlay& overlay);
  Result<VersionFile> write_file(const Snapshot& at, const std::string& version, const LoadedVersion& loaded,
                                 FileFormat format);
  void expire_previews();
  void forget_preview(const std::string& scene, const std::string& preview);

  // Writing
  struct Upload {
    std::shared_ptr<const io::SceneFile> file;
    BoundedCache::Room room;  ///< That of the cloud, until the cache takes it over.
  };
  Result<Upload> read_upload(const fs::path& file);
  Result<SceneInfo> add(const Scratch& staging, const fs::path& uploaded, const std::string& name);
  Result<std::uint64_t> next_id();
  /// dataset_folder  if given: that of the changed manifest, swapped for the one before
  Result<SceneInfo> update(const Snapshot& at, const std::function<Result<void>(Manifest&)>& change,
                           std::shared_ptr<Lease>* dataset_folder = nullptr);
  Result<SceneInfo> replace_dataset(const Snapshot& at, const io::Dataset& found, DatasetPlace place,
                                    const std::optional<fs::path>& unpacked);

  StoreOptions options;
  BoundedCache memory, files;
  io::FileDescriptor folder_lock;
  const std::string run = random_nonce();  ///< Previews of another run of the service are others.
  fs::path scene_root;                     ///< As errors spell it. Written by start() alone, as is
  std::vector<Error> damaged;

  mutable std::mutex mutex;  ///< Of the catalogue: what follows. Never held over I/O.
  std::map<std::string, ScenePtr> scenes;
  std::size_t adding = 0;  ///< Scenes on their way in.
  std::map<std::string, PreviewRecord> previews;
  std::uint64_t last_preview = 0;

  std::atomic<std::uint64_t> last_scratch{0}, last_file{0};
  /// Held while the number of the next scene goes to disk: it must not be written twice, nor go back.
  std::mutex counter_writer;
  std::uint64_t next_scene = 1;
  /// One upload at a time is read: how much memory a file takes shows only when it is there.
  std::mutex reading;
};

// --- start

Result<void> SceneStore::Impl::lock_folder() {
  folder_lock = io::FileDescriptor(::open((options.folder / lock_name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (folder_lock.get() < 0) return tl::make_unexpected(io::file_error(errno, "open", options.folder / lock_name));
  if (::flock(folder_lock.get(), LOCK_EX | LOCK_NB) != 0)
    return fail(ErrorCode::conflict, "another service uses this data folder: stop it, or choose another folder",
                options.folder.string());
  return {};
}

Result<void> SceneStore::Impl::read_counter() {
  const auto bytes = io::read_bytes(options.folder / counter_name, 64);
  if (!bytes && bytes.error().code == ErrorCode::not_found) return {};
  if (!bytes) return propagate(bytes);
  std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  if (text.ends_with('\n')) text.remove_suffix(1);
  const auto number = number_in(text);
  if (!number || *number == 0)
    return fail(ErrorCode::corrupt_data,
                "expected the number of the next scene: write one above all scenes there have been", counter_name);
  next_scene = std::max(next_scene, *number);
  return {};
}

/// A scene as it was left, without what a crash left beside it.
void SceneStore::Impl::take_up(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / removed_manifest_name, ignored)) return remove_renamed(folder);
  auto manifest = read_manifest(folder);
  if (!manifest &&
      manifest.error().code == ErrorCode::not_found)  // as in half a backup: nobody removes it but a person
    manifest = fail(ErrorCode::corrupt_data, "the scene's folder has no " + std::string(manifest_name),
                    (folder.filename() / manifest_name).string());
  if (manifest && manifest->scene.id != folder.filename())
    manifest = fail(ErrorCode::corrupt_data, "the folder holds scene " + manifest->scene.id, folder.filename());
  if (manifest && !fs::is_regular_file(folder / manifest->base, ignored))
    manifest = fail(ErrorCode::corrupt_data, "the scene's file is gone", folder.filename() / manifest->base);
  if (!manifest) return damaged.push_back(manifest.error());  // left as it is: somebody may want to save it

  std::set<fs::path> named{manifest_name, manifest->base};
  for (const VersionInfo& version : manifest->scene.versions)
    if (version.version > 0) named.insert(overlay_name(version.version));
  fs::path unpacked;
  if (manifest->dataset && !manifest->dataset->below_root) {
    unpacked = *fs::path(manifest->dataset->folder).begin();
    named.insert(unpacked);
  }
  std::vector<fs::path> leftovers;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const fs::path name = entry.path().filename();
    if (name != "versions" && !named.contains(name)) leftovers.push_back(entry.path());
  }
  for (const auto& entry : fs::directory_iterator(folder / "versions", ignored))
    if (!named.contains("versions" / entry.path().filename())) leftovers.push_back(entry.path());
  for (const fs::path& leftover : leftovers) remove_quietly(leftover);

  auto lease = unpacked.empty() ? nullptr : std::make_shared<Lease>(folder / unpacked);
  const std::string id = manifest->scene.id;
  scenes[id] = std::make_shared<Scene>(std::move(*manifest), folder, std::move(lease));
}

Result<void> SceneStore::Impl::start() {
  if (auto made = make_folder(options.folder / scratch_name); !made) return made;
  if (auto synced = sync_folder(options.folder.parent_path()); !synced) return synced;
  if (auto locked = lock_folder(); !locked) return locked;
  remove_quietly(options.folder / scratch_name);
  if (auto made = make_folder(options.folder / scratch_name); !made) return made;
  if (auto read = read_counter(); !read) return read;
  std::vector<fs::path> folders, removed;
  std::error_code error;
  scene_root = fs::canonical(options.scene_root, error);
  error.clear();
  for (auto entry = fs::directory_iterator(options.folder, error); !error && entry != fs::end(entry);
       entry.increment(error)) {
    if (entry->path().filename().string().starts_with(removed_prefix)) removed.push_back(entry->path());
    const auto number = number_of('s', entry->path().filename().string());
    if (!number) continue;
    next_scene = std::max(next_scene, *number + 1);
    folders.push_back(entry->path());
  }
  if (error) return tl::make_unexpected(io::file_error(error.value(), "read", options.folder));
  for (const fs::path& folder : removed) remove_quietly(folder);
  for (const fs::path& folder : folders) take_up(folder);
  return {};
}

// --- reading

Result<SceneStore::Impl::Snapshot> SceneStore::Impl::snapshot(const std::string& id) const {
  const std::lock_guard lock(mutex);
  const auto found = scenes.find(id);
  if (found == scenes.end()) return no_scene(id);
  return Snapshot{found->second, found->second->manifest, found->second->dataset_folder};
}

/// What is put into a cache for a snapshot may be too late: remove() and others forget first, and once. So whoever has
/// put something there asks this, and forgets it again.
bool SceneStore::Impl::is_there(const Snapshot& at) const {
  const std::lock_guard lock(mutex);
  const auto found = scenes.find(at.scene->id);
  return found != scenes.end() && found->second == at.scene;
}

bool SceneStore::Impl::has_preview(const std::string& preview) const {
  const std::lock_guard lock(mutex);
  return previews.contains(preview);
}

std::string SceneStore::Impl::key_of(const Snapshot& at, const std::string& version) const {
  const std::string& program = options.program_version;
  return at.scene->id + "-" + at.manifest->nonce + "-" + version + (program.empty() ? "" : "-") + program;
}

template <class T>
tl::unexpected<Error> SceneStore::Impl::told(const Result<T>& failed, const fs::path& within) const {
  Error error = failed.error();
  for (const fs::path& folder : {within, options.folder, scene_root}) error = without_folder(std::move(error), folder);
  constexpr std::array<std::pair<std::string_view, std::string_view>, 2> limits{
      std::pair{"(max_gaussians)", "(--max-gaussians)"}, {"(max_memory_bytes)", "(--scene-memory)"}};
  for (const auto& [engines, ours] : limits)
    if (const auto at = error.message.find(engines); at != std::string::npos)
      error.message.replace(at, engines.size(), ours);
  return tl::make_unexpected(std::move(error));
}

SceneInfo SceneStore::Impl::info(const Manifest& manifest) {
  SceneInfo about = manifest.scene;
  about.disk_bytes = manifest.base_disk_bytes + (manifest.dataset ? manifest.dataset->disk_bytes : 0);
  for (const VersionInfo& version : about.versions) about.disk_bytes += version.disk_bytes;
  about.memory_bytes = memory.used_by(about.id + "/");
  if (about.dataset) about.dataset->number = manifest.next_dataset - 1;
  return about;
}

Result<std::shared_ptr<const io::SceneFile>> SceneStore::Impl::base(const Snapshot& at) {
  const Manifest& manifest = *at.manifest;
  const auto read = [&]() -> Result<BoundedCache::Made> {
    auto file = io::read_scene(at.scene->folder->path() / manifest.base, options.read);
    if (!file) return told(file);
    const std::uint64_t bytes = memory_bytes(*file);
    if (file->cloud.size() != manifest.scene.versions[0].gaussians || bytes > manifest.base_memory_bytes)
      return fail(ErrorCode::corrupt_data, "the scene's file is not the one that was uploaded", manifest.base);
    return BoundedCache::Made{std::make_shared<const io::SceneFile>(std::move(*file)), bytes};
  };
  auto held = memory.get<io::SceneFile>(at.scene->id + "/base", manifest.base_memory_bytes, read);
  if (!is_there(at)) memory.forget(at.scene->id + "/");
  return held;
}

Result<std::shared_ptr<const Overlay>> SceneStore::Impl::overlay(const Snapshot& at, int version,
                                                                 const io::SceneFile& base_file) {
  if (version == 0) return std::shared_ptr<const Overlay>();
  const std::uint64_t expected = at.manifest->overlay_memory_bytes[std::size_t(version)];
  const auto read = [&]() -> Result<BoundedCache::Made> {
    auto rows = io::read_overlay(at.scene->folder->path() / overlay_name(version), base_file.cloud);
    if (!rows) return told(rows);
    const std::uint64_t bytes = engine::scene::memory_bytes(*rows);
    return BoundedCache::Made{std::make_shared<const Overlay>(std::move(*rows)), bytes};
  };
  auto held = memory.get<Overlay>(at.scene->id + "/" + std::to_string(version), expected, read);
  if (!is_there(at)) memory.forget(at.scene->id + "/");
  return held;
}

Result<int> SceneStore::Impl::known_version(const Snapshot& at, const std::string& version) const {
  const auto number = number_in(version);
  const auto& versions = at.manifest->scene.versions;
  if (number && *number < versions.size() && std::to_string(*number) == version) return int(*number);
  return fail(ErrorCode::not_found,
              "scene " + at.scene->id + " has no version " + safe_file_name(version) + "; there are 0 to " +
                  std::to_string(versions.size() - 1),
              "version");
}

Result<LoadedVersion> SceneStore::Impl::load(const Snapshot& at, const std::string& version) {
  if (version.starts_with('p')) return load_preview(at, version);
  const auto number = known_version(at, version);
  if (!number) return propagate(number);
  auto file = base(at);
  if (!file) return propagate(file);
  auto rows = overlay(at, *number, **file);
  if (!rows) return propagate(rows);
  const std::shared_ptr<const engine::scene::GaussianCloud> cloud(*file, &(*file)->cloud);
  return LoadedVersion{{cloud, std::move(*rows)}, key_of(at, version)};
}

Result<LoadedVersion> SceneStore::Impl::load_preview(const Snapshot& at, const std::string& preview) {
  expire_previews();
  const auto gone = [&] {
    return fail(
        ErrorCode::not_found,
        "scene " + at.scene->id + " has no preview " + safe_file_name(preview) + ": it has expired, ask for a new one",
        "version");
  };
  std::string key;
  {
    const std::lock_guard lock(mutex);
    const auto record = previews.find(preview);
    if (record == previews.end() || record->second.scene != at.scene->id) return gone();
    record->second.expires = now() + options.preview_lifetime;
    key = record->second.key;
  }
  auto rows = memory.find<Overlay>(at.scene->id + "/" + preview);
  if (!rows) {  // made room for something else
    forget_preview(at.scene->id, preview);
    return gone();
  }
  auto file = base(at);
  if (!file) return propagate(file);
  const std::shared_ptr<const engine::scene::GaussianCloud> cloud(*file, &(*file)->cloud);
  return LoadedVersion{{cloud, std::move(rows)}, std::move(key)};
}

void SceneStore::Impl::forget_preview(const std::string& scene, const std::string& preview) {
  {
    const std::lock_guard lock(mutex);
    previews.erase(preview);
  }
  memory.forget(scene + "/" + preview);
  files.forget(scene + "/" + preview);
}

void SceneStore::Impl::expire_previews() {
  std::vector<std::pair<std::string, std::string>> expired;
  {
    const std::lock_guard lock(mutex);
    const Time moment = now();
    for (const auto& [name, record] : previews)
      if (record.expires <= moment) expired.emplace_back(record.scene, name);
  }
  for (const auto& [scene, name] : expired) forget_preview(scene, name);
}

/// An overlay over a version as one over version 0.
Result<SceneStore::Impl::OverBase> SceneStore::Impl::over_base(const Snapshot& at, int parent, const Overlay& overlay) {
  const auto lower = load(at, std::to_string(parent));
  if (!lower) return propagate(lower);
  const LayeredCloud& below = lower->cloud;
  if (auto sound = check_overlay(overlay, *below.base); !sound) return propagate(sound);
  // The rows of both at most, and as many lists of rows.
  auto room = memory.room(engine::scene::memory_bytes(overlay) +
                          (below.overlay ? engine::scene::memory_bytes(*below.overlay) : 0));
  if (!room) return propagate(room);
  auto composed = below.overlay ? engine::scene::compose(below.base->size(), *below.overlay, overlay) : overlay;
  const std::uint64_t bytes = engine::scene::memory_bytes(composed);
  return OverBase{std::make_shared<const Overlay>(std::move(composed)), bytes, below.base, std::move(*room)};
}

Result<SceneStore::VersionFile> SceneStore::Impl::write_file(const Snapshot& at, const std::string& version,
                                                             const LoadedVersion& loaded, FileFormat format) {
  const std::string extension = extension_of(format);
  const auto layout_of = base(at);  // in memory, since `loaded` holds its cloud
  if (!layout_of) return propagate(layout_of);
  const auto write = [&]() -> Result<BoundedCache::Made> {
    const fs::path folder = at.scene->folder->path() / "files";
    if (auto made = make_folder(folder); !made) return told(made);
    // A name of its own: one of the same version that was dropped may be about to be removed.
    const fs::path path = folder / (version + "-" + std::to_string(++last_file) + "." + extension);
    const std::uint64_t flat_bytes = engine::scene::memory_bytes((*layout_of)->cloud) +
                                     (loaded.cloud.overlay ? engine::scene::memory_bytes(*loaded.cloud.overlay) : 0);
    const auto room = memory.room(flat_bytes);
    if (!room) return propagate(room);
    const io::SceneFile file{engine::scene::flatten(loaded.cloud), (*layout_of)->layout};
    if (auto written = io::write_scene(path, file, to_io(format)); !written) return told(written);
    return BoundedCache::Made{std::make_shared<const HeldFile>(at.scene->folder, path), bytes_below(path)};
  };
  const std::string name = at.scene->id + "/" + version + "." + extension;
  const std::uint64_t row_bytes = format == FileFormat::ply ? (*layout_of)->layout.vertex().stride : most_packed_bytes;
  const auto held = files.get<HeldFile>(name, loaded.cloud.size() * row_bytes, write);
  if (!is_there(at) || (version.starts_with('p') && !has_preview(version))) files.forget(name);
  if (!held) return propagate(held);
  return VersionFile{(*held)->file.path(), loaded.key + "-" + extension, {}, *held};
}

// --- writing

Result<std::uint64_t> SceneStore::Impl::next_id() {
  const std::lock_guard lock(counter_writer);
  const std::string text = std::to_string(next_scene + 1) + "\n";
  if (auto written = io::write_file(options.folder / counter_name, std::as_bytes(std::span(text))); !written)
    return propagate(written);
  return next_scene++;
}

/// The file, in memory that is counted before it is taken.
Result<SceneStore::Impl::Upload> SceneStore::Impl::read_upload(const fs::path& file) {
  const auto no_room = [&](Error error) {
    if (error.code == ErrorCode::too_large) error.where = file.filename().string();
    return tl::make_unexpected(std::move(error));
  };
  const std::uint64_t expected = expected_memory_bytes(file);
  auto room = std::make_optional(memory.room(expected));
  if (!*room) return no_room(room->error());
  // One at a time: what an .spz file unpacks to shows only when it is there.
  const std::lock_guard one_at_a_time(reading);
  auto read = io::read_scene(file, options.read);
  if (!read) return told(read, file.parent_path());
  const std::uint64_t bytes = memory_bytes(*read);
  if (bytes > expected) {
    room.reset();
    room.emplace(memory.room(bytes));
    if (!*room) return no_room(room->error());
  }
  return Upload{std::make_shared<const io::SceneFile>(std::move(*read)), std::move(**room)};
}

Result<SceneInfo> SceneStore::Impl::add(const Scratch& staging, const fs::path& uploaded, const std::string& name) {
  const auto called = name_for(name, uploaded.filename().string());
  if (!called) return propagate(called);
  auto upload = read_upload(uploaded);
  if (!upload) return propagate(upload);
  const auto format = detect_format(uploaded);
  if (!format) return told(format, uploaded.parent_path());
  const auto& file = upload->file;

  Manifest manifest;
  manifest.nonce = random_nonce();
  manifest.base = std::string("base.") + format->extension;
  manifest.base_disk_bytes = bytes_below(uploaded);
  manifest.base_memory_bytes = memory_bytes(*file);
  manifest.overlay_memory_bytes = {0};
  SceneInfo& scene = manifest.scene;
  const SceneStatistics measured = statistics(file->cloud);
  scene.name = *called;
  scene.created = now();
  scene.format = format->name;
  scene.sh_degree = file->cloud.sh_degree;
  scene.low = measured.low, scene.high = measured.high;
  scene.centre = measured.centre, scene.radius = measured.radius;
  VersionInfo& uploaded_version = scene.versions.emplace_back();
  uploaded_version.created = scene.created;
  uploaded_version.gaussians = file->cloud.size();

  const auto number = next_id();
  if (!number) return told(number);
  scene.id = numbered('s', *number);
  // Everything is on disk before the folder gets its name: it appears whole or not at all.
  const fs::path whole = staging.folder() / "scene", folder = options.folder / scene.id;
  if (auto made = make_folder(whole); !made) return told(made, staging.folder());
  if (auto moved = move_durably(uploaded, whole / manifest.base); !moved) return told(moved, staging.folder());
  if (auto synced = sync_file(whole / manifest.base); !synced) return told(synced, staging.folder());
  if (auto written = write_manifest(whole, manifest); !written) return told(written, staging.folder());
  if (auto moved = move_durably(whole, folder); !moved) {
    remove_renamed(folder);
    return told(moved, staging.folder());
  }
  const auto made = std::make_shared<Scene>(manifest, folder, nullptr);
  {
    const std::lock_guard lock(mutex);
    scenes[scene.id] = made;
  }
  memory.put(scene.id + "/base", {file, manifest.base_memory_bytes}, std::move(upload->room));
  if (!is_there({made, made->manifest, nullptr})) memory.forget(scene.id + "/");
  return info(manifest);
}

Result<SceneInfo> SceneStore::Impl::update(const Snapshot& at, const std::function<Result<void>(Manifest&)>& change,
                                           std::shared_ptr<Lease>* dataset_folder) {
  const std::lock_guard writer(at.scene->writer);
  const auto current = snapshot(at.scene->id);  // not removed meanwhile, and nobody else changes it now
  if (!current) return propagate(current);
  auto manifest = std::make_shared<Manifest>(*current->manifest);
  if (auto changed = change(*manifest); !changed) return propagate(changed);
  const auto written = write_manifest(at.scene->folder->path(), *manifest);
  // What the next start would find is what counts, even if it was not known to be on disk.
  if (!written && !is_written(at.scene->folder->path(), *manifest)) return told(written);
  {
    const std::lock_guard lock(mutex);
    at.scene->manifest = manifest;
    if (dataset_folder) std::swap(at.scene->dataset_folder, *dataset_folder);
  }
  if (!written) return told(written);
  return info(*manifest);
}

Result<SceneInfo> SceneStore::Impl::replace_dataset(const Snapshot& at, const io::Dataset& found, DatasetPlace place,
                                                    const std::optional<fs::path>& unpacked) {
  std::shared_ptr<Lease> lease;  // of the new folder; once that is the scene's, of the one before
  std::shared_ptr<Lease> fresh;
  auto replaced = update(
      at,
      [&](Manifest& manifest) -> Result<void> {
        if (unpacked) {
          const fs::path name = "dataset." + std::to_string(manifest.next_dataset);
          const fs::path folder = at.scene->folder->path() / name;
          fresh = lease = std::make_shared<Lease>(folder);
          if (auto moved = move_durably(*unpacked, folder); !moved) return told(moved, unpacked->parent_path());
          place.folder = (name / place.folder).lexically_normal().string();
        }
        ++manifest.next_dataset;
        DatasetInfo about;
        about.kind = found.kind;
        about.views = found.views.size();
        about.photos =
            std::size_t(std::ranges::count_if(found.views, [](const auto& view) { return !view.photo.empty(); }));
        manifest.dataset = place;
        manifest.scene.dataset = std::move(about);
        return {};
      },
      &lease);
  // After a change that failed, the new one goes, unless the manifest on disk names it: then both stay, since it may
  // still turn out that the old manifest is the one that is left.
  if (lease && (replaced || lease == fresh)) lease->end();
  memory.forget(at.scene->id + "/dataset");
  return replaced;
}

// --- interface

SceneStore::SceneStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneStore::~SceneStore() = default;

Result<std::unique_ptr<SceneStore>> SceneStore::open(const StoreOptions& options) {
  auto impl = std::make_unique<Impl>(options);
  if (auto started = impl->start(); !started) return propagate(started);
  return std::unique_ptr<SceneStore>(new SceneStore(std::move(impl)));
}

const std::vector<Error>& SceneStore::damaged() const { return impl_->damaged; }

SceneStore::Scratch::~Scratch() {
  if (!folder_.empty()) remove_quietly(folder_);
}

Result<SceneStore::Scratch> SceneStore::scratch() {
  const fs::path folder = impl_->options.folder / scratch_name / std::to_string(++impl_->last_scratch);
  if (auto made = make_folder(folder); !made) return impl_->told(made, folder);
  return Scratch(folder);
}

namespace {

/// Counts a scene on its way in, so that a thousand uploads at once do not pass the limit together.
class Place {
 public:
  Place(std::mutex& mutex, std::size_t& adding) : mutex_(mutex), adding_(adding) {}
  ~Place() {
    const std::lock_guard lock(mutex_);
    --adding_;
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

 private:
  std::mutex& mutex_;
  std::size_t& adding_;
};

}  // namespace

Result<SceneInfo> SceneStore::add_upload(const fs::path& file, const std::string& filename, const std::string& name) {
  {
    const std::lock_guard lock(impl_->mutex);
    if (impl_->scenes.size() + impl_->adding >= impl_->options.max_scenes)
      return fail(ErrorCode::too_large, "there are " + std::to_string(impl_->scenes.size()) +
                                            " scenes, as many as the limit (--max-scenes) allows: delete one first");
    ++impl_->adding;
  }
  const Place place(impl_->mutex, impl_->adding);
  const auto staging = scratch();
  if (!staging) return propagate(staging);
  // Under its user's name: that is what error addresses begin with.
  const fs::path folder = staging->folder() / "upload", uploaded = folder / safe_file_name(filename);
  if (auto made = make_folder(folder); !made) return impl_->told(made, folder);
  std::error_code error;
  fs::rename(file, uploaded, error);
  if (error)
    return impl_->told(Result<void>(tl::make_unexpected(io::file_error(error.value(), "take", uploaded))), folder);
  return impl_->add(*staging, uploaded, name);
}

Result<SceneInfo> SceneStore::add_path(const std::string& path, const std::string& name) {
  const auto found = below_root(impl_->options.scene_root, path);
  if (!found) return propagate(found);
  const auto staging = scratch();
  if (!staging) return propagate(staging);
  const fs::path copy = staging->folder() / "copy";
  if (auto copied = scenes::copy_file(*found, copy); !copied) {
    if (copied.error().where == found->string()) copied.error().where = "path";
    return impl_->told(copied, staging->folder());
  }
  return add_upload(copy, fs::path(path).filename().string(), name);
}

std::vector<SceneInfo> SceneStore::list() const {
  std::vector<std::shared_ptr<const Manifest>> manifests;
  {
    const std::lock_guard lock(impl_->mutex);
    for (const auto& [id, scene] : impl_->scenes) manifests.push_back(scene->manifest);
  }
  std::vector<SceneInfo> all;
  for (const auto& manifest : manifests) all.push_back(impl_->info(*manifest));
  return all;
}

Result<SceneInfo> SceneStore::find(const std::string& id) const {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  return impl_->info(*at->manifest);
}

Result<SceneInfo> SceneStore::patch(const std::string& id, const Patch& patch) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  if (patch.name)
    if (auto name = checked_name(*patch.name); !name) return propagate(name);
  if (patch.up && *patch.up)
    if (const double length = glm::length(**patch.up); !(length > 0 && std::isfinite(length)))
      return fail(ErrorCode::invalid_argument, "expected a direction, three numbers that are not all 0", "up");
  return impl_->update(*at, [&](Manifest& manifest) -> Result<void> {
    if (patch.name) manifest.scene.name = *patch.name;
    if (patch.up) manifest.scene.up = *patch.up;
    return {};
  });
}

Result<void> SceneStore::remove(const std::string& id) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const std::lock_guard writer(at->scene->writer);
  if (const auto still = impl_->snapshot(id); !still) return propagate(still);
  // Marked by its manifest's name: should we be killed now, the next start removes it.
  const fs::path folder = at->scene->folder->path();
  if (auto marked = move_durably(folder / manifest_name, folder / removed_manifest_name); !marked)
    return impl_->told(marked);
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->scenes.erase(id);
    std::erase_if(impl_->previews, [&](const auto& preview) { return preview.second.scene == id; });
  }
  at->scene->folder->end();  // removed once nobody reads from it any more
  impl_->memory.forget(id + "/");
  impl_->files.forget(id + "/");
  return {};
}

Result<SceneInfo> SceneStore::put_dataset_zip(const std::string& id, const fs::path& zip, const std::string& filename) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const auto staging = scratch();
  if (!staging) return propagate(staging);
  const fs::path into = staging->folder() / "dataset";
  if (auto made = make_folder(into); !made) return impl_->told(made, staging->folder());
  const ZipLimits limits{.max_bytes = impl_->options.max_dataset_bytes, .max_files = impl_->options.max_dataset_files};
  if (auto unpacked = unzip(zip, safe_file_name(filename), into, limits); !unpacked) return impl_->told(unpacked, into);
  const fs::path root = dataset_root(into);
  const auto found = io::read_dataset(root, {.points = false});
  if (!found) return impl_->told(found, into);
  if (auto synced = sync_file_system(into); !synced) return impl_->told(synced, staging->folder());
  return impl_->replace_dataset(*at, *found, {root.lexically_relative(into).string(), false, bytes_below(into)}, into);
}

Result<SceneInfo> SceneStore::put_dataset_path(const std::string& id, const std::string& path) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const fs::path& scene_root = impl_->options.scene_root;
  const auto folder = below_root(scene_root, path);
  if (!folder) return propagate(folder);
  if (auto links = check_links(scene_root, *folder, impl_->options.max_dataset_files); !links) return propagate(links);
  auto found = io::read_dataset(*folder, {.points = false});
  if (!found) {
    if (found.error().where == folder->string()) found.error().where = "path";
    return impl_->told(found);
  }
  for (const io::View& view : found->views)
    if (!view.photo.empty() && !lies_below(scene_root, view.photo))
      return fail(ErrorCode::invalid_argument, "the photo " + view.camera.name + " lies outside of the scene root",
                  "path");
  std::error_code error;
  const fs::path relative = folder->lexically_relative(fs::canonical(scene_root, error));
  return impl_->replace_dataset(*at, *found, {relative.string(), true, 0}, std::nullopt);
}

Result<std::shared_ptr<const io::Dataset>> SceneStore::dataset(const std::string& id) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const Manifest& manifest = *at->manifest;
  if (!manifest.dataset) return std::shared_ptr<const io::Dataset>();
  const std::uint64_t bytes = dataset_memory_bytes(manifest.scene.dataset->views);
  const auto read = [&]() -> Result<BoundedCache::Made> {
    fs::path folder = at->scene->folder->path() / manifest.dataset->folder;
    if (manifest.dataset->below_root) {
      auto below = below_root(impl_->options.scene_root, manifest.dataset->folder);
      if (!below) return fail(below.error().code, "the dataset cannot be read: " + below.error().message, "dataset");
      folder = std::move(*below);
    }
    auto found = io::read_dataset(folder, {.points = false});
    if (!found) return impl_->told(found);
    return BoundedCache::Made{std::make_shared<const HeldDataset>(HeldDataset{std::move(*found), at->dataset_folder}),
                              bytes};
  };
  const std::string name = id + "/dataset." + std::to_string(manifest.next_dataset);
  const auto held = impl_->memory.get<HeldDataset>(name, bytes, read);
  const auto now = impl_->snapshot(id);  // what is put into a cache too late is forgotten again, see is_there()
  if (!now || now->manifest->next_dataset != manifest.next_dataset) impl_->memory.forget(name);
  if (!held) return propagate(held);
  return std::shared_ptr<const io::Dataset>(*held, &(*held)->dataset);
}

Result<SceneInfo> SceneStore::set_dataset_quality(const std::string& id, int dataset, std::optional<double> mean_db,
                                                  std::optional<double> worst_db, const std::string& worst_view,
                                                  std::vector<std::string> warnings) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  return impl_->update(*at, [&](Manifest& manifest) -> Result<void> {
    if (!manifest.scene.dataset) return fail(ErrorCode::not_found, "the scene has no dataset", "dataset");
    if (manifest.next_dataset - 1 != dataset) return {};
    DatasetInfo& about = *manifest.scene.dataset;
    about.psnr_mean_db = mean_db, about.psnr_worst_db = worst_db;
    about.psnr_worst_view = worst_view;
    about.warnings = std::move(warnings);
    return {};
  });
}

Result<LoadedVersion> SceneStore::load(const std::string& id, const std::string& version) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  return impl_->load(*at, version);
}

Result<int> SceneStore::add_version(const std::string& id, int parent, const std::string& edit,
                                    const Overlay& overlay) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const auto made_before = [&](const Manifest& manifest) -> std::optional<int> {
    for (const VersionInfo& version : manifest.scene.versions)
      if (version.version > 0 && !edit.empty() && version.edit == edit) return version.version;
    return std::nullopt;
  };
  if (const auto before = made_before(*at->manifest)) return *before;
  auto composed = impl_->over_base(*at, parent, overlay);
  if (!composed) return propagate(composed);
  const auto& base = composed->base;
  const auto staging = scratch();
  if (!staging) return propagate(staging);
  const fs::path staged = staging->folder() / "overlay", versions = at->scene->folder->path() / "versions";
  if (auto written = io::write_overlay(staged, *composed->overlay, *base); !written)
    return impl_->told(written, staging->folder());
  int number = 0;
  const auto updated = impl_->update(*at, [&](Manifest& manifest) -> Result<void> {
    if (const auto before = made_before(manifest)) {  // by another thread meanwhile
      number = *before;
      return {};
    }
    number = int(manifest.scene.versions.size());
    const fs::path file = at->scene->folder->path() / overlay_name(number);
    if (auto ready = make_folder(versions); !ready) return impl_->told(ready);
    if (auto moved = move_durably(staged, file); !moved) return impl_->told(moved, staging->folder());
    if (auto synced = sync_folder(at->scene->folder->path()); !synced) return impl_->told(synced);
    const Overlay& made = *composed->overlay;
    const std::size_t gaussians = base->size() - made.removed.size() + made.added();
    manifest.scene.versions.push_back({.version = number,
                                       .parent = parent,
                                       .edit = edit,
                                       .created = impl_->now(),
                                       .gaussians = gaussians,
                                       .disk_bytes = bytes_below(file)});
    manifest.overlay_memory_bytes.push_back(composed->bytes);
    return {};
  });
  if (!updated) return propagate(updated);
  impl_->memory.put(id + "/" + std::to_string(number), {composed->overlay, composed->bytes}, std::move(composed->room));
  if (!impl_->is_there(*at)) impl_->memory.forget(id + "/");
  return number;
}

Result<SceneStore::Preview> SceneStore::add_preview(const std::string& id, int parent, const Overlay& overlay) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  impl_->expire_previews();
  auto composed = impl_->over_base(*at, parent, overlay);
  if (!composed) return propagate(composed);
  std::string name;
  std::optional<std::pair<std::string, std::string>> oldest;
  {
    const std::lock_guard lock(impl_->mutex);
    name = numbered('p', ++impl_->last_preview);
    if (impl_->previews.size() >= std::max<std::size_t>(impl_->options.max_previews, 1)) {
      const auto first = std::ranges::min_element(
          impl_->previews, {}, [](const auto& preview) { return std::pair(preview.second.expires, preview.first); });
      oldest.emplace(first->second.scene, first->first);
    }
  }
  if (oldest) impl_->forget_preview(oldest->first, oldest->second);
  const std::string key = id + "/" + name;
  impl_->memory.put(key, {composed->overlay, composed->bytes, false}, std::move(composed->room));
  const Time expires = impl_->now() + impl_->options.preview_lifetime;
  {
    const std::lock_guard lock(impl_->mutex);
    if (impl_->scenes.contains(id)) {
      impl_->previews[name] = {id, id + "-" + at->manifest->nonce + "-" + name + "-" + impl_->run, expires};
      return Preview{name, expires};
    }
  }
  impl_->memory.forget(key);  // the scene was removed meanwhile
  return no_scene(id);
}

Result<SceneStore::VersionFile> SceneStore::file(const std::string& id, const std::string& version, FileFormat format) {
  const auto at = impl_->snapshot(id);
  if (!at) return propagate(at);
  const Manifest& manifest = *at->manifest;
  const std::string extension = extension_of(format);
  const std::string suffix = version == "0" ? "" : (version.starts_with('p') ? "-" : "-v") + version;
  const std::string download_name = manifest.scene.name + suffix + "." + extension;
  if (version == "0" && manifest.scene.format == extension)  // as it came, byte for byte
    return VersionFile{at->scene->folder->path() / manifest.base, id + "-" + manifest.nonce + "-0-" + extension,
                       download_name, at->scene->folder};
  const auto loaded = impl_->load(*at, version);
  if (!loaded) return propagate(loaded);
  auto file = impl_->write_file(*at, version, *loaded, format);
  if (file) file->download_name = download_name;
  return file;
}

SceneStore::Usage SceneStore::usage() const {
  impl_->expire_previews();
  Usage usage{.memory_bytes = impl_->memory.used(), .memory_budget = impl_->memory.budget()};
  const std::lock_guard lock(impl_->mutex);
  usage.scenes = impl_->scenes.size();
  usage.previews = impl_->previews.size();
  return usage;
}

}  // namespace server::scenes
