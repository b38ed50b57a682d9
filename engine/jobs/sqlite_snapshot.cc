#include "engine/jobs/sqlite_snapshot.h"

#include <fcntl.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <thread>

#include "engine/core/file_descriptor.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

constexpr const char* store_name = "jobs.db";
constexpr const char* log_name = "jobs.db-wal";
constexpr int tries = 50;
constexpr std::chrono::milliseconds between_tries{20};

/// The beginning of the write-ahead log. It is another one each time the log begins anew, which it does only once all
/// that it held is in the store's file (SQLite's file format, section 4.1: the salts). Nothing where there is no log.
using LogHeader = std::optional<std::array<char, 32>>;
LogHeader read_log_header(const fs::path& folder) {
  std::ifstream in(folder / log_name, std::ios::binary);
  std::array<char, 32> header{};
  if (!in.read(header.data(), header.size())) return std::nullopt;
  return header;
}

/// No error for a file that is not there.
std::error_code copy_if_there(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
  if (error == std::errc::no_such_file_or_directory) return {};
  return error;
}

}  // namespace

Result<void> copy_sqlite_store(const fs::path& from, const fs::path& to) {
  std::error_code ignored;
  if (!fs::exists(from / store_name, ignored))
    return fail(ErrorCode::not_found, "there is no job store", from / store_name);
  for (int i = 0; i < tries; ++i) {
    // The file changes by what the log holds and by nothing else. So as long as the log does not begin anew, its copy,
    // taken last, mends whatever of the file was copied half-way; what the log's copy has half of has no checksum.
    const LogHeader before = read_log_header(from);
    fs::remove(to / log_name, ignored);
    if (const auto error = copy_if_there(from / store_name, to / store_name))
      return tl::make_unexpected(file_error(error.value(), "copy", from / store_name));
    if (const auto error = copy_if_there(from / log_name, to / log_name))
      return tl::make_unexpected(file_error(error.value(), "copy", from / log_name));
    if (read_log_header(from) == before) return {};
    std::this_thread::sleep_for(between_tries);
  }
  return fail(ErrorCode::busy, "the job store changes faster than it can be copied: try again", from / store_name);
}

std::optional<bool> is_sqlite_store_in_use(const fs::path& folder) {
  // To ask for the lock of one who writes, nobody has to be allowed to write.
  const FileDescriptor file(::open((folder / store_name).c_str(), O_RDONLY | O_CLOEXEC));
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;  // all of the file: SQLite locks bytes far behind its end
  if (file.get() < 0 && errno == ENOENT) return false;
  if (file.get() < 0 || ::fcntl(file.get(), F_GETLK, &lock) != 0) return std::nullopt;
  return lock.l_type != F_UNLCK;
}

}  // namespace engine::jobs
