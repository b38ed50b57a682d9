// splatdrag fit: photos with known cameras in, a scene out.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iomanip>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/parallel.h"
#include "engine/fit/checkpoint.h"
#include "engine/fit/fitter.h"
#include "engine/fit/start.h"
#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/input_file.h"
#include "engine/io/scene_file.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/fit_report.h"
#include "server/cli/folders.h"
#include "server/cli/photos.h"
#include "server/cli/progress_display.h"

namespace server::cli {
namespace {

namespace fit = engine::fit;
namespace io = engine::io;
namespace scene = engine::scene;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using std::filesystem::path;
using Clock = std::chrono::steady_clock;

// Choices, not measurements:
constexpr int milestones = 20;                    // lines of the history that a fit writes, evenly over its iterations
constexpr std::size_t photos_per_milestone = 50;  // that a line is measured on, at most
constexpr double min_visible_share = 0.1;  // of the start; with less, poses or units are hardly those of the points
constexpr const char* checkpoint_name = "fit.checkpoint";

constexpr std::size_t random_start = 10'000;  // points, at most as many as there may be Gaussians

/// What a fit begins with.
enum class Init {
  automatic,  ///< A scene that is given, else the sparse points, else random points.
  random,     ///< Random points in the volume that the cameras have in common.
  points,     ///< The dataset's sparse points.
  scene       ///< The scene that is given.
};

struct FitCommandOptions {
  std::string dataset, scene, out;
  Init init = Init::automatic;
  int max_side = 1600, hold_out = 0;
  double checkpoint_every = 20;  // seconds; a checkpoint costs a tenth of one or so
  bool restart = false;
  fit::FitOptions fit;
  ComputeOptions compute;
};

/// The photos to fit to, and those held out, at the size they are used at.
struct Photos {
  std::vector<fit::Photo> training, held_out;
};

Result<Photos> parted_photos(const io::Dataset& dataset, const FitCommandOptions& options) {
  auto loaded = load_photos(dataset, options.max_side);
  if (!loaded) return propagate(loaded);
  Photos photos;
  for (std::size_t i = 0; i < loaded->size(); ++i) {
    const bool held_out = options.hold_out > 0 && i % std::size_t(options.hold_out) == 0;
    (held_out ? photos.held_out : photos.training).push_back(std::move((*loaded)[i]));
  }
  if (photos.training.empty())
    return fail(ErrorCode::invalid_argument, "all photos are held out: hold out fewer", "--hold-out");
  return photos;
}

/// A scene and --init that contradict each other are a mistake of which nobody can tell which half is meant.
Result<void> check_init(const FitCommandOptions& options) {
  const auto wrong = [](const char* what) { return fail(ErrorCode::invalid_argument, what, "--init"); };
  const bool given = !options.scene.empty();
  if (options.init == Init::scene && !given) return wrong("there is no scene to start from: give one with --scene");
  if (given && options.init != Init::scene && options.init != Init::automatic)
    return wrong("a scene to start from is given with --scene, and --init says another start: leave one of them out");
  return {};
}

Result<scene::GaussianCloud> random_cloud(const std::vector<fit::Photo>& photos, const FitCommandOptions& options) {
  std::vector<scene::Camera> cameras;
  for (const fit::Photo& photo : photos) cameras.push_back(photo.camera);
  const auto points = fit::random_points(cameras, std::min(random_start, options.fit.max_gaussians), options.fit.seed);
  if (points) return fit::gaussians_at(*points, 0);
  return fail(points.error().code, points.error().message + " Give a scene with --scene.", options.dataset);
}

/// What the fit begins with.
Result<scene::GaussianCloud> load_start(const io::Dataset& dataset, const std::vector<fit::Photo>& photos,
                                        const FitCommandOptions& options, Terminal& terminal) {
  if (!options.scene.empty()) {
    auto start = io::read_scene(options.scene);
    if (!start) return propagate(start);
    if (start->cloud.size() == 0) return fail(ErrorCode::unprocessable, "there are no Gaussians in it", options.scene);
    if (start->cloud.sh_degree > options.fit.sh_degree)
      start->cloud = fit::with_sh_degree(start->cloud, options.fit.sh_degree);
    // Every row is fitted anew: what a file says of its rows beside the Gaussian need not be true any more.
    start->cloud.extra_stride = 0, start->cloud.extra.clear();
    return std::move(start->cloud);
  }
  if (options.init == Init::random) return random_cloud(photos, options);
  if (dataset.points.empty()) {
    if (options.init == Init::points)
      return fail(ErrorCode::unprocessable,
                  "this dataset has no sparse points to start from: give a scene with --scene, or --init random",
                  options.dataset);
    terminal.err << "warning: this dataset has no sparse points; starting from random ones\n";
    return random_cloud(photos, options);
  }
  const auto points = sparse_points_of(dataset);
  if (!points) return propagate(points);
  return fit::gaussians_at(*points, 0);
}

/// A start that the cameras do not see leads nowhere, whatever the photos show.
Result<void> check_visibility(const scene::GaussianCloud& start, const std::vector<fit::Photo>& photos,
                              Terminal& terminal) {
  const std::size_t visible = fit::visible_count(start, photos);
  if (visible == 0)
    return fail(ErrorCode::unprocessable,
                "no camera sees any of the " + std::to_string(start.size()) +
                    " Gaussians to start from: poses must lead from world to camera, be of the points' own frame, and "
                    "leave more than 0.2 units between camera and subject");
  if (double(visible) < min_visible_share * double(start.size()))
    terminal.err << "warning: the cameras see only " << visible << " of the " << start.size()
                 << " Gaussians to start from: are poses and points of one reconstruction?\n";
  return {};
}

/// A fit under way, with its place on disk.
class RunningFit {
 public:
  RunningFit(std::vector<fit::Photo> photos, const scene::GaussianCloud& start, const FitCommandOptions& options,
             const Machine& machine, Terminal& terminal)
      : options_(options),
        terminal_(terminal),
        file_(path(options.out) / checkpoint_name),
        identity_(fit::identity_of(photos, start, options.fit, SPLATDRAG_VERSION " " + machine.simd)),
        fitter_(std::move(photos), start, options.fit) {}

  /// Goes on from the checkpoint, if there is one.
  Result<void> resume() {
    std::error_code none;
    if (options_.restart || !std::filesystem::exists(file_, none)) return {};
    const auto input = io::InputFile::open(file_.string());
    if (!input) return propagate(input);
    const auto bytes = input->read_at(0, input->size());
    if (!bytes) return propagate(bytes);
    auto history = fit::decode({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, identity_, fitter_);
    if (!history) {
      history.error().message += " Add --restart to begin anew.";
      history.error().where = file_.string();
      return propagate(history);
    }
    history_ = std::move(*history);
    terminal_.err << "going on after iteration " << fitter_.iteration() << ", from " << file_.string() << '\n';
    return {};
  }

  Result<void> run(ProgressDisplay& display) {
    const double before = history_.seconds;
    const auto start = Clock::now();
    const auto spent = [&] { return before + std::chrono::duration<double>(Clock::now() - start).count(); };
    double saved = before;
    if (history_.milestones.empty()) add_milestone(0);
    while (!fitter_.done()) {
      const auto loss = fitter_.step();
      if (!loss) return propagate(loss);
      const int iteration = fitter_.iteration(), all = options_.fit.iterations;
      display.show(double(iteration) / all, describe(*loss));
      history_.seconds = spent();
      if (iteration * std::int64_t(milestones) / all != (iteration - 1) * std::int64_t(milestones) / all)
        add_milestone(iteration);
      if (spent() - saved < options_.checkpoint_every || fitter_.done()) continue;
      keep();
      saved = spent();
    }
    history_.seconds = spent();
    return {};
  }

  void remove_checkpoint() const {
    std::error_code none;  // it is of no more use, and does no harm
    std::filesystem::remove(file_, none);
  }

  [[nodiscard]] const scene::GaussianCloud& cloud() const { return fitter_.cloud(); }
  [[nodiscard]] const std::vector<fit::Photo>& photos() const { return fitter_.photos(); }
  [[nodiscard]] const fit::History& history() const { return history_; }

 private:
  /// A fit does not end because a checkpoint cannot be written: the one before is still there, and the scene is
  /// smaller.
  void keep() {
    const std::string bytes = fit::encode(identity_, history_, fitter_);
    const auto kept = engine::write_file(file_, std::as_bytes(std::span(bytes)));
    if (!kept && !warned_)
      terminal_.err << "warning: no checkpoint after iteration " << fitter_.iteration() << ": " << kept.error().message
                    << '\n';
    warned_ = !kept;
  }

  [[nodiscard]] std::string describe(double loss) const {
    std::ostringstream text;
    text << "iteration " << fitter_.iteration() << " of " << options_.fit.iterations << ", " << cloud().size()
         << " Gaussians, loss " << std::setprecision(3) << loss;
    return text.str();
  }

  void add_milestone(int iteration) {
    const auto near = fit::quality_on(cloud(), photos(), options_.fit.background, photos_per_milestone);
    history_.milestones.push_back({iteration, history_.seconds, cloud().size(), near.psnr_db});
  }

  const FitCommandOptions& options_;
  Terminal& terminal_;
  path file_;
  std::uint64_t identity_;
  fit::Fitter fitter_;
  fit::History history_;
  bool warned_ = false;  ///< Of the last checkpoint.
};

void summarise(std::ostream& out, const path& file, const FitReport& report) {
  out << std::fixed << std::setprecision(2) << file.string() << ": " << report.gaussians << " Gaussians in "
      << std::setprecision(0) << report.history.seconds << " s\n"
      << std::setprecision(2) << "training views: " << report.training.psnr_db << " dB, SSIM " << std::setprecision(4)
      << report.training.ssim << "; worst " << std::setprecision(2) << report.training.worst_psnr_db << " dB, "
      << report.training.worst_view << '\n';
  if (report.held_out)
    out << "held-out views: " << report.held_out->psnr_db << " dB, SSIM " << std::setprecision(4)
        << report.held_out->ssim << "; worst " << std::setprecision(2) << report.held_out->worst_psnr_db << " dB, "
        << report.held_out->worst_view << '\n';
}

Result<void> run(const FitCommandOptions& options, Terminal& terminal) {
  const path folder = options.out;
  if (auto valid = fit::validate(options.fit); !valid) return valid;
  if (auto valid = check_init(options); !valid) return valid;
  if (!options.scene.empty())
    if (auto safe = keep_input_safe(options.scene, folder / "scene.ply"); !safe) return safe;
  if (auto made = make_folder(folder); !made) return made;
  // Better now than after minutes of work.
  if (const auto writable = engine::AtomicFile::create(folder / "scene.ply"); !writable) return propagate(writable);
  std::error_code unreachable;  // then they are not the same
  if (std::filesystem::equivalent(folder, options.dataset, unreachable))
    return fail(ErrorCode::conflict, "files of the dataset would be replaced: choose another folder", "--out");

  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
    const auto dataset =
        io::read_dataset(options.dataset, {.points = options.scene.empty() && options.init != Init::random});
    if (!dataset) return propagate(dataset);
    auto photos = parted_photos(*dataset, options);
    if (!photos) return propagate(photos);
    const auto start = load_start(*dataset, photos->training, options, terminal);
    if (!start) return propagate(start);

    if (auto checked = check_visibility(*start, photos->training, terminal); !checked) return checked;
    RunningFit fitting(std::move(photos->training), *start, options, machine, terminal);
    if (auto resumed = fitting.resume(); !resumed) return resumed;
    {
      ProgressDisplay display(terminal);
      if (auto ran = fitting.run(display); !ran) return ran;
    }

    const io::SceneFile fitted{fit::with_sh_degree(fitting.cloud(), options.fit.sh_degree),
                               io::inria_layout(options.fit.sh_degree)};
    if (auto saved = io::write_scene(folder / "scene.ply", fitted, io::SceneFormat::ply); !saved) return saved;
    FitReport report{.machine = machine,
                     .options = options.fit,
                     .max_side = options.max_side,
                     .hold_out = options.hold_out,
                     .views = fitting.photos().size(),
                     .start_gaussians = start->size(),
                     .gaussians = fitted.cloud.size(),
                     .history = fitting.history(),
                     .training = fit::quality_on(fitted.cloud, fitting.photos(), options.fit.background),
                     .held_out = std::nullopt};
    if (!photos->held_out.empty())
      report.held_out = fit::quality_on(fitted.cloud, photos->held_out, options.fit.background);
    const std::string json = to_json(report);
    if (auto saved = engine::write_file(folder / "report.json", std::as_bytes(std::span(json))); !saved) return saved;
    fitting.remove_checkpoint();
    summarise(terminal.out, folder / "scene.ply", report);
    return {};
  });
}

}  // namespace

void add_fit_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("fit", "Makes a scene from photos with known cameras");
  const auto options = std::make_shared<FitCommandOptions>();
  fit::FitOptions& fit = options->fit;
  const std::map<std::string, Init> init_names{
      {"auto", Init::automatic}, {"random", Init::random}, {"points", Init::points}, {"scene", Init::scene}};
  command
      ->add_option("--dataset", options->dataset,
                   "Folder with photos, their cameras and, if there are any, sparse points (COLMAP, transforms.json or "
                   "an INRIA model)")
      ->required()
      ->type_name("DIR");
  command->add_option("--scene", options->scene, "Scene to start from instead of the sparse points")->type_name("FILE");
  command
      ->add_option(
          "--init", options->init,
          "What to start from: the sparse points, random points in the volume that the cameras have in common, "
          "or the scene; auto is the first there is of scene, points and random")
      ->transform(CLI::CheckedTransformer(init_names, CLI::ignore_case))
      ->type_name("auto|random|points|scene");
  command
      ->add_option("--out", options->out,
                   "Folder for scene.ply and report.json; while at work also fit.checkpoint, from which the same "
                   "command goes on after an interruption")
      ->required()
      ->type_name("DIR");
  command->add_option("--iterations", fit.iterations, "Photos to learn from, one after the other")
      ->check(CLI::Range(1, 10'000'000))
      ->type_name("N");
  command->add_option("--max-gaussians", fit.max_gaussians, "Where growth ends")
      ->check(CLI::Range(std::size_t{1}, std::size_t(io::ReadOptions{}.max_gaussians)))
      ->type_name("N");
  command->add_option("--sh-degree", fit.sh_degree, "How colours may depend on the direction of view, 0 to 3")
      ->check(CLI::Range(0, scene::max_sh_degree))
      ->type_name("N");
  command->add_option("--max-side", options->max_side, "Longest side of the photos as they are used, pixels")
      ->check(CLI::Range(16, 16384))
      ->type_name("PX");
  command
      ->add_option("--hold-out", options->hold_out,
                   "Keep every N-th photo, from the first, to judge the scene by; 0: none")
      ->check(CLI::Range(0, 1'000'000))
      ->type_name("N");
  command->add_option("--seed", fit.seed, "Of all random choices")->type_name("N");
  command->add_option("--checkpoint-every", options->checkpoint_every, "How much work an interruption may cost")
      ->check(CLI::Range(0.0, 86400.0))
      ->type_name("SECONDS");
  command->add_flag("--restart", options->restart, "Begin anew where there is a checkpoint");
  add_compute_options(*command, options->compute);
  command->callback([options, &action] {
    // A scene is as fine as its photos already; coarse ones would only blur it.
    if (!options->scene.empty()) options->fit.halvings = 0;
    action = [options](Terminal& terminal) { return run(*options, terminal); };
  });
}

}  // namespace server::cli
