// Small scenes and hand-made .ply files for the tests of this room.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Values as trained scenes have them; SH within [-1, 1].
inline scene::GaussianCloud random_cloud(std::size_t n, int degree, std::uint64_t seed) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(n);
  Rng rng(seed, 77);
  for (std::size_t i = 0; i < n; ++i) {
    cloud.mean.set(i, {rng.normal(), rng.normal(), rng.normal()});
    cloud.log_scale.set(i, {rng.uniform(-8, 1), rng.uniform(-8, 1), rng.uniform(-8, 1)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-4, 4);
  }
  for (float& value : cloud.sh) value = rng.uniform(-1, 1);
  return cloud;
}

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline std::span<const std::byte> as_span(const std::string& bytes) { return std::as_bytes(std::span(bytes)); }

/// A file in memory with a path, for tests that read thousands of variants of one.
class MemoryFile {
 public:
  MemoryFile() : fd_(::memfd_create("test", MFD_CLOEXEC)) {}
  ~MemoryFile() { ::close(fd_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  void set(const std::string& bytes) {
    if (::ftruncate(fd_, off_t(bytes.size())) != 0 ||
        ::pwrite(fd_, bytes.data(), bytes.size(), 0) != ssize_t(bytes.size()))
      throw std::runtime_error("cannot write to memory");
  }
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

/// The names of a trained scene's properties, in INRIA's order, without the normals.
inline std::vector<std::string> gaussian_names(int degree) {
  std::vector<std::string> names = {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (std::size_t k = 0; k < 3 * (scene::sh_coefficients(degree) - 1); ++k)
    names.push_back("f_rest_" + std::to_string(k));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.push_back(name);
  return names;
}

/// The header of a file with float properties.
inline std::string float_header(const std::vector<std::string>& names, const std::string& count) {
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + count + "\n";
  for (const auto& name : names) header += "property float " + name + "\n";
  return header + "end_header\n";
}

/// A file of `count` rows in which property p of row i is 0.01 * (p + 1) + i.
inline std::string simple_ply(int degree, std::size_t count) {
  const auto names = gaussian_names(degree);
  std::string bytes = float_header(names, std::to_string(count));
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t p = 0; p < names.size(); ++p) append(bytes, 0.01f * float(p + 1) + float(i));
  return bytes;
}

/// R S S R^T of one Gaussian, in double.
inline DMat3 covariance(const scene::GaussianCloud& cloud, std::size_t i) {
  const DMat3 r = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(i))));
  DMat3 rs = r;
  for (int c = 0; c < 3; ++c) rs[c] *= std::exp(double(cloud.log_scale.get(i)[c]));
  return rs * glm::transpose(rs);
}

/// How far the Gaussians of two clouds differ in shape, as a share of the first one's: whatever the signs of their
/// local axes, which no covariance shows.
inline double covariance_difference(const scene::GaussianCloud& a, const scene::GaussianCloud& b, std::size_t i) {
  const DMat3 p = covariance(a, i), q = covariance(b, i);
  double square = 0, whole = 0;
  for (int c = 0; c < 3; ++c) {
    square += glm::dot(p[c] - q[c], p[c] - q[c]);
    whole += glm::dot(p[c], p[c]);
  }
  return std::sqrt(square / whole);
}

/// The angle in radians between two rotations given as quaternions of any length.
inline double angle_between(Quat a, Quat b) {
  const DQuat p = glm::normalize(DQuat(a)), q = glm::normalize(DQuat(b));
  return 2 * std::acos(std::min(1.0, std::abs(glm::dot(p, q))));
}

}  // namespace engine::io
