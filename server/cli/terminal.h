// Where the program talks to its user.
#pragma once

#include <ostream>

namespace server::cli {

struct Terminal {
  std::ostream& out;             ///< Results.
  std::ostream& err;             ///< Progress, warnings, errors.
  bool err_is_terminal = false;  ///< Then progress is a bar that redraws itself.
};

}  // namespace server::cli
