#include "proto/error_code.h"

namespace proto {

std::string_view name_of(engine::ErrorCode code) {
  using engine::ErrorCode;
  switch (code) {
    case ErrorCode::invalid_argument:
      return "invalid_argument";
    case ErrorCode::unprocessable:
      return "unprocessable";
    case ErrorCode::not_found:
      return "not_found";
    case ErrorCode::conflict:
      return "conflict";
    case ErrorCode::corrupt_data:
      return "corrupt_data";
    case ErrorCode::unsupported:
      return "unsupported";
    case ErrorCode::too_large:
      return "too_large";
    case ErrorCode::no_space:
      return "no_space";
    case ErrorCode::busy:
      return "busy";
    case ErrorCode::cancelled:
      return "cancelled";
    case ErrorCode::unavailable:
      return "unavailable";
    case ErrorCode::quota_exceeded:
      return "quota_exceeded";
    case ErrorCode::internal:
      break;
  }
  return "internal";
}

}  // namespace proto
