#include "server/edits/results.h"

#include <algorithm>
#include <string>

#include "engine/core/numbers.h"

namespace server::edits {
namespace {

namespace jobs = engine::jobs;
using engine::ErrorCode;
using engine::propagate;

/// "e000012-3" is of edit e000012, made under its claim 3.
std::string edit_of(const std::string& made) { return made.substr(0, made.find('-')); }
std::int64_t claim_of(const std::string& made) {
  return engine::number_in<std::int64_t>(std::string_view(made).substr(std::min(edit_of(made).size() + 1, made.size())))
      .value_or(0);
}

}  // namespace

Result<void> take_in_result(scenes::SceneStore& scenes, const jobs::Job& job) {
  if (job.state != jobs::JobState::succeeded) return {};
  const auto made = scenes::parse_made_version(job.result);
  if (!made) return {};  // of a release whose edits made their versions themselves
  const auto taken = scenes.take_in(job.lane, *made);
  if (taken) return {};
  const auto scene = scenes.find(job.lane);  // a file that is not found may be another reason
  if (!scene && scene.error().code == ErrorCode::not_found) return {};
  return propagate(taken);
}

void settle_results(scenes::SceneStore& scenes, jobs::Queue& queue) {
  for (const std::string& made : scenes.made_versions()) {
    const auto job = queue.find(edit_of(made));
    if (!job && job.error().code != ErrorCode::not_found) continue;  // another time
    if (job && !take_in_result(scenes, *job)) continue;
    const bool is_wanted = job && !jobs::is_final(job->state) && job->claim_number == claim_of(made);
    if (!is_wanted) scenes.discard_made(made);
  }
}

void drop_results(scenes::SceneStore& scenes, const std::string& edit, std::int64_t claim) {
  for (const std::string& made : scenes.made_versions())
    if (edit_of(made) == edit && claim_of(made) <= claim) scenes.discard_made(made);
}

}  // namespace server::edits
