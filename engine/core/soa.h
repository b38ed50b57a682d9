// Structures of arrays for whatever is counted in Gaussians.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/vec.h"

namespace engine {

/// N three-vectors, one array per component.
struct Array3 {
  std::vector<float> x, y, z;

  [[nodiscard]] std::size_t size() const { return x.size(); }
  void resize(std::size_t n) { x.resize(n), y.resize(n), z.resize(n); }
  void reserve(std::size_t n) { x.reserve(n), y.reserve(n), z.reserve(n); }
  void push_back(Vec3 v) { x.push_back(v.x), y.push_back(v.y), z.push_back(v.z); }
  [[nodiscard]] Vec3 get(std::size_t i) const { return {x[i], y[i], z[i]}; }
  void set(std::size_t i, Vec3 v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
  bool operator==(const Array3&) const = default;
};

/// All points one after the other, [N][3]: as a search for neighbours takes them.
[[nodiscard]] inline std::vector<float> interleaved(const Array3& points) {
  std::vector<float> out;
  out.reserve(3 * points.size());
  for (std::size_t i = 0; i < points.size(); ++i) out.insert(out.end(), {points.x[i], points.y[i], points.z[i]});
  return out;
}
/// The same of these rows, in the order given.
[[nodiscard]] inline std::vector<float> interleaved(const Array3& points, std::span<const std::uint32_t> rows) {
  std::vector<float> out;
  out.reserve(3 * rows.size());
  for (const std::uint32_t row : rows) out.insert(out.end(), {points.x[row], points.y[row], points.z[row]});
  return out;
}

/// N quaternions (w, x, y, z), one array per component; not necessarily of unit length.
struct Array4 {
  std::vector<float> w, x, y, z;

  [[nodiscard]] std::size_t size() const { return w.size(); }
  void resize(std::size_t n) { w.resize(n), x.resize(n), y.resize(n), z.resize(n); }
  void reserve(std::size_t n) { w.reserve(n), x.reserve(n), y.reserve(n), z.reserve(n); }
  void push_back(Quat q) { w.push_back(q.w), x.push_back(q.x), y.push_back(q.y), z.push_back(q.z); }
  [[nodiscard]] Quat get(std::size_t i) const { return {w[i], x[i], y[i], z[i]}; }
  void set(std::size_t i, Quat q) { w[i] = q.w, x[i] = q.x, y[i] = q.y, z[i] = q.z; }
  bool operator==(const Array4&) const = default;
};

}  // namespace engine
