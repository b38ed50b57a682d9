// What libraries print, as entries of the log.
#pragma once

#include <spdlog/logger.h>

#include <cstddef>
#include <cstdio>
#include <mutex>
#include <string>
#include <string_view>

namespace server::http {

/// While this object lives, each line that somebody prints to C's `stderr`, as libpng does of a damaged picture, is an
/// entry of the log (level warn, its text in `said`): a bare line among them is none that a reader of the log can take
/// apart. std::cerr, and with it the log itself, still writes where it did; so do those that write to descriptor 2, as
/// a sanitizer or the C library in its last moments.
/// To be made before threads are, and to outlive them; one at a time. Does nothing where `stderr` cannot be set (it can
/// with the GNU C library).
class LibraryMessages {
 public:
  /// logger  outlives the object; does not write by C's `stderr`
  explicit LibraryMessages(spdlog::logger& logger);
  ~LibraryMessages();
  LibraryMessages(const LibraryMessages&) = delete;
  LibraryMessages& operator=(const LibraryMessages&) = delete;

 private:
  void take(std::string_view text);
  void log_line(std::string_view line);

  spdlog::logger& logger_;
  std::FILE* before_ = nullptr;  ///< What `stderr` was.
  std::FILE* stream_ = nullptr;  ///< What it is.
  /// Recursive: the logger may complain to `stderr`, too. (The lock of `stream_` would do; ThreadSanitizer sees none of
  /// the C library's.)
  std::recursive_mutex mutex_;
  std::string line_;      ///< Begun and not ended. Guarded by `mutex_`, like the next.
  bool logging_ = false;  ///< Somewhere below, this thread hands a line to the logger.
};

}  // namespace server::http
