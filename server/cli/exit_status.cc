#include "server/cli/exit_status.h"

#include <algorithm>
#include <array>

namespace server::cli {
namespace {

using engine::ErrorCode;

struct Status {
  ErrorCode code;
  int number;
  const char* meaning;
};

constexpr std::array statuses{
    Status{ErrorCode::internal, 1, "a bug in this program"},
    Status{ErrorCode::invalid_argument, 2, "wrong command line, settings or request"},
    Status{ErrorCode::not_found, 3, "no such file, view or request"},
    Status{ErrorCode::corrupt_data, 4, "a damaged file"},
    Status{ErrorCode::unsupported, 5, "a kind of file or request this build does not handle"},
    Status{ErrorCode::unprocessable, 6, "cannot be done on this scene (no Gaussians near a handle)"},
    Status{ErrorCode::too_large, 7, "a limit was exceeded"},
    Status{ErrorCode::no_space, 8, "the disk is full"},
    Status{ErrorCode::conflict, 9, "the result would replace its own input"},
    Status{ErrorCode::busy, 10, "busy"},
    Status{ErrorCode::cancelled, 11, "stopped before it was finished"},
    Status{ErrorCode::unavailable, 12, "a file or folder may not be read or written"},
    Status{ErrorCode::quota_exceeded, 13, "a quota is used up"}};

}  // namespace

int exit_status(ErrorCode code) {
  return std::find_if(statuses.begin(), statuses.end(), [&](const Status& s) { return s.code == code; })->number;
}

std::string error_line(const engine::Error& error) {
  std::string line = "error: " + error.message;
  if (!error.where.empty()) line += " (" + error.where + ")";
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return line;
}

std::string exit_status_help() {
  std::string text = "Exit status:\n   0  success\n";
  for (const Status& status : statuses) {
    const std::string number = std::to_string(status.number);
    text += std::string(4 - number.size(), ' ') + number + "  " + status.meaning + "\n";
  }
  return text;
}

}  // namespace server::cli
