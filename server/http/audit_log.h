// The audit log: who changed what, and whom a token did not let in. One JSON line for each request, in a file that is
// only ever appended to.
//
// A line is written before the answer is sent: who has an answer stands in the log, though not yet on disk (the
// operating system writes it there; a power cut may take the last seconds). Where a line cannot be written, the
// request goes on all the same: a full disk must not end a service that does not need it. The line is then in
// the service's own log, and counted; once there is room again, the file says how many it lacks by then.
#pragma once

#include <spdlog/logger.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"
#include "proto/audit_entry.h"

namespace server::http {

/// Safe to call from any thread.
class AuditLog {
 public:
  /// Opens the file, or makes it.
  ///   logger  is told of lines that cannot be written; outlives this
  ///   errors  those of engine::file_error(): it cannot be opened
  [[nodiscard]] static engine::Result<std::unique_ptr<AuditLog>> open(const std::filesystem::path& file,
                                                                      spdlog::logger& logger);

  void write(const proto::AuditEntry& entry);
  /// Goes on in the file that has the name now: another one has taken its place. Where that cannot be opened, the one
  /// before stays.
  ///   errors  those of open()
  [[nodiscard]] engine::Result<void> reopen();
  /// Lines that could not be written so far.
  [[nodiscard]] std::uint64_t lost() const;

 private:
  AuditLog(std::filesystem::path file, engine::FileDescriptor descriptor, spdlog::logger& logger);
  ///   returns  the system's error; 0: it is written
  [[nodiscard]] int append(const std::string& line);

  const std::filesystem::path file_;
  spdlog::logger& logger_;
  /// Held while a line is written, against the rule that no lock is held over I/O: where only a part of it finds room,
  /// the next one has to begin a line of its own.
  mutable std::mutex mutex_;
  engine::FileDescriptor descriptor_;
  bool is_torn_;            ///< The file ends within a line.
  bool is_behind_ = false;  ///< The last line could not be written, and the file does not say so.
  std::uint64_t lost_ = 0;
};

}  // namespace server::http
