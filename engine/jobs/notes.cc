#include "engine/jobs/notes.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "engine/core/atomic_file.h"
#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/core/numbers.h"
#include "engine/jobs/durable_file.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view magic = "SDJOBNTE";
constexpr std::uint32_t format_number = 3;  // another once a value of ErrorCode becomes another number
constexpr std::uint32_t first_with_expected = 2, first_with_requester = 3;
constexpr const char* note_suffix = ".job";
constexpr const char* removed_suffix = ".removed";
constexpr const char* counter_name = "last_number";
constexpr std::string_view checkpoint_prefix = "checkpoint-";

fs::path note_file(const fs::path& folder, const std::string& id) { return folder / (id + note_suffix); }
fs::path removed_file(const fs::path& folder, const std::string& id) { return folder / (id + removed_suffix); }

void write_time(ByteWriter& out, std::optional<Time> time) {
  out.write(std::uint8_t(time.has_value()));
  out.write(std::int64_t(time.value_or(Time{}).time_since_epoch().count()));
}
std::optional<Time> read_time(ByteReader& in) {
  const bool is_known = in.read<std::uint8_t>() != 0;
  const Time time{std::chrono::milliseconds(in.read<std::int64_t>())};
  return is_known ? std::optional(time) : std::nullopt;
}

/// Those of an id: "e000007.job" is the note of "e000007".
std::optional<std::string> without(const std::string& name, std::string_view suffix) {
  if (!name.ends_with(suffix)) return std::nullopt;
  std::string id = name.substr(0, name.size() - suffix.size());
  return number_of(id) ? std::optional(std::move(id)) : std::nullopt;
}

std::string counter_text(std::int64_t number) {
  const std::string text = std::to_string(number);
  return text + " " + std::to_string(fnv1a(std::as_bytes(std::span(text)))) + "\n";
}

/// 0 where there is none; nothing where it is damaged.
std::optional<std::int64_t> read_counter(const fs::path& folder) {
  const auto text = read_bytes(folder / counter_name);
  if (!text) return text.error().code == ErrorCode::not_found ? std::optional<std::int64_t>(0) : std::nullopt;
  const auto number = number_in<std::int64_t>(std::string_view(*text).substr(0, text->find(' ')));
  return number && counter_text(*number) == *text ? number : std::nullopt;
}

void remove_quietly(const fs::path& path) {
  std::error_code ignored;
  fs::remove_all(path, ignored);
}

}  // namespace

std::string encode_note(const Job& job) {
  ByteWriter out;
  out.write_all(std::span(magic));
  out.write(format_number);
  for (const std::string* text : {&job.id, &job.lane, &job.payload, &job.idempotency_key, &job.progress, &job.result})
    out.write_string(*text);
  out.write_string(to_string(job.state));
  out.write(std::uint8_t(job.stopped_early));
  out.write(std::int32_t(job.finished_intervals));
  out.write(std::uint8_t(job.error.has_value()));
  const Error error = job.error.value_or(Error{});
  out.write(std::int32_t(error.code));
  out.write_string(error.message), out.write_string(error.where);
  for (const std::optional<Time>& time : {std::optional(job.created), job.started, job.ended}) write_time(out, time);
  out.write(std::int64_t(job.expected.count()));
  out.write_string(job.requester);
  out.write(fnv1a(out.bytes()));
  return std::move(out).take();
}

Result<Job> decode_note(std::string_view text) {
  const auto damaged = [] { return fail(ErrorCode::corrupt_data, "the note of a job is damaged"); };
  const auto bytes = std::as_bytes(std::span(text));
  constexpr std::size_t checksum_bytes = sizeof(std::uint64_t);
  if (bytes.size() < magic.size() + checksum_bytes || !text.starts_with(magic)) return damaged();
  const auto checked = bytes.first(bytes.size() - checksum_bytes);
  if (ByteReader(bytes.subspan(checked.size())).read<std::uint64_t>() != fnv1a(checked)) return damaged();
  ByteReader in(checked.subspan(magic.size()));
  const auto format = in.read<std::uint32_t>();
  if (format < 1 || format > format_number)
    return fail(ErrorCode::unsupported, "the note of a job was written by a newer version");
  Job job;
  for (std::string* into : {&job.id, &job.lane, &job.payload, &job.idempotency_key, &job.progress, &job.result})
    *into = in.read_string();
  const auto state = parse_state(in.read_string());
  job.stopped_early = in.read<std::uint8_t>() != 0;
  job.finished_intervals = in.read<std::int32_t>();
  const bool has_error = in.read<std::uint8_t>() != 0;
  const auto code = in.read<std::int32_t>();
  Error error{ErrorCode::internal, in.read_string(), in.read_string()};
  const auto created = read_time(in);
  job.started = read_time(in), job.ended = read_time(in);
  if (format >= first_with_expected) job.expected = std::chrono::milliseconds(in.read<std::int64_t>());
  if (format >= first_with_requester) job.requester = in.read_string();
  if (!in.ok() || in.remaining() != 0 || !state || code < 0 || code > int(ErrorCode::quota_exceeded)) return damaged();
  error.code = ErrorCode(code);
  job.state = *state;
  job.created = created.value_or(Time{});
  if (has_error) job.error = std::move(error);
  return job;
}

Result<void> write_note(const fs::path& folder, const Job& job) {
  return write_durably(note_file(folder, job.id), encode_note(job));
}

Result<Job> read_note(const fs::path& folder, const std::string& id) {
  const fs::path file = note_file(folder, id);
  const auto bytes = read_bytes(file);
  if (!bytes) return propagate(bytes);
  auto job = decode_note(*bytes);
  if (!job) return fail(job.error().code, job.error().message, file);
  if (job->id != id) return fail(ErrorCode::corrupt_data, "it is the note of " + job->id, file);
  return job;
}

Result<void> mark_removed(const fs::path& folder, const std::string& id) {
  std::error_code error;
  fs::rename(note_file(folder, id), removed_file(folder, id), error);
  if (error == std::errc::no_such_file_or_directory) return {};
  if (error) return fail(ErrorCode::unavailable, "the note of " + id + " cannot be renamed: " + error.message(), id);
  return sync_folder(folder);
}

void unmark_removed(const fs::path& folder, const std::string& id) {
  std::error_code ignored;
  fs::rename(removed_file(folder, id), note_file(folder, id), ignored);
}

void remove_traces(const fs::path& folder, const std::string& id) {
  remove_quietly(folder / id);
  // The number stays known before the note goes. Where it cannot be written down, the note stays.
  if (const auto number = number_of(id); number && read_counter(folder).value_or(0) < *number)
    if (!write_durably(folder / counter_name, counter_text(*number))) return;
  remove_quietly(note_file(folder, id));
  remove_quietly(removed_file(folder, id));
}

Result<Traces> find_traces(const fs::path& folder) {
  Traces found;
  std::error_code error;
  if (!fs::exists(folder, error)) return found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename();
    if (number_of(name)) found.folders.insert(name);
    if (const auto id = without(name, note_suffix)) found.notes.insert(*id);
    if (const auto id = without(name, removed_suffix)) found.removed.insert(*id);
  }
  if (error) return fail(ErrorCode::unavailable, "the folder cannot be read: " + error.message(), folder);
  const auto counter = read_counter(folder);
  found.counter_is_damaged = !counter.has_value();
  found.highest_number = counter.value_or(0);
  for (const auto* ids : {&found.notes, &found.folders, &found.removed})
    for (const std::string& id : *ids) found.highest_number = std::max(found.highest_number, number_of(id).value_or(0));
  return found;
}

int last_checkpoint(const fs::path& job_folder) {
  int last = 0;
  std::error_code error;
  for (fs::directory_iterator entry(job_folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename();
    if (!name.starts_with(checkpoint_prefix)) continue;
    last = std::max(last, number_in<int>(std::string_view(name).substr(checkpoint_prefix.size())).value_or(0));
  }
  return last;
}

}  // namespace engine::jobs
