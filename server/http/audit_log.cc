#include "server/http/audit_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>

#include "server/http/log.h"

namespace server::http {
namespace {

/// Also to be read: whoever had it before may have left it with half a line.
engine::Result<engine::FileDescriptor> open_to_append(const std::filesystem::path& file) {
  constexpr mode_t for_its_group = 0640;  // those who audit need not be who serves
  // Of a pipe that nobody empties a line is lost, as on a full disk: it keeps nobody waiting.
  constexpr int how = O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
  engine::FileDescriptor opened(::open(file.c_str(), how, for_its_group));
  if (opened.get() < 0) return tl::make_unexpected(engine::file_error(errno, "open", file));
  return opened;
}

bool ends_within_line(const engine::FileDescriptor& file) {
  struct stat status {};
  char last = '\n';
  return ::fstat(file.get(), &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0 &&
         ::pread(file.get(), &last, 1, status.st_size - 1) == 1 && last != '\n';
}

}  // namespace

AuditLog::AuditLog(std::filesystem::path file, engine::FileDescriptor descriptor, spdlog::logger& logger)
    : file_(std::move(file)),
      logger_(logger),
      descriptor_(std::move(descriptor)),
      is_torn_(ends_within_line(descriptor_)) {}

engine::Result<std::unique_ptr<AuditLog>> AuditLog::open(const std::filesystem::path& file, spdlog::logger& logger) {
  auto opened = open_to_append(file);
  if (!opened) return engine::propagate(opened);
  return std::unique_ptr<AuditLog>(new AuditLog(file, std::move(*opened), logger));
}

int AuditLog::append(const std::string& line) {
  std::string_view rest = line;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor_.get(), rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      is_torn_ = is_torn_ || rest.size() < line.size();
      return errno;
    }
    rest.remove_prefix(std::size_t(written));
  }
  is_torn_ = false;
  return 0;
}

void AuditLog::write(const proto::AuditEntry& entry) {
  const std::string line = proto::to_json(entry);
  int error = 0;
  {
    const std::lock_guard lock(mutex_);
    std::string text = is_torn_ ? "\n" : "";
    if (is_behind_) text += proto::lost_lines_json(entry.time, lost_) + "\n";
    error = append(text + line + "\n");
    is_behind_ = error != 0;
    lost_ += error != 0 ? 1 : 0;
  }
  if (error != 0)
    log(logger_, spdlog::level::err, std::string("the audit log cannot be written: ") + std::strerror(error),
        {{"where", file_.string()}, {"audit", line}});
}

engine::Result<void> AuditLog::reopen() {
  auto opened = open_to_append(file_);
  if (!opened) return engine::propagate(opened);
  const std::lock_guard lock(mutex_);
  descriptor_ = std::move(*opened);
  is_torn_ = ends_within_line(descriptor_);
  return {};
}

std::uint64_t AuditLog::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

}  // namespace server::http
