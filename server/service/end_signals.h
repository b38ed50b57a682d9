// The signals that end the service, and the one that has it read its token again.
#pragma once

#include <signal.h>

#include <string>

namespace server::service {

/// Blocks SIGINT and SIGTERM, and SIGHUP if it is asked for, in this thread and those it starts from now on, until one
/// is waited for: make it before any thread is started.
class EndSignals {
 public:
  /// hangup  whether SIGHUP is waited for, too; else it is left as it was
  explicit EndSignals(bool hangup = false);
  ~EndSignals();
  EndSignals(const EndSignals&) = delete;
  EndSignals& operator=(const EndSignals&) = delete;

  /// Waits for a signal and returns its name: "SIGINT", "SIGTERM", "SIGHUP". After one of the first two a second one
  /// ends the program at once: nothing but time is lost.
  [[nodiscard]] std::string wait();

 private:
  sigset_t signals_{}, before_{};
};

}  // namespace server::service
