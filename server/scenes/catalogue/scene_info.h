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
#include "engine/io/scene_origin.h"
#include "engine/scene/overlay.h"

namespace server::scenes {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;

/// One link of a scene's chain. Version 0 is the file as it came.
struct VersionInfo {
  int version = 0;
  std::optional<int> parent;  ///< Version that was edited; none for version 0.
  std::string edit;           ///< Id of the edit that made it; empty for version 0.
  std::string name;           ///< As somebody has called it; empty: nobody has.
  Time created{};
  std::size_t gaussians = 0;
  std::uint64_t disk_bytes = 0;  ///< What this version takes beside version 0.
};

/// Whoever brings files in, and how much of theirs the store may hold.
struct Uploader {
  std::string name = {};                        ///< As whoever lets them in calls them; empty: nobody says.
  std::optional<std::uint64_t> max_bytes = {};  ///< Of scenes and unpacked datasets together; none: no limit.
};

/// What is known of a scene's dataset.
struct DatasetInfo {
  std::string kind;  ///< "colmap", "transforms", "inria"
  std::size_t views = 0, photos = 0;
  std::optional<double> psnr_mean_db;  ///< Renders of version 0 against photos; none without photos.
  std::optional<double> psnr_worst_db;
  std::string psnr_worst_view;
  std::vector<std::string> warnings;
  int number = 0;  ///< Counts the datasets that the scene has had; not in a manifest.
};

/// What is known of a scene. Lengths are world units.
struct SceneInfo {
  std::string id;  ///< "s000001": counts up, never used twice.
  std::string name;
  std::string uploader;  ///< Who brought it in; empty: nobody has said.
  Time created{};
  std::string format;  ///< Name of an io::SceneFormat: "ply", "compressed_ply", "splat", "spz", "sog", "glb"
  int sh_degree = 0;
  engine::DVec3 low{0.0}, high{0.0};  ///< Box of the means, world units.
  engine::DVec3 centre{0.0};          ///< Median of the means.
  double radius = 0;                  ///< Half of the means are nearer to the centre than this.
  std::optional<engine::DVec3> up;    ///< World direction that the user set, if any.
  std::uint64_t disk_bytes = 0;
  std::uint64_t memory_bytes = 0;  ///< What it takes in memory now.
  std::optional<DatasetInfo> dataset;
  std::vector<VersionInfo> versions;  ///< In the order of their numbers.
};

/// A version in memory. Holding it keeps it there.
struct LoadedVersion {
  engine::scene::LayeredCloud cloud;
  std::string key;  ///< Names these very Gaussians, as this release of the program reads and draws them, for ever,
                    ///< across restarts: for ETags.
};

/// A version that lives in memory only, for a while.
struct Preview {
  std::string version;  ///< "p000001"
  Time expires{};
};

using FileFormat = engine::io::SceneFormat;

/// A version as a file for download.
struct VersionFile {
  std::filesystem::path path;
  std::string etag, download_name;
  std::shared_ptr<const void> hold;  ///< Keeps the file from being removed.
};

}  // namespace server::scenes
