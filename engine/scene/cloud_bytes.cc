#include "engine/scene/cloud_bytes.h"

#include <limits>
#include <span>

#include "engine/scene/cloud_arrays.h"

namespace engine::scene {
void write_cloud(ByteWriter& out, const GaussianCloud& cloud) {
  out.write(std::uint64_t(cloud.size()));
  out.write(std::int32_t(cloud.sh_degree));
  out.write(std::uint64_t(cloud.extra_stride));
  visit_arrays([&](std::size_t, const auto& array) { out.write_all(std::span(array)); }, cloud);
}

GaussianCloud read_cloud(ByteReader& in) {
  const auto rows = in.read<std::uint64_t>();
  const auto degree = in.read<std::int32_t>();
  const auto extra_stride = in.read<std::uint64_t>();
  GaussianCloud cloud;
  if (degree < 0 || degree > max_sh_degree || extra_stride > std::numeric_limits<std::uint32_t>::max()) in.fail();
  if (!in.ok()) return cloud;
  cloud.sh_degree = degree;
  const std::uint64_t row_bytes = sizeof(float) * (11 + cloud.sh_stride()) + extra_stride;
  if (!in.has(rows, row_bytes)) in.fail();
  if (!in.ok()) return {};
  cloud.extra_stride = std::size_t(extra_stride);
  cloud.resize(std::size_t(rows));
  visit_arrays([&](std::size_t, auto& array) { in.read_all(std::span(array)); }, cloud);
  return cloud;
}

}  // namespace engine::scene
