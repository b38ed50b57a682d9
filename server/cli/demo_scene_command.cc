// splatdrag demo-scene: a scene made by formula, with cameras and drags to try.
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "engine/core/atomic_file.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "server/cli/capture_files.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/folders.h"
#include "server/cli/suggested_drag.h"

namespace server::cli {
namespace {

namespace io = engine::io;
namespace procedural = engine::procedural;
using std::filesystem::path;

struct DemoSceneOptions {
  std::string out;
  procedural::DemoOptions demo;
  std::string size = "640x480";
  std::vector<double> ball_shift;
  bool render = false;
  ComputeOptions compute;
};

Result<void> write_drags(const path& folder, const std::vector<procedural::SuggestedDrag>& drags) {
  if (auto made = make_folder(folder); !made) return made;
  for (const auto& drag : drags) {
    const std::string json = proto::to_json(to_request(drag)) + "\n";
    if (auto saved = engine::write_file(folder / (drag.name + ".json"), std::as_bytes(std::span(json))); !saved)
      return saved;
  }
  return {};
}

/// The views as photos of the dataset.
Result<void> write_photos(const path& folder, const procedural::DemoScene& demo) {
  if (auto made = make_folder(folder); !made) return made;
  engine::render::Workspace workspace;
  engine::render::Rendering rendering;
  for (const auto& camera : demo.cameras) {
    engine::render::forward(demo.cloud, camera, {}, {}, workspace, rendering);
    if (auto saved = io::write_image(folder / camera.name, rendering.color); !saved) return saved;
  }
  return {};
}

Result<void> run(DemoSceneOptions options, Terminal& terminal) {
  const auto size = parse_size(options.size);
  if (!size) return engine::fail(size.error().code, size.error().message, "--size");
  options.demo.width = size->width;
  options.demo.height = size->height;
  if (!options.ball_shift.empty())
    options.demo.ball_shift = {options.ball_shift[0], options.ball_shift[1], options.ball_shift[2]};
  if (auto valid = procedural::validate(options.demo); !valid) return valid;

  return compute(options.compute, [&](const Machine&) -> Result<void> {
    procedural::DemoScene demo = procedural::make_demo_scene(options.demo);
    for (auto& camera : demo.cameras) camera.name += ".png";  // a view is called as its photo is
    const path folder = options.out, sparse = folder / "sparse" / "0";
    if (auto made = make_folder(sparse); !made) return made;
    if (auto saved = write_colmap_text(sparse, demo.cameras, demo.cloud); !saved) return saved;
    if (auto saved = write_drags(folder / "drags", demo.drags); !saved) return saved;
    if (options.render)
      if (auto saved = write_photos(folder / "images", demo); !saved) return saved;
    io::SceneFile file{std::move(demo.cloud), {}};
    file.layout = io::inria_layout(file.cloud.sh_degree);
    if (auto saved = io::write_scene(folder / "scene.ply", file, io::SceneFormat::ply); !saved) return saved;
    terminal.out << (folder / "scene.ply").string() << ": " << file.cloud.size() << " Gaussians, "
                 << demo.cameras.size() << " views\n";
    for (const auto& drag : demo.drags) terminal.out << (folder / "drags" / (drag.name + ".json")).string() << '\n';
    return {};
  });
}

}  // namespace

void add_demo_scene_command(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("demo-scene", "Makes a scene by formula, with cameras and drags to try");
  const auto options = std::make_shared<DemoSceneOptions>();
  command
      ->add_option("--out", options->out, "Folder for scene.ply, its cameras (COLMAP text, sparse/0) and drags/*.json")
      ->required()
      ->type_name("DIR");
  command->add_option("--gaussians", options->demo.gaussians, "About how many Gaussians, 2000 to 5000000")
      ->type_name("N");
  command->add_option("--seed", options->demo.seed, "Of all that is random")->type_name("S");
  command->add_option("--views", options->demo.views, "Cameras, 1 to 1000")->type_name("V");
  command->add_option("--size", options->size, "Size of their pictures, pixels")->type_name("WxH");
  command
      ->add_option("--ball-shift", options->ball_shift,
                   "How far the ball stands from its place, world units: what a drag of it should come to")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
  command->add_flag("--render", options->render, "Also render the views into images/, as the dataset's photos");
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
