#include "engine/jobs/reconcile.h"

#include <chrono>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "engine/jobs/notes.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

/// One call of reconcile().
class Reconciliation {
 public:
  Reconciliation(Store& store, const fs::path& folder) : store_(store), folder_(folder) {}

  Result<std::vector<Error>> run() {
    auto traces = find_traces(folder_);
    if (!traces) return propagate(traces);
    if (traces->counter_is_damaged) say(ErrorCode::corrupt_data, "", "the highest number of a job is damaged");
    for (const std::string& id : traces->removed)
      if (auto removed = finish_removal(id); !removed) return propagate(removed);
    for (const std::string& id : traces->notes)
      if (auto matched = match(id); !matched) return propagate(matched);
    if (auto noted = note_what_is_not_noted(*traces); !noted) return propagate(noted);
    for (const std::string& id : traces->folders)
      if (auto looked = look_at_folder(id); !looked) return propagate(looked);
    return std::move(findings_);
  }

 private:
  void say(ErrorCode code, const std::string& id, std::string what) {
    findings_.push_back({code, std::move(what), id});
  }

  /// The record; nothing where the store has none.
  Result<std::optional<Job>> record_of(const std::string& id) {
    auto job = store_.find(id);
    if (job) return std::optional(std::move(*job));
    if (job.error().code == ErrorCode::not_found) return std::optional<Job>();
    return propagate(job);
  }

  Result<void> finish_removal(const std::string& id) {
    const auto record = record_of(id);
    if (!record) return propagate(record);
    if (*record && !is_final((*record)->state)) {  // the store has forgotten that it had ended
      unmark_removed(folder_, id);
      return match(id);
    }
    if (*record)
      if (auto removed = store_.remove(id); !removed) return removed;
    remove_traces(folder_, id);
    return {};
  }

  Result<void> match(const std::string& id) {
    const auto record = record_of(id);
    if (!record) return propagate(record);
    auto note = read_note(folder_, id);
    if (!note && note.error().code != ErrorCode::corrupt_data) return propagate(note);
    if (!note) return match_damaged(id, *record);
    if (!*record) return put_back(std::move(*note));
    const Job& known = **record;
    if (known.lane != note->lane || known.payload != note->payload) {
      say(ErrorCode::conflict, id,
          "the store and the note of " + id + " speak of different jobs: the store is believed");
      return write_note(folder_, known);
    }
    if (is_final(known.state) && !is_final(note->state)) return write_note(folder_, known);
    if (!is_final(known.state) && is_final(note->state)) return put_back(std::move(*note));
    return {};
  }

  Result<void> match_damaged(const std::string& id, const std::optional<Job>& record) {
    if (!record) {
      say(ErrorCode::corrupt_data, id,
          id + " was accepted, but its record is lost and its note is damaged: it is left alone");
      return {};
    }
    say(ErrorCode::corrupt_data, id, "the note of " + id + " is damaged: it is written anew");
    return write_note(folder_, *record);
  }

  Result<void> put_back(Job job) {
    const bool has_ended = is_final(job.state);
    // How often it was claimed is lost. Whoever holds an earlier claim must not hold one again: seconds count up faster
    // than claims do.
    const auto seconds = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
    job.claim_number = seconds.time_since_epoch().count();
    if (!has_ended) {
      job.state = JobState::queued;
      job.finished_intervals = last_checkpoint(folder_ / job.id);
    }
    auto restored = store_.restore(job);
    if (!restored && restored.error().code == ErrorCode::conflict) {
      job.idempotency_key.clear();  // whoever sent the request again got another job meanwhile
      restored = store_.restore(job);
    }
    if (!restored) return restored;
    say(ErrorCode::corrupt_data, job.id,
        "the job store had lost " + job.id +
            (has_ended ? ", which has ended: it is put back" : ": it is taken up again"));
    return {};
  }

  /// Jobs of releases without notes, and those whose note was lost.
  Result<void> note_what_is_not_noted(const Traces& traces) {
    const auto active = store_.list({.active_only = true, .limit = std::numeric_limits<std::int32_t>::max()});
    if (!active) return propagate(active);
    for (const Job& listed : *active) {
      if (traces.notes.contains(listed.id)) continue;
      const auto job = store_.find(listed.id);  // a list has no payloads
      if (!job) return propagate(job);
      if (auto written = write_note(folder_, *job); !written) return written;
    }
    return {};
  }

  Result<void> look_at_folder(const std::string& id) {
    const auto record = record_of(id);
    if (!record) return propagate(record);
    std::error_code ignored;
    if (*record && (*record)->state == JobState::cancelled) fs::remove_all(folder_ / id, ignored);
    if (!*record && fs::exists(folder_ / id, ignored))
      say(ErrorCode::not_found, id, "nothing is known of " + id + ", which has a folder: it is left alone");
    return {};
  }

  Store& store_;
  const fs::path& folder_;
  std::vector<Error> findings_;
};

}  // namespace

Result<std::vector<Error>> reconcile(Store& store, const fs::path& folder) {
  return Reconciliation(store, folder).run();
}

}  // namespace engine::jobs
