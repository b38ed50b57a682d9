#include "engine/jobs/durable_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

tl::unexpected<Error> failed(const std::string& what, const fs::path& where, int error_number) {
  const std::string reason = std::generic_category().message(error_number);
  if (means_no_space(error_number))
    return fail(ErrorCode::no_space, "cannot " + what + " (" + reason + "): free some space and try again", where);
  return fail(ErrorCode::unavailable, "cannot " + what + ": " + reason, where);
}

class File {
 public:
  File(const fs::path& path, int flags) : descriptor_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  ~File() { close(); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
  [[nodiscard]] bool write(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
      if (count < 0 && errno != EINTR) return false;
      if (count > 0) bytes.remove_prefix(std::size_t(count));
    }
    return true;
  }
  [[nodiscard]] bool sync() const { return ::fsync(descriptor_) == 0; }
  bool close() {
    const int descriptor = descriptor_;
    descriptor_ = -1;
    return descriptor < 0 || ::close(descriptor) == 0;
  }

 private:
  int descriptor_;
};

/// A new name in a folder is on disk only once the folder is.
bool sync_folder(const fs::path& folder) {
  const File opened(folder.empty() ? fs::path(".") : folder, O_RDONLY | O_DIRECTORY);
  return opened.is_open() && opened.sync();
}

}  // namespace

bool means_no_space(int error_number) {
  return error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG;
}

Result<void> create_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return {};
  if (folder.has_parent_path() && folder.parent_path() != folder)
    if (auto made = create_folder(folder.parent_path()); !made) return made;
  fs::create_directory(folder, error);
  if (error) return failed("make the folder", folder, error.value());
  if (!sync_folder(folder.parent_path())) return failed("make the folder", folder, errno);
  return {};
}

Result<void> write_durably(const fs::path& file, std::string_view bytes) {
  const fs::path temporary = file.string() + ".tmp";
  File out(temporary, O_WRONLY | O_CREAT | O_TRUNC);
  if (!out.is_open()) return failed("write the file", file, errno);
  if (!out.write(bytes) || !out.sync() || !out.close() || ::rename(temporary.c_str(), file.c_str()) != 0) {
    const int error_number = errno;
    ::unlink(temporary.c_str());
    return failed("write the file", file, error_number);
  }
  if (!sync_folder(file.parent_path())) return failed("write the file", file, errno);
  return {};
}

Result<std::string> read_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::not_found, "the file cannot be opened", file);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) return fail(ErrorCode::unavailable, "the file cannot be read to its end", file);
  return bytes;
}

}  // namespace engine::jobs
