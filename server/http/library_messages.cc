#include "server/http/library_messages.h"

#include <sys/types.h>

#include <algorithm>

#include "server/http/log.h"

namespace server::http {
namespace {

constexpr std::size_t max_line_bytes = 1000;  // of one entry; a choice: libraries say less

}  // namespace

LibraryMessages::LibraryMessages(spdlog::logger& logger) : logger_(logger) {
#ifdef __GLIBC__
  const auto write = [](void* self, const char* text, std::size_t size) -> ssize_t {
    static_cast<LibraryMessages*>(self)->take({text, size});
    return ssize_t(size);
  };
  stream_ = ::fopencookie(this, "w", cookie_io_functions_t{nullptr, write, nullptr, nullptr});
  if (stream_ == nullptr) return;
  (void)std::setvbuf(stream_, nullptr, _IOLBF, BUFSIZ);
  before_ = stderr;
  stderr = stream_;
#endif
}

LibraryMessages::~LibraryMessages() {
  if (stream_ == nullptr) return;
#ifdef __GLIBC__
  stderr = before_;
#endif
  (void)std::fclose(stream_);
  if (!line_.empty()) log_line(line_);
}

void LibraryMessages::take(std::string_view text) {
  const std::lock_guard lock(mutex_);
  if (logging_) return;  // the logger itself complains, of what we are just handing to it
  logging_ = true;
  line_ += text;
  for (std::size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n')) {
    log_line(std::string_view(line_).substr(0, end));
    line_.erase(0, end + 1);
  }
  if (line_.size() > max_line_bytes) {
    log_line(line_);
    line_.clear();
  }
  logging_ = false;
}

void LibraryMessages::log_line(std::string_view line) {
  if (line.empty()) return;
  log(logger_, spdlog::level::warn, "a library complains",
      {{"said", std::string(line.substr(0, std::min(line.size(), max_line_bytes)))}});
}

}  // namespace server::http
