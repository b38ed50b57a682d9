// What a scene's folder holds, in one small file: scene.json.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "server/scenes/catalogue/scene_info.h"

namespace server::scenes {

using engine::Result;

/// Where the files of a dataset are.
struct DatasetLocation {
  std::string folder;            ///< Holds the cameras. Relative to the scene's folder, or to the scene root.
  bool below_root = false;       ///< Whether `folder` is relative to the scene root.
  std::uint64_t disk_bytes = 0;  ///< Bytes that it takes in the scene's folder.
  std::string list_digest;       ///< Of the list of its files, see dataset_list_name(); "": there is none.
  std::string uploader = {};     ///< Who brought it in; empty: nobody has said.
};

/// What scene.json says, field by field.
struct Manifest {
  SceneInfo scene;    ///< Without memory_bytes and disk_bytes, which are computed.
  std::string nonce;  ///< Random: a scene of the same id in another data folder is another one.
  std::string base;   ///< File name of version 0.
  // Digests of files (disk/digest.h); "" is none: it was stored by a release that kept none.
  std::string base_digest;
  std::vector<std::string> overlay_digests;  ///< One entry per version, in their order; "" for version 0.
  std::uint64_t base_disk_bytes = 0, base_memory_bytes = 0;
  std::vector<std::uint64_t> overlay_memory_bytes;  ///< The same; 0 for version 0.
  std::optional<DatasetLocation> dataset;           ///< Present exactly where scene.dataset is.
  int next_dataset = 1;                             ///< Number of the next dataset's folder.
  int next_version = 1;                             ///< Never used twice: a name stands for the same bytes for ever.
};

/// What an edit has made and what becomes a version of its scene, once it is taken in: a file outside of the scene's
/// folder, and all that the manifest will say of it.
struct MadeVersion {
  VersionInfo
      version;       ///< Without a name. Its number is the next one, unless another edit's version is taken in first.
  std::string file;  ///< Its name; "": the version is one of the scene already.
  std::string digest;
  std::uint64_t memory_bytes = 0;
};

/// As JSON text, and back.
///   errors  corrupt_data: it is not what to_text() writes
[[nodiscard]] std::string to_text(const MadeVersion& made);
[[nodiscard]] Result<MadeVersion> parse_made_version(const std::string& text);

/// Where a version stands in the lists of a manifest; nothing where there is none of that number (any more).
[[nodiscard]] std::optional<std::size_t> place_of(const Manifest& manifest, int version);

constexpr const char* manifest_name = "scene.json";
/// What the manifest of a removed scene is called, until nobody reads its files any more.
constexpr const char* removed_manifest_name = "scene.json.removed";

/// Strict: every field must be there, be of its type and be within what makes sense, and the whole have its checksum. A
/// manifest of format 1 has no digests, of itself neither; up to format 2 no version was ever deleted.
///   errors  not_found: no such file; corrupt_data: `where` is "<folder>/scene.json:field"
[[nodiscard]] Result<Manifest> read_manifest(const std::filesystem::path& folder);

/// Replaces the file as a whole; on disk when this returns.
///   errors  no_space, unavailable: the old one is unchanged, unless is_written()
[[nodiscard]] Result<void> write_manifest(const std::filesystem::path& folder, const Manifest& manifest);
/// Is this what the folder's manifest says? After an error it may: its name was changed, but not known to be on disk.
[[nodiscard]] bool is_written(const std::filesystem::path& folder, const Manifest& manifest);

/// File name of what version `version` changes.
[[nodiscard]] std::string overlay_name(int version);

/// File name of the list of a dataset's files: lines "XXH3 (path) = digest", paths relative to the folder that is the
/// first part of `location.folder`, as `xxhsum --check` takes them. For a dataset in the scene's folder.
[[nodiscard]] std::string dataset_list_name(const DatasetLocation& location);

}  // namespace server::scenes
