// The fox capture, where it is at hand: 62 k Gaussians, 50 views of 359x640.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"

namespace bench {

inline constexpr const char* no_fox = "the fox capture is not on this machine (SPLATDRAG_DATA)";

inline std::filesystem::path fox_folder() {
  const char* data = std::getenv("SPLATDRAG_DATA");
  return (data ? std::filesystem::path(data) : std::filesystem::path(SPLATDRAG_SOURCE_DIR) / "../shared/data") / "fox";
}

struct Fox {
  engine::scene::GaussianCloud cloud;
  std::vector<engine::scene::Camera> cameras;
  engine::scene::Camera camera;  ///< The one asked for.
};

/// Nothing if the capture, or the view, is not there.
inline std::optional<Fox> fox(const std::string& view) {
  auto scene = engine::io::read_scene(fox_folder() / "point_cloud.ply");
  const auto dataset = engine::io::read_dataset(fox_folder());
  if (!scene || !dataset) return std::nullopt;
  Fox fox{std::move(scene->cloud), {}, {}};
  for (const auto& candidate : dataset->views) fox.cameras.push_back(candidate.camera);
  const auto found = std::find_if(fox.cameras.begin(), fox.cameras.end(),
                                  [&](const engine::scene::Camera& camera) { return camera.name == view; });
  if (found == fox.cameras.end()) return std::nullopt;
  fox.camera = *found;
  return fox;
}

}  // namespace bench
