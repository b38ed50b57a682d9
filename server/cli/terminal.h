// The streams on which the program talks to its user.
#pragma once

#include <ostream>

namespace server::cli {

/// Streams that outlive it.
struct Terminal {
  std::ostream& out;             ///< Results.
  std::ostream& err;             ///< Progress, warnings, errors.
  bool err_is_terminal = false;  ///< True: progress is a bar that redraws itself.
};

}  // namespace server::cli
