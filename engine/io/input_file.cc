#include "engine/io/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace engine::io {

InputFile::InputFile(FileDescriptor fd, std::filesystem::path path, std::uint64_t size)
    : fd_(std::move(fd)), path_(std::move(path)), name_(path_.filename().string()), size_(size) {}

Result<InputFile> InputFile::open(const std::filesystem::path& path) {
  FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));  // a pipe must not make us wait
  struct stat info {};
  if (fd.get() < 0 || ::fstat(fd.get(), &info) != 0) return tl::make_unexpected(file_error(errno, "read", path));
  if (S_ISDIR(info.st_mode))
    return fail(ErrorCode::invalid_argument, path.string() + " is a folder; expected a file", path.string());
  if (!S_ISREG(info.st_mode))
    return fail(ErrorCode::invalid_argument, path.string() + " is not a regular file", path.string());
  return InputFile(std::move(fd), path, std::uint64_t(info.st_size));
}

Result<void> InputFile::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  const std::uint64_t begin = offset;
  const std::span<const std::byte> all = into;
  while (!into.empty()) {
    const auto got = ::pread(fd_.get(), into.data(), into.size(), off_t(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return tl::make_unexpected(file_error(errno, "read", path_));
    if (got == 0)
      return fail(ErrorCode::corrupt_data,
                  name_ + " ends at byte " + std::to_string(offset) + "; " + std::to_string(into.size()) +
                      " more were expected: the file is incomplete, copy or download it again",
                  name_);
    into = into.subspan(std::size_t(got));
    offset += std::uint64_t(got);
  }
  if (witness_) witness_(begin, all);
  return {};
}

Result<std::vector<std::byte>> InputFile::read_at(std::uint64_t offset, std::uint64_t size) const {
  std::vector<std::byte> bytes(size);
  if (auto read = read_at(offset, std::span(bytes)); !read) return propagate(read);
  return bytes;
}

}  // namespace engine::io
