// The signals that end the service.
#pragma once

#include <signal.h>

#include <string>

namespace server::service {

/// Blocks SIGINT and SIGTERM, in this thread and those it starts from now on, until one is waited for: make it before
/// any thread is started.
class EndSignals {
 public:
  EndSignals();
  ~EndSignals();
  EndSignals(const EndSignals&) = delete;
  EndSignals& operator=(const EndSignals&) = delete;

  /// The name of the one that came. Afterwards a second signal ends the program at once: nothing is lost by it but
  /// time.
  [[nodiscard]] std::string wait();

 private:
  sigset_t signals_{}, before_{};
};

}  // namespace server::service
