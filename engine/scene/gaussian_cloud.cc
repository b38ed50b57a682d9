#include "engine/scene/gaussian_cloud.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "engine/core/finite.h"
#include "engine/core/rows.h"

namespace engine::scene {

void GaussianCloud::resize(std::size_t n) {
  mean.resize(n);
  log_scale.resize(n);
  rotation.resize(n);
  opacity_logit.resize(n);
  sh.resize(n * sh_stride());
  extra.resize(n * extra_stride);
}

namespace {

/// The per-component float arrays of a cloud with their .ply names; SH is apart, its layout differs.
template <class Cloud, class Visit>
void visit_columns(Cloud& cloud, Visit&& visit) {
  visit(cloud.mean.x, "x");
  visit(cloud.mean.y, "y");
  visit(cloud.mean.z, "z");
  visit(cloud.log_scale.x, "scale_0");
  visit(cloud.log_scale.y, "scale_1");
  visit(cloud.log_scale.z, "scale_2");
  visit(cloud.rotation.w, "rot_0");
  visit(cloud.rotation.x, "rot_1");
  visit(cloud.rotation.y, "rot_2");
  visit(cloud.rotation.z, "rot_3");
  visit(cloud.opacity_logit, "opacity");
}

template <class T>
void append_blocks(std::vector<T>& to, const std::vector<T>& from, std::size_t stride,
                   std::span<const std::uint32_t> rows) {
  const std::size_t old_size = to.size();
  to.resize(old_size + rows.size() * stride);  // first, so that `from` may be `to`: indices stay good, pointers do not
  for (std::size_t k = 0; k < rows.size(); ++k)
    std::copy_n(from.begin() + std::ptrdiff_t(rows[k] * stride), stride,
                to.begin() + std::ptrdiff_t(old_size + k * stride));
}

}  // namespace

void append_rows(GaussianCloud& to, const GaussianCloud& from, std::span<const std::uint32_t> rows) {
  assert(to.sh_degree == from.sh_degree && to.extra_stride == from.extra_stride);
  std::vector<const std::vector<float>*> sources;
  visit_columns(from, [&](const std::vector<float>& column, const char*) { sources.push_back(&column); });
  std::size_t next = 0;
  visit_columns(to, [&](std::vector<float>& column, const char*) { append_blocks(column, *sources[next++], 1, rows); });
  append_blocks(to.sh, from.sh, to.sh_stride(), rows);
  append_blocks(to.extra, from.extra, to.extra_stride, rows);
}

GaussianCloud gather(const GaussianCloud& cloud, std::span<const std::uint32_t> rows) {
  GaussianCloud gathered;
  gathered.sh_degree = cloud.sh_degree;
  gathered.extra_stride = cloud.extra_stride;
  append_rows(gathered, cloud, rows);
  return gathered;
}

GaussianCloud select(const GaussianCloud& cloud, std::span<const std::uint8_t> keep) {
  assert(keep.size() == cloud.size());
  return gather(cloud, marked_rows(keep));
}

void drop_empty_sh_bands(GaussianCloud& cloud) {
  const std::size_t old_count = sh_coefficients(cloud.sh_degree);
  std::size_t used = 1;  // the DC term always stays
  for (std::size_t i = 0; i < cloud.sh.size(); ++i)
    if (std::bit_cast<std::uint32_t>(cloud.sh[i]) != 0) used = std::max(used, i % old_count + 1);
  int degree = 0;
  while (sh_coefficients(degree) < used) ++degree;
  if (degree == cloud.sh_degree) return;
  const std::size_t new_count = sh_coefficients(degree);
  for (std::size_t channel = 0; channel < 3 * cloud.size(); ++channel)  // moves towards the front: safe in place
    std::copy_n(cloud.sh.begin() + std::ptrdiff_t(channel * old_count), new_count,
                cloud.sh.begin() + std::ptrdiff_t(channel * new_count));
  cloud.sh_degree = degree;
  cloud.sh.resize(cloud.size() * cloud.sh_stride());
  cloud.sh.shrink_to_fit();
}

std::optional<std::string> first_not_finite(const GaussianCloud& cloud) {
  std::optional<std::string> found;
  auto report = [&](std::size_t row, const std::string& name) { found = "[" + std::to_string(row) + "]." + name; };
  visit_columns(cloud, [&](const std::vector<float>& column, const char* name) {
    if (found) return;
    if (const auto row = engine::first_not_finite(column)) report(*row, name);
  });
  if (found) return found;
  if (const auto bad = engine::first_not_finite(cloud.sh)) {
    const std::size_t count = sh_coefficients(cloud.sh_degree);
    const std::size_t row = *bad / cloud.sh_stride();
    const std::size_t channel = *bad % cloud.sh_stride() / count;
    const std::size_t k = *bad % count;
    report(row, k == 0 ? "f_dc_" + std::to_string(channel) : "f_rest_" + std::to_string(channel * (count - 1) + k - 1));
  }
  return found;
}

Bounds bounds(const GaussianCloud& cloud) {
  if (cloud.size() == 0) return {};
  Bounds box{cloud.mean.get(0), cloud.mean.get(0)};
  for (std::size_t i = 1; i < cloud.size(); ++i) {
    box.low = glm::min(box.low, cloud.mean.get(i));
    box.high = glm::max(box.high, cloud.mean.get(i));
  }
  return box;
}

}  // namespace engine::scene
