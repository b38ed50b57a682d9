// Scenes on the wire: what the service says about them, and what it is told.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/camera.h"

namespace proto {

/// Times are RFC 3339, UTC, milliseconds. Lengths are world units.
struct SceneVersion {
  int version = 0;
  std::optional<int> parent;  ///< None for version 0.
  std::string edit;           ///< That made it; empty for version 0.
  std::string created;
  std::size_t gaussians = 0;
  std::uint64_t disk_bytes = 0;  ///< Beside version 0.
};

struct SceneDataset {
  std::string kind;  ///< "colmap", "transforms", "inria"
  std::size_t views = 0, photos = 0;
  std::optional<double> psnr_mean_db, psnr_worst_db;
  std::string psnr_worst_view;  ///< Empty where psnr_worst_db is.
  std::vector<std::string> warnings;
};

struct Scene {
  std::string id, name, created;
  std::string format;  ///< "ply", "compressed_ply", "splat", "spz"
  std::size_t gaussians = 0;
  int sh_degree = 0;
  Point low{}, high{}, centre{};
  double radius = 0;
  std::optional<Point> up;
  std::uint64_t disk_bytes = 0, memory_bytes = 0;
  std::size_t views = 0;
  std::optional<SceneDataset> dataset;
  std::vector<SceneVersion> versions;
};

[[nodiscard]] std::string to_json(const Scene& scene);
[[nodiscard]] std::string to_json(const std::vector<Scene>& scenes);  ///< {"scenes": [...]}

struct View {
  std::string name;
  PinholeCamera camera;
  bool photo = false;  ///< Whether the dataset has one of it.
};
///   kind  "dataset" or "virtual"
[[nodiscard]] std::string to_json(const std::vector<View>& views, std::string_view kind);

/// A file or folder below the scene root.
struct PathSource {
  std::string path;
  std::string name;  ///< Of the scene; empty: that of the file.
  bool operator==(const PathSource&) const = default;
};

/// What is to change about a scene.
struct ScenePatch {
  std::optional<std::string> name;
  std::optional<std::optional<Point>> up;  ///< Given as nothing: forget it.
  bool operator==(const ScenePatch&) const = default;
};

// All strict, as parse_edit_request(), with its errors.
[[nodiscard]] Result<PathSource> parse_scene_source(std::string_view text, const JsonLimits& limits = {});
[[nodiscard]] Result<PathSource> parse_dataset_source(std::string_view text, const JsonLimits& limits = {});
[[nodiscard]] Result<ScenePatch> parse_scene_patch(std::string_view text, const JsonLimits& limits = {});

}  // namespace proto
