// A note for each job, beside its folder: what was accepted, and in the end what became of it. From the notes a store
// of records that was damaged or lost is made again.
//
//     <folder>/e000001.job       the note
//     <folder>/e000001/          the job's own folder
//     <folder>/e000001.removed   the note of a job that is being removed
//     <folder>/last_number       the highest number of a job whose note is gone
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "engine/jobs/job.h"

namespace engine::jobs {

/// A record as bytes with a checksum.
[[nodiscard]] std::string encode_note(const Job& job);
///   errors  corrupt_data: damaged; unsupported: a later program wrote it
[[nodiscard]] Result<Job> decode_note(std::string_view bytes);

/// Writes the note of a job, on disk when this returns. Errors are those of write_durably().
[[nodiscard]] Result<void> write_note(const std::filesystem::path& folder, const Job& job);
///   errors  those of read_bytes() and decode_note(); corrupt_data: it is that of another job. `where` is the file.
[[nodiscard]] Result<Job> read_note(const std::filesystem::path& folder, const std::string& id);

/// Says that the job is being removed, so that what is left of it after a crash is taken away and not taken up.
/// Nothing where it has no note.
[[nodiscard]] Result<void> mark_removed(const std::filesystem::path& folder, const std::string& id);
/// Takes mark_removed() back.
void unmark_removed(const std::filesystem::path& folder, const std::string& id);
/// Removes a job's folder and its note; its number stays known. What cannot be removed stays until the next time.
void remove_traces(const std::filesystem::path& folder, const std::string& id);

/// What a folder of jobs holds, by their ids.
struct Traces {
  std::set<std::string> notes, folders, removed;
  std::int64_t highest_number = 0;  ///< Of all jobs that anything tells of.
  bool counter_is_damaged = false;
};
/// Nothing for a folder that does not exist.
///   errors  unavailable: it cannot be read
[[nodiscard]] Result<Traces> find_traces(const std::filesystem::path& folder);

/// The number of the last checkpoint in a job's folder; 0: there is none.
[[nodiscard]] int last_checkpoint(const std::filesystem::path& job_folder);

}  // namespace engine::jobs
