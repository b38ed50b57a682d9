#include "engine/core/file_descriptor.h"

#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace engine {
namespace {

ErrorCode code_for(int error_number) {
  if (means_no_space(error_number)) return ErrorCode::no_space;
  switch (error_number) {
    case ENOENT:
    case ENOTDIR:
      return ErrorCode::not_found;
    case EISDIR:
    case ENAMETOOLONG:
    case ELOOP:
      return ErrorCode::invalid_argument;
    case EACCES:
    case EPERM:
    case EROFS:
      return ErrorCode::unavailable;
    default:
      return ErrorCode::internal;
  }
}

}  // namespace

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) ::close(fd_);
}

bool means_no_space(int error_number) {
  return error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG;
}

Error file_error(int error_number, const std::string& action, const std::filesystem::path& path) {
  return {code_for(error_number),
          "cannot " + action + " " + path.string() + ": " + std::generic_category().message(error_number),
          path.string()};
}

}  // namespace engine
