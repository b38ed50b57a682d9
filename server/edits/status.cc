#include "server/edits/status.h"

#include <algorithm>
#include <utility>

#include "engine/edit/handles.h"
#include "proto/edit_record.h"
#include "proto/time_text.h"
#include "server/edits/convert.h"

namespace server::edits {
namespace {

namespace jobs = engine::jobs;

/// With every parameter filled in, before anybody has worked on it.
proto::EditRequest resolved_now(const proto::EditRequest& asked) {
  const auto request = to_engine(asked);
  if (!request) return asked;
  auto params = request->params;
  params.intervals = engine::edit::resolved_intervals(*request);
  proto::EditRequest out = resolved(asked, params, request->handles);
  const bool radii_are_known =
      std::ranges::all_of(asked.handles, [](const auto& handle) { return handle.radius.has_value(); });
  if (!radii_are_known && !asked.params.intervals) out.params.intervals.reset();  // the selected part decides
  return out;
}

void fill_in(proto::EditStatus& status, proto::EditRecord record, const jobs::Job& job) {
  const bool ended = jobs::is_final(job.state);
  const bool succeeded = job.state == jobs::JobState::succeeded;
  status.progress = record.progress;
  if (!ended && job.state != jobs::JobState::queued) {  // one that waits to go on is at nothing, until its turn comes
    status.stage = std::move(record.stage);
    status.eta_seconds = record.eta_seconds;
    status.iteration = record.iteration;
    status.loss = record.loss;
  }
  status.interval = record.interval;
  if (record.intervals > 0) status.intervals = record.intervals;
  // The pictures and the checkpoint of an interval are there once the job says so, and go with a cancelled job.
  for (proto::FinishedInterval& finished : record.finished_intervals)
    if (finished.interval <= job.finished_intervals && job.state != jobs::JobState::cancelled)
      status.finished_intervals.push_back(std::move(finished));
  status.handles = std::move(record.handles);
  status.parts = std::move(record.parts);
  if (record.request) {
    record.request->selection = std::move(status.request.selection);  // they are kept once, in the payload
    record.request->heal = std::move(status.request.heal);
    status.request = std::move(*record.request);
  }
  status.timings = std::move(record.timings);
  status.warnings = std::move(record.warnings);
  status.uncovered = std::move(record.uncovered);
  status.simd = std::move(record.simd);
  if (succeeded) {
    status.gaussians = record.gaussians;
    status.result_version = record.result_version;
  }
}

}  // namespace

proto::EditStatus status_of(const jobs::Job& job) {
  proto::EditStatus status;
  status.id = job.id;
  status.scene = job.lane;
  status.state = to_string(job.state);
  status.stopped_early = job.stopped_early;
  if (job.queue_position > 0) status.queue_position = job.queue_position;
  if (auto asked = proto::parse_edit_request(job.payload)) {
    status.version = asked->version.value_or(0);
    status.request = resolved_now(*asked);
    status.intervals = status.request.params.intervals.value_or(0);
    status.warnings = warnings_about(*asked);
  }
  if (auto record = proto::parse_edit_record(job.progress)) fill_in(status, std::move(*record), job);
  const proto::Params& params = status.request.params;
  status.iterations = params.annealing_steps.value_or(1) * params.iterations.value_or(0);
  status.error = job.error;
  status.created = proto::rfc3339(job.created);
  if (job.started) status.started = proto::rfc3339(*job.started);
  if (job.ended) status.ended = proto::rfc3339(*job.ended);
  return status;
}

}  // namespace server::edits
