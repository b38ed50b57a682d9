// Versions as files for download: made when somebody asks for one, kept as long as there is room.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "server/scenes/catalogue/catalogue.h"
#include "server/scenes/catalogue/names.h"
#include "server/scenes/catalogue/scene_info.h"
#include "server/scenes/disk/bounded_cache.h"
#include "server/scenes/disk/digest.h"
#include "server/scenes/versions/previews.h"
#include "server/scenes/versions/versions.h"

namespace server::scenes {

/// Keeps files in the scenes' folders, by the name "<scene>/<version>.<format>" in `files`. Safe to call from any
/// thread.
class VersionFiles {
 public:
  /// All outlive this.
  VersionFiles(BoundedCache& files, BoundedCache& memory, Catalogue& catalogue, Previews& previews, Versions& versions,
               const PublicErrors& public_error)
      : files_(files),
        memory_(memory),
        catalogue_(catalogue),
        previews_(previews),
        versions_(versions),
        public_error_(public_error) {}

  /// The file of a version or preview. Version 0 in its own format is the file as it came, byte for byte.
  ///   errors  those of Versions::load() and io::write_scene(); corrupt_data: version 0 is not what was stored
  [[nodiscard]] Result<VersionFile> get(const Snapshot& at, const std::string& version, FileFormat format);

 private:
  [[nodiscard]] Result<VersionFile> written(const Snapshot& at, const std::string& version, FileFormat format);

  BoundedCache& files_;
  BoundedCache& memory_;
  Catalogue& catalogue_;
  Previews& previews_;
  Versions& versions_;
  const PublicErrors& public_error_;
  SoundFiles sound_files_;
  const std::string process_nonce_ = random_nonce();
  std::atomic<std::uint64_t> last_{0};
};

}  // namespace server::scenes
