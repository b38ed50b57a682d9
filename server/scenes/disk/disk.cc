#include "server/scenes/disk/disk.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/file_descriptor.h"
#include "engine/io/input_file.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using engine::propagate;

tl::unexpected<engine::Error> failed(const std::string& action, const fs::path& path, int error_number) {
  return tl::make_unexpected(engine::file_error(error_number, action, path));
}

template <class Sync>
Result<void> sync_opened(const fs::path& path, int flags, Sync sync) {
  const engine::FileDescriptor opened(::open(path.c_str(), flags | O_RDONLY | O_CLOEXEC));
  if (opened.get() < 0 || sync(opened.get()) != 0) return failed("write", path, errno);
  return {};
}

}  // namespace

Result<void> make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return failed("make the folder", folder, error.value());
  return {};
}

Result<void> sync_file(const fs::path& file) { return sync_opened(file, 0, ::fsync); }
Result<void> sync_file_system(const fs::path& folder) { return sync_opened(folder, O_DIRECTORY, ::syncfs); }

Result<void> move_durably(const fs::path& from, const fs::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) return failed("move to", to, errno);
  if (auto synced = engine::sync_folder(to.parent_path()); !synced) return synced;
  return engine::sync_folder(from.parent_path());
}

Result<void> link_durably(const fs::path& from, const fs::path& to) {
  remove_quietly(to);
  if (::link(from.c_str(), to.c_str()) != 0)
    return errno == ENOENT ? failed("link to", from, errno) : scenes::copy_file(from, to);
  return engine::sync_folder(to.parent_path());
}

Result<void> copy_file(const fs::path& from, const fs::path& to) {
  const auto source = io::InputFile::open(from);
  if (!source) return propagate(source);
  auto target = engine::AtomicFile::create(to);
  if (!target) return propagate(target);
  std::vector<std::byte> chunk(std::size_t{1} << 20);
  for (std::uint64_t at = 0; at < source->size(); at += chunk.size()) {
    const auto part = std::span(chunk).first(std::size_t(std::min<std::uint64_t>(chunk.size(), source->size() - at)));
    if (auto read = source->read_at(at, part); !read) return read;
    if (auto written = target->write(part); !written) return written;
  }
  return target->commit();
}

Result<FileStamp> stamp_of(const fs::path& file) {
  const engine::FileDescriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat about {};
  if (opened.get() < 0 || ::fstat(opened.get(), &about) != 0) return failed("open", file, errno);
  const auto in_ns = [](const timespec& time) { return std::int64_t(time.tv_sec) * 1'000'000'000 + time.tv_nsec; };
  return FileStamp{about.st_ino, std::uint64_t(about.st_size), in_ns(about.st_mtim), in_ns(about.st_ctim)};
}

bool is_settled(const FileStamp& stamp) {
  const auto two_seconds_ago = std::chrono::system_clock::now() - std::chrono::seconds(2);
  return stamp.changed_ns < std::chrono::nanoseconds(two_seconds_ago.time_since_epoch()).count();
}

std::uint64_t bytes_below(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_regular_file(fs::symlink_status(path, ignored))) {
    const auto size = fs::file_size(path, ignored);
    return ignored ? 0 : size;
  }
  std::uint64_t sum = 0;
  for (auto entry = fs::recursive_directory_iterator(path, ignored); !ignored && entry != fs::end(entry);
       entry.increment(ignored)) {
    std::error_code unreadable;
    if (!fs::is_regular_file(entry->symlink_status(unreadable))) continue;
    const auto size = entry->file_size(unreadable);
    if (!unreadable) sum += size;
  }
  return sum;
}

void remove_quietly(const fs::path& path) noexcept {
  std::error_code ignored;
  fs::remove_all(path, ignored);
}

void remove_renamed(const fs::path& path) noexcept {
  std::error_code error;
  const fs::path renamed = path.parent_path() / (removed_prefix + path.filename().string());
  fs::rename(path, renamed, error);
  remove_quietly(error ? path : renamed);
}

Lease::~Lease() {
  if (ended_) remove_renamed(path_);
}

}  // namespace server::scenes
