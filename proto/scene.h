// Scenes on the wire: what the service says about them, and what clients send.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/camera.h"

namespace proto {

/// One link of a scene's chain. Here and below, times are RFC 3339, UTC, milliseconds; lengths are world units.
struct SceneVersion {
  int version = 0;
  std::optional<int> parent;  ///< Version that was edited; none for version 0.
  std::string edit;           ///< Id of the edit that made it; empty for version 0.
  std::string name;           ///< Empty: it has none.
  std::string created;
  std::size_t gaussians = 0;
  std::uint64_t disk_bytes = 0;  ///< What it takes beside version 0.
};

/// What is known of a scene's dataset. PSNR: renders of version 0 against photos, dB.
struct SceneDataset {
  std::string kind;  ///< "colmap", "transforms", "inria"
  std::size_t views = 0, photos = 0;
  std::optional<double> psnr_mean_db, psnr_worst_db;
  std::string psnr_worst_view;  ///< Empty without psnr_worst_db.
  std::vector<std::string> warnings;
};

/// What is known of a scene: `low` and `high` bound the means, `centre` is their median.
struct Scene {
  std::string id, name, created;
  std::string format;  ///< "ply", "compressed_ply", "splat", "spz"
  std::size_t gaussians = 0;
  int sh_degree = 0;
  Point low{}, high{}, centre{};
  double radius = 0;  ///< Median distance of the means from the centre.
  std::optional<Point> up;
  std::uint64_t disk_bytes = 0, memory_bytes = 0;
  std::size_t views = 0;
  std::optional<SceneDataset> dataset;
  std::vector<SceneVersion> versions;
};

[[nodiscard]] std::string to_json(const Scene& scene);
[[nodiscard]] std::string to_json(const std::vector<Scene>& scenes);  ///< {"scenes": [...]}
/// As among the versions of its scene.
///   scene  its id
[[nodiscard]] std::string to_json(const SceneVersion& version, const std::string& scene);

/// A view of a scene.
struct View {
  std::string name;
  PinholeCamera camera;
  bool photo = false;  ///< Whether the dataset has a photo of it.
};
/// {"kind": kind, "views": [...]}
///   kind  "dataset" or "virtual"
[[nodiscard]] std::string to_json(const std::vector<View>& views, std::string_view kind);

/// A file or folder below the scene root.
struct PathSource {
  std::string path;
  std::string name;  ///< Name of the scene; empty: that of the file.
  bool operator==(const PathSource&) const = default;
};

/// What is to change about a scene.
struct ScenePatch {
  std::optional<std::string> name;
  std::optional<std::optional<Point>> up;  ///< Present but empty: removes what was set.
  bool operator==(const ScenePatch&) const = default;
};

/// What is to change about a version.
struct VersionPatch {
  std::string name;  ///< Empty: the name that it had is forgotten.
};

// All strict, as parse_edit_request(), with its errors.
[[nodiscard]] Result<PathSource> parse_scene_source(std::string_view text, const JsonLimits& limits = {});
[[nodiscard]] Result<PathSource> parse_dataset_source(std::string_view text, const JsonLimits& limits = {});
[[nodiscard]] Result<ScenePatch> parse_scene_patch(std::string_view text, const JsonLimits& limits = {});
[[nodiscard]] Result<VersionPatch> parse_version_patch(std::string_view text, const JsonLimits& limits = {});

}  // namespace proto
