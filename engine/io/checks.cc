#include "engine/io/checks.h"

#include <algorithm>
#include <limits>

namespace engine::io {

Result<void> check_limits(std::uint64_t count, std::uint64_t row_bytes, const ReadOptions& options,
                          const std::string& file) {
  const std::string where = file + ":header";
  if (count == 0)
    return fail(ErrorCode::unprocessable, file + " holds no Gaussians: there is nothing to show or edit", where);
  // The engine counts rows in 32 bits, whatever the option says.
  const auto most = std::min<std::uint64_t>(options.max_gaussians, std::numeric_limits<std::uint32_t>::max());
  if (count > most)
    return fail(
        ErrorCode::too_large,
        file + " holds " + std::to_string(count) + " Gaussians; the limit (max_gaussians) is " + std::to_string(most),
        where);
  if (count > options.max_memory_bytes / row_bytes)
    return fail(ErrorCode::too_large,
                file + " needs " + std::to_string(count) + " times " + std::to_string(row_bytes) +
                    " bytes of memory; the limit (max_memory_bytes) is " + std::to_string(options.max_memory_bytes),
                where);
  return {};
}

Result<void> check_finite(const scene::GaussianCloud& cloud, const std::string& file) {
  if (const auto bad = scene::first_not_finite(cloud))
    return fail(ErrorCode::corrupt_data,
                "a value is NaN or infinite: the scene did not train properly or the file is damaged; remove that "
                "Gaussian or export the scene again",
                file + ":vertex" + *bad);
  return {};
}

Result<void> check_writable(const scene::GaussianCloud& cloud, const std::string& file) {
  const std::size_t n = cloud.size();
  if (n == 0) return fail(ErrorCode::unprocessable, "the scene holds no Gaussians: nothing to write", file);
  const bool one_length = cloud.mean.x.size() == n && cloud.mean.y.size() == n && cloud.mean.z.size() == n &&
                          cloud.log_scale.x.size() == n && cloud.log_scale.y.size() == n &&
                          cloud.log_scale.z.size() == n && cloud.rotation.w.size() == n &&
                          cloud.rotation.x.size() == n && cloud.rotation.y.size() == n &&
                          cloud.rotation.z.size() == n && cloud.sh.size() == n * cloud.sh_stride() &&
                          cloud.extra.size() == n * cloud.extra_stride;
  if (!one_length) return fail(ErrorCode::internal, "the arrays of the scene differ in length", file);
  if (const auto bad = scene::first_not_finite(cloud))
    return fail(ErrorCode::internal, "the scene was not written: a value is NaN or infinite", file + ":vertex" + *bad);
  return {};
}

}  // namespace engine::io
