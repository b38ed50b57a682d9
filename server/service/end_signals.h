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

  /// Waits for a signal and returns its name. Afterwards a second one ends the program at once: nothing but time is
  /// lost.
  [[nodiscard]] std::string wait();

 private:
  sigset_t signals_{}, before_{};
};

}  // namespace server::service
