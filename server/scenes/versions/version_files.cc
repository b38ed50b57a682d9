#include "server/scenes/versions/version_files.h"

#include <memory>
#include <utility>

#include "engine/io/checks.h"
#include "engine/io/scene_file.h"
#include "server/scenes/disk/disk.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::propagate;

/// Of a Gaussian in a file that is no .ply, at most: a .glb file has floats and four bytes of a colour, others less.
std::uint64_t max_row_bytes(int sh_degree) { return io::cloud_row_bytes(sh_degree) + 4; }

/// A file in a scene's folder that goes when nobody holds it.
struct HeldFile {
  HeldFile(std::shared_ptr<Lease> in, const fs::path& path, std::string checksum)
      : scene(std::move(in)), file(path), digest(std::move(checksum)) {
    file.end();
  }
  std::shared_ptr<Lease> scene;
  Lease file;
  std::string digest;
};

}  // namespace

Result<VersionFile> VersionFiles::get(const Snapshot& at, const std::string& version, FileFormat format) {
  const Manifest& manifest = *at.manifest;
  const std::string extension = io::extension_of(format);
  const std::string suffix = version == "0" ? "" : (is_preview(version) ? "-" : "-v") + version;
  const std::string download_name = manifest.scene.name + suffix + "." + extension;
  if (version == "0" && manifest.scene.format == engine::name_of(format)) {
    if (auto sound = sound_files_.check(at.scene->folder->path() / manifest.base, manifest.base_digest,
                                        stored_name(at, manifest.base));
        !sound)
      return propagate(sound);
    return VersionFile{at.scene->folder->path() / manifest.base,
                       at.scene->id + "-" + manifest.nonce + "-0-" + extension, download_name, at.scene->folder};
  }
  auto file = written(at, version, format);
  if (file) file->download_name = download_name;
  return file;
}

Result<VersionFile> VersionFiles::written(const Snapshot& at, const std::string& version, FileFormat format) {
  const auto loaded = versions_.load(at, version);
  if (!loaded) return propagate(loaded);
  const auto base = versions_.base(at);  // in memory, since `loaded` holds its cloud
  if (!base) return propagate(base);
  const io::PlyLayout& layout = (*base)->layout;
  const std::string extension = io::extension_of(format);
  const auto write = [&]() -> Result<BoundedCache::CachedObject> {
    const fs::path folder = at.scene->folder->path() / "files";
    if (auto status = make_folder(folder); !status) return public_error_(status);
    // A name of its own: one of the same version that was dropped, or that another process has made, is removed on its
    // own.
    const fs::path path = folder / (version + "-" + process_nonce_ + "-" + std::to_string(++last_) + "." + extension);
    const std::uint64_t flat_bytes = engine::scene::memory_bytes(*loaded->cloud.base) +
                                     (loaded->cloud.overlay ? engine::scene::memory_bytes(*loaded->cloud.overlay) : 0);
    const auto reservation = memory_.reserve(flat_bytes);
    if (!reservation) return propagate(reservation);
    const io::SceneFile file{engine::scene::flatten(loaded->cloud), layout, (*base)->origin};
    if (auto saved = io::write_scene(path, file, format); !saved) return public_error_(saved);
    auto digest = digest_of_file(path);
    if (!digest) return public_error_(digest);
    return BoundedCache::CachedObject{std::make_shared<const HeldFile>(at.scene->folder, path, std::move(*digest)),
                                      bytes_below(path)};
  };
  const std::string name = at.scene->id + "/" + version + "." + extension;
  const std::uint64_t row_bytes = format == FileFormat::ply ? layout.vertex().stride : max_row_bytes(layout.sh_degree);
  auto held = files_.get<HeldFile>(name, loaded->cloud.size() * row_bytes, write);
  if (held && !sound_files_.check((*held)->file.path(), (*held)->digest, name)) {  // it can be made again
    files_.forget(name);
    held = files_.get<HeldFile>(name, loaded->cloud.size() * row_bytes, write);
  }
  const bool is_gone = is_preview(version) ? !previews_.has(version) : !versions_.has(at, version);
  if (!catalogue_.has(at) || is_gone) files_.forget(name);
  if (!held) return propagate(held);
  return VersionFile{(*held)->file.path(), loaded->key + "-" + extension, {}, *held};
}

}  // namespace server::scenes
