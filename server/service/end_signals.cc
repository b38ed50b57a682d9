#include "server/service/end_signals.h"

namespace server::service {

EndSignals::EndSignals(bool hangup) {
  sigemptyset(&signals_);
  for (const int number : {SIGINT, SIGTERM}) sigaddset(&signals_, number);
  if (hangup) sigaddset(&signals_, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals_, &before_);
}

EndSignals::~EndSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

std::string EndSignals::wait() {
  int number = 0;
  while (sigwait(&signals_, &number) != 0) continue;
  if (number == SIGHUP) return "SIGHUP";
  pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
  return number == SIGINT ? "SIGINT" : "SIGTERM";
}

}  // namespace server::service
