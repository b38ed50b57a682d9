#include "engine/io/splat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "engine/core/parallel.h"
#include "engine/io/checks.h"
#include "engine/io/quantised.h"

namespace engine::io {
namespace {

constexpr std::size_t rows_per_task = 4096;  // of a parallel task: a choice

struct Record {
  std::array<float, 3> position;
  std::array<float, 3> sigma;
  std::array<std::uint8_t, 4> rgba;
  std::array<std::uint8_t, 4> rotation;  ///< w x y z, each q * 128 + 128
};
static_assert(sizeof(Record) == splat_record_bytes);

Record record_at(std::span<const std::byte> bytes, std::size_t i) {
  Record record;
  std::memcpy(&record, bytes.data() + i * splat_record_bytes, splat_record_bytes);
  return record;
}

float log_scale_of(float sigma) { return std::max(float(std::log(double(sigma))), -most_log_scale); }

Quat rotation_of(const std::array<std::uint8_t, 4>& bytes) {
  std::array<double, 4> q;
  double square = 0;
  for (std::size_t c = 0; c < 4; ++c) {
    q[c] = (int(bytes[c]) - 128) / 128.0;
    square += q[c] * q[c];
  }
  if (square == 0) return {1, 0, 0, 0};
  const double length = std::sqrt(square);
  return {float(q[0] / length), float(q[1] / length), float(q[2] / length), float(q[3] / length)};
}

std::array<std::uint8_t, 4> rotation_bytes_once(Quat rotation) {
  const std::array<double, 4> q = {rotation.w, rotation.x, rotation.y, rotation.z};
  double square = 0;
  for (const double c : q) square += c * c;
  if (square == 0) return {255, 128, 128, 128};  // the identity: 1 * 128 + 128, saturated
  std::array<std::uint8_t, 4> bytes;
  for (std::size_t c = 0; c < 4; ++c) bytes[c] = nearest_byte(q[c] / std::sqrt(square) * 128.0 + 128.0);
  return bytes;
}

std::array<std::uint8_t, 4> rotation_bytes(Quat rotation) {
  return stable_rotation(rotation, rotation_bytes_once, rotation_of);
}

bool believable(const Record& record) {
  // Wider than any scene in single precision; text and compressed data leave this range within a few records.
  constexpr float max_position = 1e7f, max_sigma = 1e6f;
  for (const float x : record.position)
    if (!(std::abs(x) <= max_position)) return false;
  for (const float sigma : record.sigma)
    if (!(sigma >= 0.0f && sigma <= max_sigma)) return false;
  // A unit quaternion in bytes has a length near 1; rounding and the clamp at 127/128 leave it well above a half.
  double square = 0;
  for (const std::uint8_t c : record.rotation) square += (int(c) - 128) / 128.0 * ((int(c) - 128) / 128.0);
  return square == 0 || (square > 0.25 && square < 2.0);
}

}  // namespace

bool looks_like_splat(std::span<const std::byte> bytes, std::uint64_t size) {
  if (size == 0 || size % splat_record_bytes != 0) return false;
  for (std::size_t i = 0; i < bytes.size() / splat_record_bytes; ++i)
    if (!believable(record_at(bytes, i))) return false;
  return true;
}

Result<scene::GaussianCloud> decode_splat(std::span<const std::byte> bytes, const std::string& file,
                                          const ReadOptions& options) {
  if (bytes.size() % splat_record_bytes != 0)
    return fail(ErrorCode::corrupt_data,
                "a .splat file has 32 bytes per Gaussian; " + std::to_string(bytes.size()) +
                    " bytes are no multiple of that: it is incomplete, copy or download it again",
                file);
  const std::size_t count = bytes.size() / splat_record_bytes;
  if (auto checked = check_limits(count, cloud_row_bytes(0), options, file); !checked) return propagate(checked);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (const float sigma = record_at(bytes, i).sigma[axis]; !(sigma >= 0.0f))
        return fail(ErrorCode::corrupt_data, "a sigma is negative or no number; the file is damaged",
                    file + ":vertex[" + std::to_string(i) + "].scale_" + std::to_string(axis));
  scene::GaussianCloud cloud;
  cloud.resize(count);
  parallel_for(count, rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Record record = record_at(bytes, i);
      cloud.mean.set(i, {record.position[0], record.position[1], record.position[2]});
      cloud.log_scale.set(
          i, {log_scale_of(record.sigma[0]), log_scale_of(record.sigma[1]), log_scale_of(record.sigma[2])});
      cloud.rotation.set(i, rotation_of(record.rotation));
      cloud.opacity_logit[i] = logit_of_byte(record.rgba[3]);
      for (std::size_t c = 0; c < 3; ++c) cloud.sh_row(i)[c] = float((record.rgba[c] / 255.0 - 0.5) / sh_c0);
    }
  });
  if (auto finite = check_finite(cloud, file); !finite) return propagate(finite);
  return cloud;
}

std::vector<std::byte> encode_splat(const scene::GaussianCloud& cloud) {
  std::vector<std::byte> bytes(cloud.size() * splat_record_bytes);
  parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Record record;
      for (int axis = 0; axis < 3; ++axis) {
        record.position[std::size_t(axis)] = cloud.mean.get(i)[axis];
        // Saturated where the renderer saturates, so that no sigma is infinite.
        record.sigma[std::size_t(axis)] =
            float(std::exp(double(std::clamp(cloud.log_scale.get(i)[axis], -most_log_scale, most_log_scale))));
      }
      for (std::size_t c = 0; c < 3; ++c)
        record.rgba[c] =
            nearest_byte(255.0 * (0.5 + sh_c0 * cloud.sh_row(i)[c * scene::sh_coefficients(cloud.sh_degree)]));
      record.rgba[3] = byte_of_logit(cloud.opacity_logit[i]);
      record.rotation = rotation_bytes(cloud.rotation.get(i));
      std::memcpy(bytes.data() + i * splat_record_bytes, &record, splat_record_bytes);
    }
  });
  return bytes;
}

}  // namespace engine::io
