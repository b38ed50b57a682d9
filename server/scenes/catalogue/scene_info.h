// What the store tells of its scenes, and what it gives out of them: plain data.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/overlay.h"

namespace server::scenes {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;

/// One link of a scene's chain. Version 0 is the file as it came.
struct VersionInfo {
  int version = 0;
  std::optional<int> parent;  ///< None for version 0.
  std::string edit;           ///< Id of the edit that made it; empty for version 0.
  Time created{};
  std::size_t gaussians = 0;
  std::uint64_t disk_bytes = 0;  ///< Of what this version needs beside version 0.
};

struct DatasetInfo {
  std::string kind;  ///< "colmap", "transforms", "inria"
  std::size_t views = 0, photos = 0;
  std::optional<double> psnr_mean_db;  ///< Renders of version 0 against photos; none without photos.
  std::optional<double> psnr_worst_db;
  std::string psnr_worst_view;
  std::vector<std::string> warnings;
  int number = 0;  ///< Which of the scene's datasets, one after the other, it is; not kept in a manifest.
};

struct SceneInfo {
  std::string id;  ///< "s000001": counts up, never used twice.
  std::string name;
  Time created{};
  std::string format;  ///< "ply", "splat", "spz", "compressed_ply"
  int sh_degree = 0;
  engine::DVec3 low{0.0}, high{0.0};  ///< Box of the means, world units.
  engine::DVec3 centre{0.0};          ///< Median of the means.
  double radius = 0;                  ///< Half of the means are nearer to the centre than this.
  std::optional<engine::DVec3> up;    ///< As the user set it.
  std::uint64_t disk_bytes = 0;
  std::uint64_t memory_bytes = 0;  ///< Held in memory right now.
  std::optional<DatasetInfo> dataset;
  std::vector<VersionInfo> versions;  ///< By number.
};

/// A version in memory. Holding it keeps it there.
struct LoadedVersion {
  engine::scene::LayeredCloud cloud;
  std::string key;  ///< Names these very Gaussians, as this version of the program reads and draws them, for ever,
                    ///< across restarts: for ETags.
};

/// A version that lives in memory only, for a while.
struct Preview {
  std::string version;  ///< "p000001"
  Time expires{};
};

enum class FileFormat { ply, splat, spz };

/// A version as a file for download.
struct VersionFile {
  std::filesystem::path path;
  std::string etag, download_name;
  std::shared_ptr<const void> hold;  ///< Keeps the file from being removed.
};

}  // namespace server::scenes
