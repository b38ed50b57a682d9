#include "server/cli/scene_writing.h"

#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "engine/io/scene_loss.h"

namespace server::cli {
namespace {

namespace io = engine::io;
using engine::propagate;

/// What the format cannot hold of this scene at all.
std::vector<std::string> dropped(const io::SceneFile& scene, io::SceneFormat format) {
  std::vector<std::string> lost;
  if (format == io::SceneFormat::ply) return lost;
  const std::string name = "." + std::string(io::extension_of(format));
  if (format == io::SceneFormat::splat && scene.cloud.sh_degree > 0)
    lost.push_back(name + " holds no view-dependent colour: SH of degree 1 and up is dropped");
  if (scene.cloud.extra_stride > 0) lost.push_back(name + " holds no further properties: they are dropped");
  return lost;
}

/// What the origin's file said and the format cannot.
std::vector<std::string> unsaid(const io::SceneOrigin& origin, io::SceneFormat format) {
  std::vector<std::string> lost;
  if (!origin.spz_extensions.empty() && format != io::SceneFormat::spz)
    lost.push_back(std::to_string(origin.spz_extensions.size()) + " extensions of the .spz file are dropped");
  if (origin.antialiased && format != io::SceneFormat::spz && format != io::SceneFormat::sog)
    lost.push_back("that the scene was trained with anti-aliasing is dropped");
  return lost;
}

/// Of values beyond what the format has room for.
std::string clipped_in_numbers(const io::AttributeLoss& loss) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.2g %% of them, by %.3g at most", 100 * loss.clipped_part,
                loss.most_clipped);
  return text.data();
}

std::string in_numbers(const io::AttributeLoss& loss) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.3g at most, %.2g on average", loss.largest, loss.mean);
  return text.data();
}

}  // namespace

engine::Result<void> write_and_tell(const std::filesystem::path& file, const io::SceneFile& scene,
                                    io::SceneFormat format, Terminal& terminal) {
  const auto warn = [&](const std::string& lost) { terminal.err << "warning: " << lost << '\n'; };
  for (const std::string& lost : dropped(scene, format)) warn(lost);
  for (const std::string& lost : unsaid(scene.origin, format)) warn(lost);
  if (auto written = io::write_scene(file, scene, format); !written) return written;
  if (format != io::SceneFormat::ply) {
    // What was written is read again: no formula, but what a reader will find.
    const auto back = io::read_scene(file);
    if (!back) return propagate(back);
    const std::string extension = "." + std::string(io::extension_of(format));
    for (const io::AttributeLoss& loss : io::scene_loss(scene, *back, format)) {
      if (loss.clipped_part > 0)
        warn(extension + " clips " + loss.attribute + ": " + clipped_in_numbers(loss) + " (" + loss.unit + ")");
      if (loss.largest > 0)
        warn(extension + " rounds " + loss.attribute + ": " + in_numbers(loss) + " (" + loss.unit + ")");
    }
  }
  return {};
}

}  // namespace server::cli
