// The one Result and the one Error of the whole project.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace engine {

/// What went wrong, in terms a caller can act on. Each code has exactly one HTTP status and one exit status.
enum class ErrorCode {
  invalid_argument,  ///< The request is malformed: a field missing, of the wrong type or out of range.
  unprocessable,     ///< Well-formed, but cannot be done on this scene (no Gaussians near a handle).
  not_found,
  conflict,
  corrupt_data,  ///< A file that contradicts itself or ends too early.
  unsupported,   ///< A valid file or request of a kind we do not handle.
  too_large,     ///< A limit was exceeded; the message names it.
  no_space,
  busy,
  cancelled,
  unavailable,
  internal,
  quota_exceeded  ///< Whoever asks has used up what they may. Last: the numbers of the others are in files.
};

/// People read `message`, programs read `code` and `where`.
struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string message;  ///< One sentence for a person: what was expected, what was found, what to do.
  std::string where;    ///< Address of the culprit: "chair.ply:vertex[1204].opacity", "handles[2].radius".
};

template <class T>
using Result = tl::expected<T, Error>;  // std::expected once the compiler has it

/// Return this from a function that returns a Result.
inline tl::unexpected<Error> fail(ErrorCode code, std::string message, std::string where = {}) {
  return tl::make_unexpected(Error{code, std::move(message), std::move(where)});
}

/// Carries an error up unchanged: `if (!r) return propagate(r);`
template <class T>
tl::unexpected<Error> propagate(const Result<T>& failed) {
  return tl::make_unexpected(failed.error());
}

}  // namespace engine
