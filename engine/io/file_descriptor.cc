#include "engine/io/file_descriptor.h"

#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace engine::io {
namespace {

ErrorCode code_for(int error_number) {
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return ErrorCode::no_space;
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

Error file_error(int error_number, const std::string& action, const std::filesystem::path& path) {
  return {code_for(error_number),
          "cannot " + action + " " + path.string() + ": " + std::generic_category().message(error_number),
          path.string()};
}

}  // namespace engine::io
