// splatdrag select: which Gaussians a selection means, as numbers, as a scene of their own and in pictures.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/edit/views.h"
#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "engine/render/forward.h"
#include "engine/select/select.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/folders.h"
#include "server/cli/request_file.h"
#include "server/edits/convert_selection.h"
#include "server/pictures/picture_names.h"
#include "server/pictures/pictures.h"

namespace server::cli {
namespace {

namespace io = engine::io;
namespace scene = engine::scene;
using engine::propagate;
using engine::select::Selected;
using std::filesystem::path;

constexpr int virtual_side = 800;  // pixels of a picture where no camera says

struct SelectOptions {
  std::string scene, selection, name, dataset, out, pictures;
  int views = 6;
  ComputeOptions compute;
};

/// Errors of the engine name an operation; the user knows it by its place in the file.
engine::Error in_file(engine::Error error, const SelectOptions& options) {
  if (error.where.starts_with("selection"))
    error.where = path(options.selection).filename().string() + ":" + (options.name.empty() ? "" : options.name + ".") +
                  error.where;
  return error;
}

Result<Selected> carry_out(const SelectOptions& options, const proto::Selection& asked,
                           const scene::GaussianCloud& cloud, const std::vector<scene::Camera>& cameras) {
  const auto with_cameras = edits::with_cameras(asked, {.views = cameras});
  if (!with_cameras) return tl::make_unexpected(in_file(with_cameras.error(), options));
  auto selected = edits::carry_out(cloud, *with_cameras);
  if (!selected) return tl::make_unexpected(in_file(selected.error(), options));
  return selected;
}

/// Cameras around what is selected.
std::vector<scene::Camera> virtual_cameras(const scene::GaussianCloud& cloud, const Selected& selected, int count) {
  engine::edit::Request around;
  const engine::Vec3 size = selected.bounds.high - selected.bounds.low;
  around.handles.push_back(
      {.source = selected.centre, .target = {}, .radius = std::max({size.x, size.y, size.z, 1e-6f})});
  around.params.views = count;
  around.params.max_image_side = virtual_side;
  return engine::edit::candidate_cameras(cloud, {}, around);
}

/// So many of the cameras, evenly spread over the list.
std::vector<scene::Camera> spread(const std::vector<scene::Camera>& cameras, std::size_t count) {
  std::vector<scene::Camera> chosen;
  const std::size_t wanted = std::min(count, cameras.size());
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(cameras[i * cameras.size() / wanted]);
  return chosen;
}

Result<void> write_pictures(const path& folder, const scene::GaussianCloud& cloud, const Selected& selected,
                            const std::vector<scene::Camera>& cameras, Terminal& terminal) {
  if (auto made = make_folder(folder); !made) return made;
  engine::render::ForwardOptions forward;
  forward.tint = {.rows = selected.rows, .color = pictures::tint_color, .strength = pictures::tint_share};
  engine::render::Workspace workspace;
  engine::render::Rendering rendering;
  const auto names = pictures::picture_names(cameras);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    engine::render::forward(cloud, cameras[i], forward, {}, workspace, rendering);
    const path file = folder / ("selected_" + names[i] + ".png");
    if (auto saved = io::write_image(file, rendering.color); !saved) return saved;
    terminal.out << file.string() << '\n';
  }
  return {};
}

void print(const Selected& selected, std::size_t rows, Terminal& terminal) {
  const auto point = [](const auto& p) {
    return std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z);
  };
  terminal.out << selected.count << " of " << rows << " Gaussians\n";
  if (selected.count > 0)
    terminal.out << "from " << point(selected.bounds.low) << " to " << point(selected.bounds.high) << ", around "
                 << point(selected.centre) << '\n';
  if (selected.undecided > 0) terminal.out << selected.undecided << " undecided by masks\n";
  for (const std::string& warning : edits::warnings_of(selected)) terminal.err << "warning: " << warning << '\n';
}

Result<void> run(const SelectOptions& options, Terminal& terminal) {
  const auto asked = read_selection(options.selection, options.name);
  if (!asked) return propagate(asked);
  if (!options.out.empty())
    if (auto safe = keep_input_safe(options.scene, options.out); !safe) return safe;
  return compute(options.compute, [&](const Machine&) -> Result<void> {
    auto input = io::read_scene(options.scene);
    if (!input) return propagate(input);
    std::vector<scene::Camera> cameras;
    if (!options.dataset.empty()) {
      const auto dataset = io::read_dataset(options.dataset, {.points = false});
      if (!dataset) return propagate(dataset);
      cameras = io::cameras_of(*dataset);
    }
    const auto selected = carry_out(options, *asked, input->cloud, cameras);
    if (!selected) return propagate(selected);
    print(*selected, input->cloud.size(), terminal);
    if (selected->count == 0 && (!options.out.empty() || (!options.pictures.empty() && cameras.empty())))
      return engine::fail(engine::ErrorCode::unprocessable,
                          "nothing is selected: there is nothing to write or to look at",
                          options.out.empty() ? "--pictures" : "--out");
    if (!options.pictures.empty()) {
      if (cameras.empty()) cameras = virtual_cameras(input->cloud, *selected, options.views);
      const auto chosen = spread(cameras, std::size_t(options.views));
      if (auto done = write_pictures(options.pictures, input->cloud, *selected, chosen, terminal); !done) return done;
    }
    if (options.out.empty()) return {};
    const io::SceneFile part{scene::select(input->cloud, selected->rows), input->layout};
    return io::write_scene(options.out, part, io::SceneFormat::ply);
  });
}

}  // namespace

void add_select_command(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("select", "Says which Gaussians of a scene a selection means, and shows them");
  const auto options = std::make_shared<SelectOptions>();
  command->add_option("--scene,scene", options->scene, "Scene to select in: .ply, .splat, .spz, .sog or .glb")
      ->required()
      ->type_name("FILE");
  command
      ->add_option(
          "--selection", options->selection,
          "Operations, carried out in order (JSON): a list of them, {\"selection\": [...]}, or an edit request")
      ->required()
      ->type_name("FILE");
  command->add_option("--name", options->name, "Which request of a file of several")->type_name("NAME");
  command
      ->add_option("--dataset", options->dataset,
                   "Folder with the scene's cameras (COLMAP, transforms.json or an INRIA model): operations may name "
                   "its views, and pictures are taken through them")
      ->type_name("DIR");
  command->add_option("--out", options->out, "Scene file for what is selected alone: .ply")->type_name("FILE");
  command
      ->add_option("--pictures", options->pictures,
                   "Folder for pictures in which it is tinted; without a dataset, cameras are placed around it")
      ->type_name("DIR");
  command->add_option("--views", options->views, "Number of these pictures")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  add_compute_options(*command, options->compute);
  command->footer(
      "Each operation is an object with one action, and with \"op\": \"add\" (the default), \"subtract\" or "
      "\"intersect\".\n"
      "Points and lengths are in world units, those of pictures in pixels; \"view\" (of the dataset) or \"camera\" "
      "says "
      "which.\n"
      "  {\"sphere\": {\"center\": [x, y, z], \"radius\": r}}\n"
      "  {\"box\": {\"center\": [x, y, z], \"size\": [x, y, z], \"rotation\": [w, x, y, z]}}\n"
      "  {\"plane\": {\"point\": [x, y, z], \"normal\": [x, y, z]}}\n"
      "  {\"polygon\": {\"view\": NAME, \"points\": [[x, y], ...], \"depth\": \"visible\" or \"through\"}}\n"
      "  {\"stroke\": {\"view\": NAME, \"points\": [[x, y], ...], \"radius\": px}}\n"
      "  {\"grow\": {\"inside\": [[x, y, z], ...], \"outside\": [[x, y, z], ...], \"reach\": r, \"whole\": true, "
      "\"wider\": n}}\n"
      "  {\"masks\": [{\"view\": NAME, \"image\": PNG as base64}, ...]}\n"
      "  {\"rows\": [[from, to], ...]}, to being exclusive\n"
      "  {\"expand\": r}, {\"shrink\": r}, {\"largest\": n}, {\"invert\": true}: of what is selected so far");
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
