#include "server/edits/edit_job.h"

#include <spdlog/logger.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <sstream>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "engine/render/forward.h"
#include "proto/edit_record.h"
#include "server/edits/convert.h"
#include "server/edits/convert_selection.h"
#include "server/edits/estimate.h"
#include "server/edits/interval_pictures.h"
#include "server/edits/record_keeper.h"
#include "server/edits/stages.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;
namespace scene = engine::scene;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;
using engine::jobs::JobContext;
using engine::jobs::JobResult;

constexpr std::string_view inputs_begin = "of ";
constexpr int background_niceness = 10;  // beyond that of the process: its starter may have chosen one

/// On Linux, process 0 of PRIO_PROCESS is the calling thread alone; the first thread has the process's id. Where this
/// fails, edits are merely less polite.
void yield_to_others() {
  (void)::setpriority(PRIO_PROCESS, 0, ::getpriority(PRIO_PROCESS, id_t(::getpid())) + background_niceness);
}

void log(const Workshop& workshop, spdlog::level::level_enum level, const JobContext& context,
         const std::string& message) {
  if (workshop.logger != nullptr) workshop.logger->log(level, context.id() + ": " + message);
}

std::string whole_seconds(double seconds) { return std::to_string(std::lround(seconds)) + " s"; }

std::vector<proto::Point> to_points(const std::vector<engine::DVec3>& positions) {
  std::vector<proto::Point> points;
  for (const engine::DVec3& p : positions) points.push_back({p.x, p.y, p.z});
  return points;
}

/// The record of an earlier run, as far as its checkpoint bears it out.
proto::EditRecord earlier_record(const JobContext& context) {
  if (context.earlier_progress().empty()) return {};
  auto record = proto::parse_edit_record(context.earlier_progress());
  if (!record) return {};  // of another version of the program: the edit itself does not depend on it
  std::erase_if(record->finished_intervals,
                [&](const auto& finished) { return finished.interval > context.finished_intervals(); });
  return std::move(*record);
}

/// What an edit is about beside its request, in a line: it stands before each checkpoint. An edit that is taken up
/// again after it had failed may find another.
std::string inputs_line(const scenes::SceneInfo& scene, const scenes::VersionInfo& version) {
  std::ostringstream line;
  line << inputs_begin << "version " << version.version << " of " << version.created.time_since_epoch().count()
       << ", dataset " << (scene.dataset ? scene.dataset->number : 0);
  if (scene.up) line << std::hexfloat << ", up " << scene.up->x << ' ' << scene.up->y << ' ' << scene.up->z;
  line << '\n';
  return line.str();
}

/// Where in its work an edit is, as far as it is the same in each attempt.
std::string place_of(const proto::EditRecord& record) {
  return record.interval > 0 ? "interval " + std::to_string(record.interval) + ", " + record.stage : record.stage;
}

class Run {
 public:
  Run(JobContext& context, const Workshop& workshop)
      : context_(context), workshop_(workshop), keeper_(earlier_record(context), [this](std::string text) {
          context_.publish_progress(std::move(text));
          context_.enter(place_of(keeper_.record()));
        }) {}

  Result<void> operator()() {
    if (auto loaded = load(); !loaded) return loaded;
    Result<void> done;
    workshop_.arena.run([&] { done = work(); });
    return done;
  }

 private:
  /// The request, and what it is about.
  Result<void> load() {
    keeper_.enter(JobStage::load);
    auto asked = proto::parse_edit_request(context_.payload());
    if (!asked) return propagate(asked);
    asked_ = std::move(*asked);
    auto request = to_engine(asked_);
    if (!request) return propagate(request);
    request_ = std::move(*request);
    if (auto all = available(asked_, request_.params, workshop_.models); !all) return all;
    const auto about = workshop_.scenes.find(scene_id());
    if (!about) return propagate(about);
    if (about->up) request_.up = *about->up;
    const auto version_info = workshop_.scenes.find_version(scene_id(), std::to_string(version_number()));
    if (!version_info) return propagate(version_info);
    inputs_ = inputs_line(*about, *version_info);
    const auto dataset = workshop_.scenes.dataset(scene_id());
    if (!dataset) return propagate(dataset);
    cameras_ = cameras_of(dataset->get());
    auto version = workshop_.scenes.load(scene_id(), std::to_string(version_number()));
    if (!version) return propagate(version);
    input_ = version->cloud.base;
    if (version->cloud.overlay) input_ = std::make_shared<scene::GaussianCloud>(scene::flatten(version->cloud));
    return {};
  }

  /// Says what moves, if a selection does, and what is healed.
  Result<void> select_rows() {
    const edits::Viewpoints viewpoints{.views = cameras_, .up = request_.up};
    const auto warn = [&](const Result<std::vector<std::string>>& warnings) -> Result<void> {
      if (!warnings) return propagate(warnings);
      for (const std::string& warning : *warnings) keeper_.warn(warning);
      return {};
    };
    if (asked_.selection)
      if (auto done = warn(edits::select_rows(*input_, *asked_.selection, viewpoints, request_)); !done) return done;
    if (asked_.heal) return warn(edits::heal_rows(*input_, *asked_.heal, viewpoints, request_));
    return {};
  }

  Result<void> work() {
    if (auto selected = select_rows(); !selected) return selected;
    keeper_.expect_after(seconds_to_publish(input_->size()));
    pictures_.emplace(context_.folder(), *input_, workshop_.pictured_views);
    auto outcome = run();
    if (!outcome) return propagate(outcome);
    return publish(*outcome);
  }

  /// Tells at once what will be done.
  void tell_assignment(const edit::Report& report) {
    proto::EditRecord& record = keeper_.record();
    record.intervals = report.resolved.intervals;
    record.request = resolved(asked_, report.resolved, request_.handles);
    record.request->selection.reset();  // they may be long, and the job's payload has them
    record.request->heal.reset();
    record.simd = engine::render::simd_target();
    record.handles.clear();
    for (const edit::HandleReport& handle : report.handles) record.handles.push_back({handle.gaussians});
    record.parts = to_parts(report.parts);
    for (const std::string& warning : warnings_about(asked_)) keeper_.warn(warning);
    keeper_.publish();
  }

  /// Carries the edit out, or ends it with what it has where that was asked for or it has outlived its time.
  Result<edit::Outcome> run() {
    auto outcome = attempt();
    // Its end has to be one of those two: another error it would only meet again, or hide.
    if (outcome || outcome.error().code != ErrorCode::cancelled) return outcome;
    if (context_.cancel_token().stop_requested()) return outcome;
    if (given_up_ == GivenUp::stopped) return attempt();
    if (given_up_ == GivenUp::no) return outcome;
    if (context_.finished_intervals() == 0)
      return fail(ErrorCode::too_large,
                  "the edit has not finished an interval in " + whole_seconds(workshop_.outlived_seconds) +
                      ", twice what one may be estimated to take (--edit-time): choose smaller radii, fewer views or "
                      "iterations, or a smaller max_image_side");
    keeper_.warn("the edit ended early, after interval " + std::to_string(context_.finished_intervals()) +
                 ": it had worked for " + whole_seconds(workshop_.outlived_seconds) +
                 ", twice what one may be estimated to take (--edit-time)");
    note(spdlog::level::warn, "has outlived its time, and ends after its last interval");
    return attempt();
  }

  /// Who stops an edit wants what it has, not what it would have had: the interval in work is given up. The state of
  /// the last finished one is on disk.
  void look_whether_to_stop() {
    if (given_up_ != GivenUp::no || !context_.stop_requested() || context_.finished_intervals() == 0) return;
    given_up_ = GivenUp::stopped;
    if (last_interval_ >= context_.finished_intervals()) out_of_time_.request_stop();
  }

  /// The edit asks this all the time, which costs no more than looking at a clock.
  void look_at_the_time() {
    if (workshop_.outlived_seconds <= 0 || given_up_ != GivenUp::no) return;
    if (keeper_.seconds() < workshop_.outlived_seconds) return;
    given_up_ = GivenUp::outlived;
    out_of_time_.request_stop();
  }

  Result<edit::Outcome> attempt() {
    out_of_time_ = {};
    const std::stop_callback cancelled(context_.cancel_token(), [this] { out_of_time_.request_stop(); });
    edit::Observer observer;
    observer.assigned = [this](const edit::Report& report) { tell_assignment(report); };
    observer.progress = [this](const edit::Progress& progress) {
      keeper_.advance(progress);
      look_whether_to_stop();
      look_at_the_time();
    };
    observer.moment = [this](const edit::Moment& moment) { return pictures_->add(moment); };
    observer.pictured = std::size_t(std::max(0, workshop_.pictured_views));
    observer.interval_done = [this](const edit::IntervalDone& done) { return finish_interval(done); };
    // A checkpoint that could not be used is made up for first: the record promises its interval.
    observer.keep = [this] {
      return (context_.stop_requested() || given_up_ == GivenUp::outlived) &&
             last_interval_ >= context_.finished_intervals();
    };
    observer.stop = out_of_time_.get_token();
    const auto toolbox = make_toolbox(asked_, request_.params, workshop_.models);
    if (!toolbox) return propagate(toolbox);
    edit::Tools tools = toolbox->tools();
    if (tools.perceptual == nullptr) tools.perceptual = workshop_.perceptual;
    auto state = last_state();
    last_interval_ = state ? state->interval : 0;
    return edit::run(*input_, cameras_, request_, tools, observer, std::move(state));
  }

  /// What the rest should take, as far as anybody knows.
  [[nodiscard]] std::optional<std::chrono::milliseconds> left() {
    const std::optional<double> seconds = keeper_.record().eta_seconds;
    if (!seconds) return std::nullopt;
    return std::chrono::milliseconds(std::int64_t(1000 * *seconds));
  }

  /// The state to go on from; nothing: from the start.
  std::optional<edit::State> last_state() {
    if (context_.finished_intervals() == 0) return std::nullopt;
    const auto saved = context_.load_checkpoint();
    std::string_view bytes = saved ? std::string_view(*saved) : std::string_view();
    if (bytes.starts_with(inputs_begin)) {  // else it is of a release before
      const std::string_view inputs = bytes.substr(0, bytes.find('\n') + 1);
      if (inputs != inputs_) {
        begin_anew();
        return std::nullopt;
      }
      bytes.remove_prefix(inputs.size());
    }
    auto state = saved ? edit::decode(bytes, *input_, request_) : propagate(saved);
    if (state && state->interval == context_.finished_intervals()) {
      note(spdlog::level::info, "goes on after interval " + std::to_string(state->interval));
      return std::move(*state);
    }
    begin_again(state ? engine::Error{ErrorCode::corrupt_data, "it is that of another interval", {}} : state.error());
    return std::nullopt;
  }

  void note(spdlog::level::level_enum level, const std::string& message) const {
    log(workshop_, level, context_, message);
  }

  void begin_again(const engine::Error& error) {
    note(spdlog::level::warn, "begins again, its checkpoint cannot be used: " + error.message);
    keeper_.warn(
        "the edit was interrupted and had to begin again: what it had saved could not be used; the result is "
        "the same");
  }

  /// It has other inputs than what was saved. What it has taken so far was for another result.
  void begin_anew() {
    note(spdlog::level::warn, "begins anew: its scene has another dataset or `up` than when it failed");
    keeper_.warn(
        "the edit began anew when it was taken up again: its scene has another dataset or another `up` than before");
    keeper_.forget_time();
    keeper_.record().finished_intervals.clear();
  }

  Result<void> finish_interval(const edit::IntervalDone& done) {
    last_interval_ = done.interval;
    keeper_.add({.interval = done.interval,
                 .seconds = done.seconds,
                 .positions = to_points(done.positions),
                 .loss = done.loss,
                 .renders = pictures_->renders_of(done.interval)});
    keeper_.publish();
    if (done.interval <= context_.finished_intervals()) return {};  // made up for
    auto saved = context_.save_checkpoint(done.interval, inputs_ + edit::encode(done.state), left());
    if (!saved && saved.error().code != ErrorCode::cancelled)
      return fail(saved.error().code, "the checkpoint of interval " + std::to_string(done.interval) +
                                          " cannot be kept: " + saved.error().message);
    return saved;
  }

  Result<void> publish(const edit::Outcome& outcome) {
    keeper_.enter(JobStage::publish);
    // A process that was halted for long may not know yet that another has the edit now.
    if (auto held = context_.confirm_claim(); !held) return held;
    if (context_.cancel_token().stop_requested())
      return fail(ErrorCode::cancelled, context_.id() + " was interrupted before its result was published");
    workshop_.settle_results();
    const auto made =
        workshop_.scenes.make_version(scene_id(), version_number(), context_.id(), context_.claim(), outcome.overlay);
    if (!made) return propagate(made);
    made_ = scenes::to_text(*made);
    const edit::Report& report = outcome.report;
    proto::EditRecord& record = keeper_.record();
    record.result_version = made->version.version;
    record.gaussians = {report.input_gaussians, report.output_gaussians, report.removed, report.copies,
                        report.changeable,      report.crumbs,           report.relit};
    record.uncovered = to_uncovered(report.uncovered);
    for (const std::string& warning : report.warnings) keeper_.warn(warning);
    stopped_early_ = outcome.stopped_early;
    keeper_.finish();
    if (workshop_.timed) workshop_.timed(keeper_.record().timings);
    return {};
  }

  [[nodiscard]] const std::string& scene_id() const { return *asked_.scene; }
  [[nodiscard]] int version_number() const { return *asked_.version; }

  JobContext& context_;
  const Workshop& workshop_;
  RecordKeeper keeper_;
  proto::EditRequest asked_;
  edit::Request request_;
  std::string inputs_;  ///< inputs_line()
  std::vector<scene::Camera> cameras_;
  std::shared_ptr<const scene::GaussianCloud> input_;
  std::optional<IntervalPictures> pictures_;
  int last_interval_ = 0;  ///< That this run has finished or taken over.
  /// Why the rest of the edit has been given up. Once it has been, no other reason counts: the attempt that makes what
  /// there is must not be given up as well.
  enum class GivenUp { no, stopped, outlived };
  GivenUp given_up_ = GivenUp::no;
  std::stop_source out_of_time_;  ///< Ends an attempt; fires with the context's token, too.
  bool stopped_early_ = false;
  std::string made_;

 public:
  [[nodiscard]] JobResult result() const { return {.text = made_, .stopped_early = stopped_early_}; }
};

}  // namespace

Result<JobResult> carry_out(JobContext& context, const Workshop& workshop) {
  yield_to_others();
  try {
    Run run(context, workshop);
    if (const auto done = run(); !done) {
      if (done.error().code != ErrorCode::cancelled) log(workshop, spdlog::level::err, context, done.error().message);
      return propagate(done);
    }
    log(workshop, spdlog::level::info, context, "done");
    return run.result();
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large,
                "the edit needs more memory than this machine has left: choose smaller radii, fewer views or a smaller "
                "max_image_side, or edit a smaller scene");
  } catch (const std::exception& bug) {
    // Whoever reads the log can act on what was thrown; to clients it may show more than they should see.
    log(workshop, spdlog::level::err, context, std::string("bug: ") + bug.what());
    return fail(ErrorCode::internal, "the edit met an unexpected error, please report it; the service's log says more");
  }
}

}  // namespace server::edits
