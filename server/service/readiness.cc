#include "server/service/readiness.h"

#include <system_error>

namespace server::service {

using engine::Error;
using engine::ErrorCode;

std::optional<Error> Readiness::trouble() const {
  if (is_ending_) return Error{ErrorCode::unavailable, "it is being stopped", ""};
  if (auto trouble = others_()) return trouble;
  std::error_code error;
  const auto room = std::filesystem::space(data_dir_, error);
  if (error) return Error{ErrorCode::unavailable, "its data folder cannot be looked at: " + error.message(), ""};
  if (room.available < min_free_bytes_)
    return Error{ErrorCode::no_space,
                 "the disk is full: " + std::to_string(room.available >> 10) + " KiB are free, it needs " +
                     std::to_string(min_free_bytes_ >> 10),
                 ""};
  return std::nullopt;
}

}  // namespace server::service
