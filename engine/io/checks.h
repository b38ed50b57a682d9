// Checks that every scene format shares.
#pragma once

#include <cstdint>
#include <new>
#include <stdexcept>
#include <string>

#include "engine/core/result.h"
#include "engine/io/read_options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Bytes per Gaussian of a cloud of the given degree, without `extra`.
[[nodiscard]] constexpr std::uint64_t cloud_row_bytes(int sh_degree) {
  return sizeof(float) * (11 + 3 * scene::sh_coefficients(sh_degree));
}

/// May a scene of `count` Gaussians, each of which needs `row_bytes` in memory, be loaded? Asked before allocating.
///   errors  unprocessable: no Gaussians; too_large: names the limit. `where` is "<file>:header".
[[nodiscard]] Result<void> check_limits(std::uint64_t count, std::uint64_t row_bytes, const ReadOptions& options,
                                        const std::string& file);

/// errors  corrupt_data: a NaN or infinity; `where` is "<file>:vertex[1204].opacity"
[[nodiscard]] Result<void> check_finite(const scene::GaussianCloud& cloud, const std::string& file);

/// Before a file is written: at least one Gaussian, arrays of one length, all numbers finite.
///   errors  unprocessable, internal: a poisoned or inconsistent cloud never reaches a disk
[[nodiscard]] Result<void> check_writable(const scene::GaussianCloud& cloud, const std::string& file);

/// read(), with a failed allocation turned into too_large.
template <class Read>
auto within_memory(const std::string& file, Read&& read) -> decltype(read()) {
  const auto too_large = [&] {
    return fail(ErrorCode::too_large, file + " does not fit into the memory of this machine", file);
  };
  try {
    return read();
  } catch (const std::bad_alloc&) {
    return too_large();
  } catch (const std::length_error&) {
    return too_large();
  }
}

}  // namespace engine::io
