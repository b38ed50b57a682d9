#include "server/scenes/uploads/zip_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "engine/io/zip_directory.h"
#include "server/scenes/disk/disk.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

constexpr std::ptrdiff_t max_depth = 32;  // folders within folders; datasets have two or three
// Of an entry in the directory: 46, its name, and times and owners that some programs note.
constexpr std::uint64_t directory_entry_bytes = 256, small_directory_bytes = 64 << 10;

struct CloseArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
struct CloseEntry {
  void operator()(zip_file_t* entry) const { zip_fclose(entry); }
};
using Archive = std::unique_ptr<zip_t, CloseArchive>;
using Entry = std::unique_ptr<zip_file_t, CloseEntry>;

ErrorCode code_for(int zip_error) {
  switch (zip_error) {
    case ZIP_ER_COMPNOTSUPP:
    case ZIP_ER_ENCRNOTSUPP:
    case ZIP_ER_NOPASSWD:
    case ZIP_ER_WRONGPASSWD:
    case ZIP_ER_OPNOTSUPP:
      return ErrorCode::unsupported;
    case ZIP_ER_MEMORY:
      return ErrorCode::too_large;
    default:
      return ErrorCode::corrupt_data;
  }
}

/// In our own words: libzip's are for programmers, and hold what the file or the system made it say.
const char* reason_of(int zip_error) {
  switch (zip_error) {
    case ZIP_ER_NOZIP:
      return "it is no zip file, or its end is missing";
    case ZIP_ER_COMPNOTSUPP:
      return "it is compressed in a way that is not supported; deflate is";
    case ZIP_ER_MEMORY:
      return "it needs more memory than there is";
    case ZIP_ER_READ:
    case ZIP_ER_SEEK:
    case ZIP_ER_OPEN:
      return "it cannot be read";
    default:
      return "it is damaged";
  }
}

/// An entry's name as it may stand in an address: one line of ASCII, not long.
std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 100)) out += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?';
  return out;
}

tl::unexpected<engine::Error> too_many(const std::string& name, const std::string& found, std::size_t most) {
  return fail(
      ErrorCode::too_large,
      name + " holds " + found + "; the limit (--max-dataset-files) is " + std::to_string(most) + " files and folders",
      name);
}

/// libzip loads the directory whole, some 300 bytes of memory for each entry: how large it is is asked before.
Result<void> check_directory(const fs::path& zip, const std::string& name, const ZipLimits& limits) {
  const auto directory = engine::io::largest_directory(zip);
  if (!directory) return propagate(directory);
  if (directory->entries > limits.max_files)
    return too_many(name, std::to_string(directory->entries) + " entries", limits.max_files);
  if (directory->bytes > std::max(small_directory_bytes, directory_entry_bytes * limits.max_files))
    return too_many(name, "a directory of " + std::to_string(directory->bytes) + " bytes", limits.max_files);
  return {};
}

Result<Archive> open_archive(const fs::path& zip, const std::string& name) {
  int error = 0;
  Archive archive(zip_open(zip.c_str(), ZIP_RDONLY, &error));
  if (archive) return archive;
  return fail(code_for(error), std::string("the zip file cannot be opened, ") + reason_of(error) + ": make it anew",
              name);
}

/// Path of an entry below the folder; nothing if the name may not stand in a zip file from a stranger. Some programs of
/// Windows write backslashes.
std::optional<fs::path> safe_path(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  const bool drive = name.size() > 1 && name[1] == ':';
  const bool control = std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (name.empty() || name.size() > 1000 || name.front() == '/' || drive || control) return std::nullopt;
  fs::path path;
  for (const fs::path& part : fs::path(name)) {
    if (part == ".." || part.native().size() > 255) return std::nullopt;
    if (!part.empty() && part != ".") path /= part;
  }
  return path;
}

/// A link, a device, a pipe: anything but a file or a folder.
bool is_special(zip_t* archive, zip_uint64_t index) {
  zip_uint8_t system = 0;
  zip_uint32_t attributes = 0;
  if (zip_file_get_external_attributes(archive, index, 0, &system, &attributes) != 0) return false;
  const bool has_mode = system == ZIP_OPSYS_UNIX || system == ZIP_OPSYS_OS_X;
  const auto type = has_mode ? (attributes >> 16) & S_IFMT : 0;
  return type != 0 && type != S_IFREG && type != S_IFDIR;
}

class Unzip {
 public:
  Unzip(Archive archive, std::string name, fs::path into, const ZipLimits& limits, std::uint64_t zip_bytes)
      : archive_(std::move(archive)), name_(std::move(name)), into_(std::move(into)), limits_(limits) {
    allowed_ = std::min(limits_.max_bytes, std::max(limits_.free_bytes, limits_.max_ratio * zip_bytes));
  }

  Result<void> all() {
    const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
    if (count < 0 || std::uint64_t(count) > limits_.max_files)
      return too_many(name_, std::to_string(count) + " entries", limits_.max_files);
    for (zip_int64_t i = 0; i < count; ++i)
      if (auto unpacked = one(zip_uint64_t(i)); !unpacked) return unpacked;
    return {};
  }

 private:
  Result<void> one(zip_uint64_t index) {
    zip_stat_t stat;
    zip_stat_init(&stat);
    if (zip_stat_index(archive_.get(), index, 0, &stat) != 0 || (stat.valid & ZIP_STAT_NAME) == 0)
      return fail(ErrorCode::corrupt_data, "entry " + std::to_string(index) + " of the zip file is damaged", name_);
    const std::string entry = stat.name;
    const std::string where = name_ + ":" + printable(entry);
    const auto path = safe_path(entry);
    if (!path)
      return fail(ErrorCode::invalid_argument,
                  "the name of an entry must be relative, without \"..\" and without control characters", where);
    if (is_special(archive_.get(), index))
      return fail(ErrorCode::invalid_argument, "a zip file may hold files and folders only; this is a link or a device",
                  where);
    if ((stat.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && stat.encryption_method != ZIP_EM_NONE)
      return fail(ErrorCode::unsupported, "the entry is encrypted: make the zip file without a password", where);
    if (path->empty()) return {};  // "./"
    const bool folder = entry.back() == '/' || entry.back() == '\\';
    if (!folder && !files_.insert(path->string()).second)
      return fail(ErrorCode::corrupt_data, "the zip file has two entries of this name", where);
    const fs::path parent = folder ? *path : path->parent_path();
    if (std::distance(parent.begin(), parent.end()) > max_depth)
      return fail(ErrorCode::too_large, "the entry lies more than " + std::to_string(max_depth) + " folders deep",
                  where);
    for (fs::path made = parent; !made.empty() && folders_.insert(made.string()).second;) made = made.parent_path();
    if (files_.size() + folders_.size() > limits_.max_files)
      return too_many(name_, "more files and folders than are allowed", limits_.max_files);
    if (auto status = make_folder(into_ / parent); !status)
      return fail(status.error().code == ErrorCode::no_space ? ErrorCode::no_space : ErrorCode::corrupt_data,
                  status.error().message, where);
    return folder ? Result<void>() : unpack(index, into_ / *path, where);
  }

  Result<void> unpack(zip_uint64_t index, const fs::path& to, const std::string& where) {
    const Entry entry(zip_fopen_index(archive_.get(), index, 0));
    if (!entry) return failed(zip_get_error(archive_.get()), where);
    const engine::FileDescriptor file(::open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (file.get() < 0) {
      const int error = errno;  // a folder of that name, or a name that this file system takes for another one's
      return fail(error == EEXIST || error == EISDIR ? ErrorCode::corrupt_data : engine::file_error(error, "", to).code,
                  "the entry cannot be unpacked: " + engine::file_error(error, "write", to.filename()).message, where);
    }
    for (;;) {
      const zip_int64_t got = zip_fread(entry.get(), chunk_.data(), chunk_.size());
      if (got < 0) return failed(zip_file_get_error(entry.get()), where);
      if (got == 0) return {};
      if (unpacked_ += std::uint64_t(got); unpacked_ > allowed_)
        return fail(ErrorCode::too_large,
                    "the zip file unpacks to more than " + std::to_string(allowed_) +
                        " bytes; the limit (--max-dataset-bytes) is " + std::to_string(limits_.max_bytes) + ", and " +
                        std::to_string(limits_.max_ratio) + " times the size of the zip file",
                    where);
      if (auto written = write(file.get(), chunk_.data(), std::size_t(got), to); !written) return written;
    }
  }

  static Result<void> write(int fd, const char* bytes, std::size_t size, const fs::path& to) {
    while (size > 0) {
      const auto written = ::write(fd, bytes, size);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return tl::make_unexpected(engine::file_error(errno, "write", to.filename()));
      bytes += written, size -= std::size_t(written);
    }
    return {};
  }

  static Result<void> failed(zip_error_t* error, const std::string& where) {
    const int code = zip_error_code_zip(error);
    return fail(code_for(code),
                std::string("the entry cannot be unpacked, ") + reason_of(code) + ": make the zip file anew", where);
  }

  Archive archive_;
  std::string name_;
  fs::path into_;
  ZipLimits limits_;
  std::uint64_t allowed_ = 0, unpacked_ = 0;
  std::set<std::string> files_, folders_;
  std::vector<char> chunk_ = std::vector<char>(std::size_t{1} << 18);
};

}  // namespace

Result<void> unzip(const fs::path& zip, const std::string& name, const fs::path& into, const ZipLimits& limits) {
  const std::string shown = printable(name.empty() ? "upload.zip" : name);
  if (auto small = check_directory(zip, shown, limits); !small) return small;
  auto archive = open_archive(zip, shown);
  if (!archive) return propagate(archive);
  return Unzip(std::move(*archive), shown, into, limits, bytes_below(zip)).all();
}

}  // namespace server::scenes
