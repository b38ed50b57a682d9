// splatdrag edit: a scene and a drag in, the edited scene and what there is to know about it out.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/edit/edit.h"
#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "engine/params/listing.h"
#include "engine/render/forward.h"
#include "engine/scene/overlay.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/edit_report.h"
#include "server/cli/folders.h"
#include "server/cli/progress_display.h"
#include "server/cli/request_file.h"
#include "server/cli/scene_writing.h"
#include "server/edits/convert.h"
#include "server/edits/convert_selection.h"
#include "server/models/models.h"
#include "server/pictures/picture_names.h"
#include "server/pictures/pictures.h"

namespace server::cli {
namespace {

namespace edit = engine::edit;
namespace io = engine::io;
namespace scene = engine::scene;
using engine::propagate;
using std::filesystem::path;

struct EditOptions {
  std::string scene, dataset, request, name, out, model_dir;
  int pictures = 3;
  ComputeOptions compute;
};

/// Where the results go, and as what the scene is written.
struct Destination {
  path folder, scene_file;
  io::SceneFormat format = io::SceneFormat::ply;
};

/// A name that ends like a scene file is that of the scene, the rest goes beside it; any other is that of a folder. So
/// is one that exists as a folder, however it ends.
Destination destination_of(const path& out) {
  const auto format = io::format_for(out);
  std::error_code unreachable;  // then it is none
  if (!format || std::filesystem::is_directory(out, unreachable)) return {out, out / "scene.ply"};
  return {out.has_parent_path() ? out.parent_path() : path("."), out, *format};
}

/// Errors of the engine name a field of the request; the user knows that field by its place in the file.
void locate_in_file(engine::Error& error, const EditOptions& options, const proto::RequestFile& file) {
  for (const char* field : {"handles", "selection", "heal", "region", "params"})
    if (error.where.starts_with(field)) {
      error.where = path(options.request).filename().string() + ":" + file.address_of(error.where);
      return;
    }
}

/// The request in both forms: as its file has it, and for the engine.
struct BothRequests {
  proto::RequestFile file;
  edit::Request engine;
};

Result<BothRequests> load_request(const EditOptions& options, const models::Models& models) {
  auto file = read_request(options.request, options.name);
  if (!file) return propagate(file);
  auto request = edits::to_engine(file->request);
  if (request)
    if (const auto all = edits::available(file->request, request->params, &models); !all) request = propagate(all);
  if (request && !file->request.selection)  // else it is whole only once that has been carried out
    if (const auto valid = edit::validate(*request); !valid) request = propagate(valid);
  if (!request) {
    locate_in_file(request.error(), options, *file);
    return propagate(request);
  }
  return BothRequests{std::move(*file), std::move(*request)};
}

Result<std::vector<scene::Camera>> load_cameras(const std::string& dataset) {
  if (dataset.empty()) return std::vector<scene::Camera>();
  const auto read = io::read_dataset(dataset, {.points = false});
  if (!read) return propagate(read);
  return io::cameras_of(*read);
}

/// Carries the selection of a request out, if it has one, and that of what is to be healed.
///   returns  warnings
Result<std::vector<std::string>> select_rows(const scene::GaussianCloud& input,
                                             const std::vector<scene::Camera>& cameras, BothRequests& request) {
  const auto& selection = request.file.request.selection;
  const auto& heal = request.file.request.heal;
  const edits::Viewpoints viewpoints{.views = cameras, .up = request.engine.up};
  std::vector<std::string> warnings;
  if (selection) {
    auto selected = edits::select_rows(input, *selection, viewpoints, request.engine);
    if (!selected) return selected;
    warnings = std::move(*selected);
  }
  if (heal) {
    const auto healed = edits::heal_rows(input, *heal, viewpoints, request.engine);
    if (!healed) return healed;
    warnings.insert(warnings.end(), healed->begin(), healed->end());
  }
  return warnings;
}

/// Before, after and mask of the best views.
Result<std::vector<ViewPictures>> write_pictures(const path& folder, const scene::GaussianCloud& before,
                                                 const scene::GaussianCloud& after, const edit::Outcome& outcome,
                                                 std::size_t count) {
  const auto names = pictures::picture_names(outcome.views);
  std::vector<ViewPictures> written;
  for (std::size_t v = 0; v < std::min(count, outcome.views.size()); ++v) {
    const scene::Image was = engine::render::forward(before, outcome.views[v]).color;
    const scene::Image is = engine::render::forward(after, outcome.views[v]).color;
    ViewPictures pictures{outcome.views[v].name, "before_" + names[v] + ".png", "after_" + names[v] + ".png",
                          "mask_" + names[v] + ".png", pictures::psnr_outside(was, is, outcome.masks[v])};
    for (const auto& [name, picture] : {std::pair<std::string&, scene::Image>{pictures.before, was},
                                        {pictures.after, is},
                                        {pictures.mask, pictures::with_mask_shown(was, outcome.masks[v])}})
      if (const auto saved = io::write_image(folder / name, picture); !saved) return propagate(saved);
    written.push_back(std::move(pictures));
  }
  return written;
}

void summarise(std::ostream& out, const Destination& to, const EditReport& report) {
  const edit::Report& edit = report.edit;
  out << to.scene_file.string() << ": " << edit.output_gaussians << " Gaussians, "
      << edit.input_gaussians - edit.removed << " of the " << edit.input_gaussians << " before and " << edit.copies
      << " new ones\n";
  for (std::size_t i = 0; i < edit.handles.size(); ++i)
    out << "handle " << i + 1 << ": " << edit.handles[i].gaussians << " Gaussians\n";
  for (const edit::Attachment& part : edit.parts)
    if (part.settled > 0)
      out << "set down on what it stands on, " << part.settled
          << " from where handles ask (settle \"off\" follows them)\n";
  // In mode `remove` those that go along with the part are removed with it.
  const bool removed = report.request.crumbs == proto::Crumbs::remove || report.request.mode == proto::Mode::remove;
  if (edit.crumbs > 0)
    out << "crumbs that the selection had left out, and that went " << (removed ? "away: " : "along: ") << edit.crumbs
        << " Gaussians\n";
  const bool shadow_goes =
      report.request.shadow == proto::ShadowOfPart::remove || report.request.mode == proto::Mode::remove;
  if (edit.relit > 0)
    out << "in another light, for the shadow of the part has gone " << (shadow_goes ? "away: " : "along: ")
        << edit.relit << " Gaussians\n";
  for (const ViewPictures& pictures : report.pictures) {
    out << (to.folder / pictures.after).string() << ": outside the mask ";
    if (std::isfinite(pictures.psnr_outside_db))
      out << std::round(10 * pictures.psnr_outside_db) / 10 << " dB against " << pictures.before << '\n';
    else
      out << "the same as " << pictures.before << '\n';
  }
}

/// Carries the edit out and shows its progress to the user.
Result<edit::Outcome> run_with_progress(const scene::GaussianCloud& input, const std::vector<scene::Camera>& cameras,
                                        const BothRequests& request, const models::Models& models, Terminal& terminal) {
  ProgressDisplay display(terminal);
  edit::Observer observer;
  observer.progress = [&](const edit::Progress& progress) { display.show(progress); };
  const auto toolbox = edits::make_toolbox(request.file.request, request.engine.params, &models);
  if (!toolbox) return propagate(toolbox);
  return edit::run(input, cameras, request.engine, toolbox->tools(), observer);
}

std::vector<std::string> all_warnings(std::vector<std::string> warnings, const edit::Report& report,
                                      const proto::EditRequest& request) {
  warnings.insert(warnings.end(), report.warnings.begin(), report.warnings.end());
  for (std::string& warning : edits::warnings_about(request)) warnings.push_back(std::move(warning));
  return warnings;
}

/// Everything in the output folder; the scene first, because it is what nobody wants to lose.
Result<void> write_results(const Destination& to, std::size_t pictured_views, const io::SceneFile& input,
                           const edit::Outcome& outcome, EditReport& report, Terminal& terminal) {
  const io::SceneFile edited{scene::flatten(input.cloud, outcome.overlay), input.layout, input.origin};
  if (auto saved = write_and_tell(to.scene_file, edited, to.format, terminal); !saved) return saved;
  auto pictures = write_pictures(to.folder, input.cloud, edited.cloud, outcome, pictured_views);
  if (!pictures) return propagate(pictures);
  report.pictures = std::move(*pictures);
  const std::string json = to_json(report);
  return engine::write_file(to.folder / "report.json", std::as_bytes(std::span(json)));
}

Result<void> run(const EditOptions& options, Terminal& terminal) {
  const Destination to = destination_of(options.out);
  const models::Models models(options.model_dir, options.compute.threads);
  auto request = load_request(options, models);
  if (!request) return propagate(request);
  if (auto safe = keep_input_safe(options.scene, to.scene_file); !safe) return safe;
  if (auto made = make_folder(to.folder); !made) return made;

  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
    const auto input = io::read_scene(options.scene);
    if (!input) return propagate(input);
    const auto cameras = load_cameras(options.dataset);
    if (!cameras) return propagate(cameras);
    const auto start = std::chrono::steady_clock::now();
    const auto selected = select_rows(input->cloud, *cameras, *request);
    auto outcome = selected ? run_with_progress(input->cloud, *cameras, *request, models, terminal)
                            : Result<edit::Outcome>(propagate(selected));
    if (!outcome) {
      locate_in_file(outcome.error(), options, request->file);
      return propagate(outcome);
    }
    EditReport report;
    report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    report.scene_file = path(options.scene).filename().string();
    report.machine = machine;
    report.request = edits::resolved(request->file.request, outcome->report.resolved, request->engine.handles);
    report.edit = outcome->report;
    report.edit.warnings = all_warnings(*selected, outcome->report, request->file.request);
    for (const std::string& warning : report.edit.warnings) terminal.err << "warning: " << warning << '\n';
    auto written = write_results(to, std::size_t(options.pictures), *input, *outcome, report, terminal);
    if (written) summarise(terminal.out, to, report);
    return written;
  });
}

}  // namespace

void add_edit_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("edit", "Drags parts of a scene and writes the edited scene");
  const auto options = std::make_shared<EditOptions>();
  command->add_option("--scene", options->scene, "Scene to edit: .ply, .splat, .spz, .sog or .glb")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--dataset", options->dataset,
                   "Folder with the scene's cameras (COLMAP, transforms.json or an INRIA model); without it, cameras "
                   "are placed around the handles. A selection in the request names views of it")
      ->type_name("DIR");
  command
      ->add_option("--request", options->request,
                   "Edit request, a 3DGS-Drag configuration, or a file of several by name (JSON)")
      ->required()
      ->type_name("FILE");
  command->add_option("--name", options->name, "Which request of a file of several")->type_name("NAME");
  command
      ->add_option("--out", options->out,
                   "Folder for scene.ply, report.json and pictures of the best views; or the edited scene's file, in "
                   "the format of its extension (.ply, .compressed.ply, .splat, .spz, .sog, .glb), and the rest goes "
                   "beside it. Files of these names are replaced")
      ->required()
      ->type_name("DIR|FILE");
  command->add_option("--pictures", options->pictures, "Views to show before, after and with the mask")
      ->check(CLI::Range(0, 1000))
      ->type_name("N");
  command
      ->add_option("--model-dir", options->model_dir,
                   "Folder of pre-trained networks, for the corrector sd and the loss lpips")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  add_compute_options(*command, options->compute);
  command->footer(engine::params::listing());
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
