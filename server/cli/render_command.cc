// splatdrag render: pictures of a scene through a dataset's cameras or one of your own.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "engine/render/forward.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/folders.h"
#include "server/pictures/photo_comparison.h"
#include "server/pictures/picture_content.h"
#include "server/pictures/picture_names.h"

namespace server::cli {
namespace {

namespace io = engine::io;
namespace scene = engine::scene;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using pictures::PictureContent;
using std::filesystem::path;

struct RenderOptions {
  std::string scene, dataset, out, size = "800x600", format = "png", what = "color";
  std::vector<std::string> views;
  bool all = false, compare = false, own_camera = false;
  std::array<double, 3> eye{}, target{}, up{0, -1, 0}, background{};
  double fov_deg = 50;
  int max_side = 0;
  ComputeOptions compute;
};

/// A view to render, and the name of its picture.
struct RenderTask {
  io::View view;
  std::string picture;
};

engine::DVec3 to_vec(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

Result<std::vector<RenderTask>> own_task(const RenderOptions& options) {
  const auto size = parse_size(options.size);
  if (!size) return fail(size.error().code, size.error().message, "--size");
  RenderTask task;
  task.view.camera = scene::look_at(to_vec(options.eye), to_vec(options.target), to_vec(options.up),
                                    options.fov_deg * std::numbers::pi / 180, size->width, size->height);
  task.view.camera.name = task.picture = "render";
  if (!scene::validate(task.view.camera))
    return fail(ErrorCode::invalid_argument,
                "the camera has no direction: eye and target are one point, or up is 0,0,0", "--eye, --target, --up");
  return std::vector<RenderTask>{task};
}

std::string some_names(const std::vector<io::View>& views) {
  constexpr std::size_t max_listed = 10;  // names in a message: it stays readable
  std::string text;
  for (std::size_t i = 0; i < std::min(views.size(), max_listed); ++i)
    text += (i == 0 ? "" : ", ") + views[i].camera.name;
  return views.size() > max_listed ? text + ", ..." : text;
}

Result<std::vector<RenderTask>> dataset_tasks(const RenderOptions& options) {
  auto dataset = io::read_dataset(options.dataset, {.points = false});
  if (!dataset) return propagate(dataset);
  const std::vector<scene::Camera> cameras = io::cameras_of(*dataset);
  const auto names = pictures::picture_names(cameras);
  std::vector<RenderTask> tasks;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto& wanted = options.views;
    if (options.all || std::find(wanted.begin(), wanted.end(), cameras[i].name) != wanted.end())
      tasks.push_back({dataset->views[i], names[i]});
  }
  for (const std::string& name : options.views)
    if (std::none_of(cameras.begin(), cameras.end(), [&](const auto& camera) { return camera.name == name; }))
      return fail(ErrorCode::not_found,
                  "the dataset has no view \"" + name + "\"; there are " + some_names(dataset->views), "--view");
  return tasks;
}

Result<std::vector<RenderTask>> choose_tasks(const RenderOptions& options) {
  const auto wrong = [](std::string message, std::string where) {
    return fail(ErrorCode::invalid_argument, std::move(message), std::move(where));
  };
  const int ways = int(!options.views.empty()) + int(options.all) + int(options.own_camera);
  if (ways != 1)
    return wrong("choose one: --view NAME or --all with --dataset, or --eye with --target", "--view, --all, --eye");
  if (options.own_camera && options.compare) return wrong("only views of a dataset have photos", "--compare");
  if (options.own_camera) return own_task(options);
  if (options.dataset.empty()) return wrong("views are those of a dataset: give its folder", "--dataset");
  return dataset_tasks(options);
}

/// Writes a picture of the rendering in the format that the file's name asks for.
Result<void> write_picture(const path& file, const engine::render::Rendering& rendering, PictureContent content) {
  const auto format = io::format_of(file);
  if (!format) return propagate(format);
  const auto bytes = pictures::encode_content(rendering, content, *format);
  if (!bytes) return propagate(bytes);
  return engine::write_file(file, *bytes);
}

/// Where the pictures go. One picture may be given a file name, else `--out` is a folder.
struct Destination {
  path folder;
  std::optional<path> file;
  std::string extension;

  [[nodiscard]] path of(const RenderTask& task) const { return file ? *file : folder / (task.picture + extension); }
};

/// Whether a name reads as a file's: it ends in an extension that begins with a letter. "v1.2" and "q.old/" do not.
bool is_file_name(const path& out) {
  const std::string extension = out.extension().string();
  return extension.size() > 1 && std::isalpha(static_cast<unsigned char>(extension[1])) != 0;
}

Result<Destination> destination(const RenderOptions& options, std::size_t pictures) {
  Destination to{options.out, std::nullopt, "." + options.format};
  const path out = options.out;
  std::error_code unreachable;  // then it is no folder
  const bool is_folder = std::filesystem::is_directory(out, unreachable);
  const auto format = io::format_of(out);
  // Whoever asks for one picture in q.mp4 does not mean a folder of that name.
  if (!format && !is_folder && pictures == 1 && is_file_name(out))
    return fail(ErrorCode::unsupported, format.error().message + "; a folder's name may end in /", "--out");
  if (format && !is_folder) {
    if (pictures > 1)
      return fail(ErrorCode::invalid_argument, "several pictures need a folder, not a file name", "--out");
    to.file = out;
    to.folder = out.parent_path();
  }
  if (!to.folder.empty())
    if (const auto made = make_folder(to.folder); !made) return propagate(made);
  return to;
}

Result<void> run(const RenderOptions& options, Terminal& terminal) {
  if (options.out.empty() && !options.compare)
    return fail(ErrorCode::invalid_argument, "say where the pictures go", "--out");
  const auto tasks = choose_tasks(options);
  if (!tasks) return propagate(tasks);
  std::optional<Destination> to;
  if (!options.out.empty()) {
    auto found = destination(options, tasks->size());
    if (!found) return propagate(found);
    to = std::move(*found);
    for (const RenderTask& task : *tasks)
      for (const path& input : {path(options.scene), task.view.photo})
        if (auto safe = keep_input_safe(input, to->of(task)); !safe) return safe;
  }

  return compute(options.compute, [&](const Machine&) -> Result<void> {
    const auto input = io::read_scene(options.scene);
    if (!input) return propagate(input);
    engine::render::ForwardOptions forward;
    forward.background = engine::Vec3(to_vec(options.background));
    const PictureContent content = options.what == "depth"   ? PictureContent::depth
                                   : options.what == "alpha" ? PictureContent::alpha
                                                             : PictureContent::color;
    forward.color = pictures::needs_color(content) || options.compare;
    forward.depth = true;
    engine::render::Workspace workspace;
    engine::render::Rendering rendering;
    double psnr_sum = 0;
    terminal.out << std::fixed << std::setprecision(2);
    for (const RenderTask& task : *tasks) {
      scene::Camera camera = task.view.camera;
      if (options.max_side > 0) camera = scene::fit_within(camera, options.max_side);
      engine::render::forward(input->cloud, camera, forward, {}, workspace, rendering);
      if (to) {
        const path file = to->of(task);
        if (auto saved = write_picture(file, rendering, content); !saved) return saved;
        if (!options.compare) terminal.out << file.string() << '\n';
      }
      if (options.compare) {
        const auto psnr = pictures::psnr_against_photo(task.view, rendering.color);
        if (!psnr) return propagate(psnr);
        psnr_sum += *psnr;
        terminal.out << camera.name << "  " << *psnr << " dB\n";
      }
    }
    if (options.compare) terminal.out << "mean  " << psnr_sum / double(tasks->size()) << " dB\n";
    return {};
  });
}

}  // namespace

void add_render_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("render", "Renders pictures of a scene");
  const auto options = std::make_shared<RenderOptions>();
  command->add_option("--scene", options->scene, "Scene to render: .ply, .splat, .spz, .sog or .glb")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--dataset", options->dataset,
                   "Folder with the scene's cameras (COLMAP, transforms.json or an INRIA model)")
      ->type_name("DIR");
  command->add_option("--view", options->views, "Name of a view of the dataset; may be repeated")
      ->default_str("")
      ->type_name("NAME");
  command->add_flag("--all", options->all, "All views of the dataset");
  CLI::Option* const eye = add_triple(*command, "--eye", options->eye, "A camera of your own: its place, world units");
  CLI::Option* const target = add_triple(*command, "--target", options->target, "The point it looks at, world units");
  eye->needs(target);
  add_triple(*command, "--up", options->up, "World direction that points up in its picture")->default_str("0,-1,0");
  command->add_option("--fov", options->fov_deg, "Its vertical field of view, degrees")
      ->check(CLI::Range(1.0, 170.0))
      ->type_name("DEG");
  command->add_option("--size", options->size, "Size of its picture, pixels")->type_name("WxH");
  command
      ->add_option("--out", options->out,
                   "Folder, where each picture gets its view's name, or for one picture a file name")
      ->type_name("DIR|FILE");
  command->add_option("--format", options->format, "Of pictures in a folder; exr holds color, alpha and depth")
      ->check(CLI::IsMember({"png", "jpg", "exr"}));
  command->add_option("--what", options->what, "What to show; png and jpg show depth as shades, near is white")
      ->check(CLI::IsMember({"color", "depth", "alpha"}));
  add_triple(*command, "--background", options->background, "Colour behind the scene, each 0 to 1")
      ->default_str("0,0,0")
      ->type_name("R,G,B");
  command->add_option("--max-side", options->max_side, "Longest side of a picture, pixels; 0: as the camera says")
      ->check(CLI::Range(0, 16384))
      ->type_name("PX");
  command->add_flag("--compare", options->compare,
                    "Print the PSNR of each view against its photo, and the mean; then --out may be left out");
  add_compute_options(*command, options->compute);
  command->callback([options, &action, eye] {
    options->own_camera = eye->count() > 0;
    action = [options](Terminal& terminal) { return run(*options, terminal); };
  });
}

}  // namespace server::cli
