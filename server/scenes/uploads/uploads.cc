#include "server/scenes/uploads/uploads.h"

#include <cstdint>
#include <optional>
#include <system_error>
#include <utility>

#include "server/scenes/catalogue/names.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/disk/disk.h"
#include "server/scenes/disk/scene_format.h"
#include "server/scenes/uploads/scene_root.h"
#include "server/scenes/uploads/scene_statistics.h"

namespace server::scenes {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::propagate;

/// The file, in memory that is counted before it is taken.
Result<Uploads::Upload> Uploads::read(const fs::path& file) {
  const auto no_room = [&](engine::Error error) {
    if (error.code == engine::ErrorCode::too_large) error.where = file.filename().string();
    return tl::make_unexpected(std::move(error));
  };
  // One at a time: a reader takes more than what is left of it, and the file is in memory, too, even to tell what it
  // will take.
  const std::lock_guard one_at_a_time(reading_);
  const std::uint64_t expected = expected_memory_bytes(file, options_.read);
  auto reservation = std::make_optional(memory_.reserve(expected));
  if (!*reservation) return no_room(reservation->error());
  auto scene = io::read_scene(file, options_.read);
  if (!scene) return public_error_(scene, file.parent_path());
  const std::uint64_t bytes = memory_bytes(*scene);
  if (bytes > expected) {
    reservation.reset();
    reservation.emplace(memory_.reserve(bytes));
    if (!*reservation) return no_room(reservation->error());
  }
  return Upload{std::make_shared<const io::SceneFile>(std::move(*scene)), std::move(**reservation)};
}

Result<ManifestPtr> Uploads::add_staged(const fs::path& file, const fs::path& staging, const std::string& name,
                                        const Uploader& uploader) {
  const auto called = name_for(name, file.filename().string());
  if (!called) return propagate(called);
  auto upload = read(file);
  if (!upload) return propagate(upload);
  const auto format = io::detect_format(file);
  if (!format) return public_error_(format, file.parent_path());
  const auto& cloud = upload->file->cloud;

  Manifest manifest;
  manifest.nonce = random_nonce();
  manifest.base = std::string("base.") + io::extension_of(*format);
  manifest.base_disk_bytes = bytes_below(file);
  manifest.base_memory_bytes = memory_bytes(*upload->file);
  manifest.overlay_memory_bytes = {0};
  manifest.overlay_digests = {""};
  auto digest = digest_of_file(file);
  if (!digest) return public_error_(digest, file.parent_path());
  manifest.base_digest = std::move(*digest);
  SceneInfo& scene = manifest.scene;
  const SceneStatistics measured = statistics(cloud);
  scene.name = *called;
  scene.uploader = uploader.name;
  scene.created = options_.clock();
  scene.format = engine::name_of(*format);
  scene.sh_degree = cloud.sh_degree;
  scene.low = measured.low, scene.high = measured.high;
  scene.centre = measured.centre, scene.radius = measured.radius;
  VersionInfo& uploaded_version = scene.versions.emplace_back();
  uploaded_version.created = scene.created;
  uploaded_version.gaussians = cloud.size();

  const auto at = catalogue_.add(std::move(manifest), file, staging, uploader.max_bytes);
  if (!at) return propagate(at);
  const std::string& id = at->scene->id;
  memory_.put(id + "/base", {upload->file, at->manifest->base_memory_bytes}, std::move(upload->reservation));
  if (!catalogue_.has(*at)) memory_.forget(id + "/");
  return at->manifest;
}

Result<ManifestPtr> Uploads::add(const fs::path& file, const std::string& filename, const std::string& name,
                                 const Uploader& uploader) {
  const auto counted = catalogue_.reserve();
  if (!counted) return propagate(counted);
  const auto staging = scratch_.make();
  if (!staging) return propagate(staging);
  // Under its user's name: that is what error addresses begin with.
  const fs::path folder = staging->folder() / "upload", uploaded = folder / safe_file_name(filename);
  if (auto status = make_folder(folder); !status) return public_error_(status, folder);
  std::error_code error;
  fs::rename(file, uploaded, error);
  if (error) return public_error_(engine::file_error(error.value(), "take", uploaded), folder);
  // Before it is read, which takes longer; nothing is held yet.
  if (const auto fits = catalogue_.hold_quota(uploader, bytes_below(uploaded)); !fits) return propagate(fits);
  return add_staged(uploaded, staging->folder(), name, uploader);
}

Result<ManifestPtr> Uploads::add_path(const std::string& path, const std::string& name, const Uploader& uploader) {
  const auto found = open_below_root(options_.scene_root, path);
  if (!found) return propagate(found);
  const auto staging = scratch_.make();
  if (!staging) return propagate(staging);
  const fs::path copy = staging->folder() / "copy";
  const std::string opened = "/proc/self/fd/" + std::to_string(found->get());
  if (auto copied = scenes::copy_file(opened, copy); !copied) {
    if (copied.error().where.find(opened) != std::string::npos ||
        copied.error().message.find(opened) != std::string::npos)
      return engine::fail(copied.error().code, "the file cannot be read to its end", "path");
    return public_error_(copied, staging->folder());
  }
  return add(copy, fs::path(path).filename().string(), name, uploader);
}

}  // namespace server::scenes
