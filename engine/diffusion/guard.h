// What libtorch throws, as errors.
#pragma once

#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "engine/core/result.h"

namespace engine::diffusion {

/// Thrown where a computation is to end that libtorch is in the middle of: guarded() makes an error of it again.
class Ended final : public std::exception {
 public:
  explicit Ended(Error error) : error_(std::move(error)) {}
  [[nodiscard]] const char* what() const noexcept override { return error_.message.c_str(); }
  [[nodiscard]] const Error& error() const { return error_; }

 private:
  Error error_;
};

/// work(), which returns a Result, with whatever libtorch throws turned into an error. Each function of this room that
/// others call and that returns a Result goes through it where it computes with tensors.
///   where  of the error
///   errors that of Ended; too_large: there was no memory for a tensor; internal: anything else, which is a mistake in
///          this room
template <class Work>
auto guarded(const std::string& where, Work&& work) -> decltype(work()) {
  try {
    return work();
  } catch (const Ended& ended) {
    return tl::make_unexpected(ended.error());
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "it does not fit into the memory of this machine", where);
  } catch (const std::exception& failure) {
    const std::string_view what = failure.what();
    // Its allocators have no type of exception of their own.
    if (what.find("can't allocate memory") != std::string_view::npos ||
        what.find("out of memory") != std::string_view::npos)
      return fail(ErrorCode::too_large, "it does not fit into the memory of this machine", where);
    return fail(ErrorCode::internal, "libtorch: " + std::string(what.substr(0, what.find('\n'))), where);
  }
}

}  // namespace engine::diffusion
