#include "server/scenes/check.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "engine/core/file_descriptor.h"
#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/disk/digest_list.h"
#include "server/scenes/disk/folder_lock.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::Error;
using engine::ErrorCode;
using engine::propagate;

/// One scene's files, one after the other.
class SceneCheck {
 public:
  SceneCheck(fs::path folder, StoreCheck& into) : folder_(std::move(folder)), into_(into) {}

  void run() {
    std::error_code ignored;
    if (fs::exists(folder_ / removed_manifest_name, ignored)) return;  // goes at the next start
    ++into_.files;
    const auto manifest = read_manifest(folder_);
    if (!manifest) return manifest_is_damaged(manifest.error());
    check(manifest->base, manifest->base_digest);
    const auto& versions = manifest->scene.versions;
    for (std::size_t place = 1; place < versions.size(); ++place)  // version 0 is the base
      check(overlay_name(versions[place].version), manifest->overlay_digests[place]);
    if (manifest->dataset && !manifest->dataset->below_root) check_dataset(*manifest->dataset);
  }

 private:
  [[nodiscard]] std::string called(const std::string& name) const {
    return "scenes/" + folder_.filename().string() + "/" + name;
  }
  void manifest_is_damaged(const Error& error) {
    const bool absent = error.code == ErrorCode::not_found;
    const std::size_t field = error.where.find(':');
    into_.damaged.push_back(
        {ErrorCode::corrupt_data, absent ? "the scene's folder has no manifest" : error.message,
         called(manifest_name) + (absent || field == std::string::npos ? "" : error.where.substr(field))});
  }
  void check(const std::string& name, const std::string& digest) {
    ++into_.files;
    std::error_code ignored;
    if (digest.empty() && fs::is_regular_file(folder_ / name, ignored)) return into_.unchecked.push_back(called(name));
    // Any digest will do to say that a file is gone.
    const auto sound = check_digest(folder_ / name, digest.empty() ? "gone" : digest, called(name));
    if (!sound) into_.damaged.push_back(sound.error());
  }
  void check_dataset(const DatasetLocation& location) {
    const std::string folder = fs::path(location.folder).begin()->string(), list_name = dataset_list_name(location);
    if (location.list_digest.empty()) return into_.unchecked.push_back(called(folder));
    ++into_.files;
    const auto list = read_digest_list(folder_ / list_name, location.list_digest, called(list_name));
    if (!list) return into_.damaged.push_back(list.error());
    for (const auto& [name, digest] : *list) check(folder + "/" + name, digest);
  }

  const fs::path folder_;
  StoreCheck& into_;
};

}  // namespace

Result<StoreCheck> check_store(const fs::path& folder) {
  StoreCheck found;
  std::error_code error;
  if (!fs::exists(folder, error)) return found;
  const auto lock = FolderLock::take(folder, Sharing::alone);
  if (!lock) return propagate(lock);
  std::vector<fs::path> scenes;
  for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::end(entry); entry.increment(error))
    if (is_scene_id(entry->path().filename().string())) scenes.push_back(entry->path());
  if (error) return tl::make_unexpected(engine::file_error(error.value(), "read", folder));
  std::ranges::sort(scenes);
  for (const fs::path& scene : scenes) SceneCheck(scene, found).run();
  if (!scenes.empty()) {
    ++found.files;
    if (!counter_is_sound(folder))
      found.damaged.push_back({ErrorCode::corrupt_data,
                               "the number of the next scene cannot be read; the next start makes it good",
                               "scenes/next_scene"});
  }
  return found;
}

}  // namespace server::scenes
