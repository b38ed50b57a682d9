#include "engine/io/compressed_ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"
#include "engine/io/checks.h"
#include "engine/io/quantised.h"

namespace engine::io {
namespace {

constexpr std::size_t chunk_rows = 256;
constexpr std::size_t rows_per_task = 16 * chunk_rows;  // of a parallel task: a choice

constexpr std::array range_names = {
    "min_x",       "min_y",       "min_z",       "max_x", "max_y", "max_z", "min_scale_x", "min_scale_y", "min_scale_z",
    "max_scale_x", "max_scale_y", "max_scale_z", "min_r", "min_g", "min_b", "max_r",       "max_g",       "max_b"};
constexpr std::size_t first_colour_range = 12;
constexpr std::array word_names = {"packed_position", "packed_rotation", "packed_scale", "packed_color"};

/// What the packed values of a chunk lie between.
struct Range {
  Vec3 low_position{0}, high_position{0};
  Vec3 low_log_scale{0}, high_log_scale{0};
  Vec3 low_colour{0}, high_colour{1};  ///< As displayed, 0.5 + sh_c0 * f_dc.
};

Result<std::size_t> offset_of(const PlyElement& element, std::string_view name, PlyType type,
                              const std::string& where) {
  const PlyProperty* property = element.find(name);
  if (!property || property->type != type)
    return fail(ErrorCode::corrupt_data,
                "a compressed .ply file needs property '" + std::string(name) + "' in element '" + element.name +
                    "', of type " +
                    (type == PlyType::float32  ? "float"
                     : type == PlyType::uint32 ? "uint"
                                               : "uchar"),
                where);
  return property->offset;
}

double unorm(std::uint32_t word, int shift, int bits) {
  const std::uint32_t mask = (1u << bits) - 1u;
  return double(word >> shift & mask) / double(mask);
}

Vec3 lerp(Vec3 low, Vec3 high, double x, double y, double z) {
  const auto at = [&](int c, double t) { return float(double(low[c]) + t * (double(high[c]) - double(low[c]))); };
  return {at(0, x), at(1, y), at(2, z)};
}

/// 11 bits x, 10 bits y, 11 bits z.
Vec3 unpack_11_10_11(std::uint32_t word, Vec3 low, Vec3 high) {
  return lerp(low, high, unorm(word, 21, 11), unorm(word, 11, 10), unorm(word, 0, 11));
}

/// 2 bits that name the largest of (w, x, y, z), then the other three in order.
Quat unpack_rotation(std::uint32_t word) {
  const std::size_t largest = word >> 30;
  std::array<double, 4> q{};
  double square = 0;
  int shift = 20;
  for (std::size_t c = 0; c < 4; ++c) {
    if (c == largest) continue;
    q[c] = (unorm(word, shift, 10) - 0.5) * std::numbers::sqrt2;
    square += q[c] * q[c];
    shift -= 10;
  }
  q[largest] = std::sqrt(std::max(0.0, 1.0 - square));
  return {float(q[0]), float(q[1]), float(q[2]), float(q[3])};
}

/// The middle of the bin that the writer, which truncates, put the value in; the ends are what it saturated to.
float unpack_sh(std::uint8_t u) {
  if (u == 0) return float(compressed_ply_sh.low);
  if (u == 255) return float(compressed_ply_sh.high);
  return float(((u + 0.5) / compressed_ply_sh_bins - 0.5) * (2 * compressed_ply_most_sh));
}

class CompressedPly {
 public:
  CompressedPly(const InputFile& file, const PlyHeader& header) : file_(file), header_(header) {}

  Result<scene::GaussianCloud> read(const ReadOptions& options) {
    if (auto found = find_columns(); !found) return propagate(found);
    // The packed words are in memory beside the cloud.
    const std::uint64_t row_bytes = cloud_row_bytes(sh_degree_) + vertex_->stride + (sh_ ? sh_->stride : 0);
    if (auto checked = check_limits(vertex_->count, row_bytes, options, file_.name()); !checked)
      return propagate(checked);
    const auto offsets = element_offsets(header_, file_);
    if (!offsets) return propagate(offsets);
    if (auto counted = check_counts(); !counted) return propagate(counted);
    auto ranges = read_ranges(*offsets);
    if (!ranges) return propagate(ranges);
    const auto words = bytes_of(*vertex_, *offsets);
    if (!words) return propagate(words);
    scene::GaussianCloud cloud;
    cloud.sh_degree = sh_degree_;
    cloud.resize(vertex_->count);
    parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        decode(words->data() + i * vertex_->stride, (*ranges)[i / chunk_rows], i, cloud);
    });
    if (sh_) {
      const auto sh = bytes_of(*sh_, *offsets);
      if (!sh) return propagate(sh);
      decode_sh(*sh, cloud);
    }
    if (auto finite = check_finite(cloud, file_.name()); !finite) return propagate(finite);
    return cloud;
  }

 private:
  [[nodiscard]] std::string where() const { return file_.name() + ":header"; }

  Result<void> find_columns() {
    chunk_ = header_.find("chunk"), vertex_ = header_.find("vertex"), sh_ = header_.find("sh");
    has_colour_ranges_ = chunk_->find(range_names[first_colour_range]) != nullptr;
    for (std::size_t k = 0; k < (has_colour_ranges_ ? range_names.size() : first_colour_range); ++k) {
      const auto offset = offset_of(*chunk_, range_names[k], PlyType::float32, where());
      if (!offset) return propagate(offset);
      range_offsets_.push_back(*offset);
    }
    for (std::size_t k = 0; k < word_names.size(); ++k) {
      const auto offset = offset_of(*vertex_, word_names[k], PlyType::uint32, where());
      if (!offset) return propagate(offset);
      word_offsets_[k] = *offset;
    }
    if (!sh_) return {};
    for (sh_degree_ = 1; sh_degree_ <= scene::max_sh_degree; ++sh_degree_)
      if (sh_->properties.size() == 3 * (scene::sh_coefficients(sh_degree_) - 1)) break;
    if (sh_degree_ > scene::max_sh_degree)
      return fail(ErrorCode::corrupt_data,
                  "element 'sh' has " + std::to_string(sh_->properties.size()) +
                      " properties; SH degree 1, 2 or 3 has 9, 24 or 45",
                  where());
    for (std::size_t k = 0; k < sh_->properties.size(); ++k) {
      const auto offset = offset_of(*sh_, "f_rest_" + std::to_string(k), PlyType::uint8, where());
      if (!offset) return propagate(offset);
      sh_offsets_.push_back(*offset);
    }
    return {};
  }

  Result<void> check_counts() const {
    const std::uint64_t chunks = (vertex_->count + chunk_rows - 1) / chunk_rows;
    if (chunk_->count != chunks)
      return fail(ErrorCode::corrupt_data,
                  std::to_string(vertex_->count) + " Gaussians take " + std::to_string(chunks) +
                      " chunks of 256; found " + std::to_string(chunk_->count),
                  where());
    if (sh_ && sh_->count != vertex_->count)
      return fail(ErrorCode::corrupt_data,
                  std::to_string(vertex_->count) + " Gaussians, but " + std::to_string(sh_->count) + " rows of SH",
                  where());
    return {};
  }

  Result<std::vector<std::byte>> bytes_of(const PlyElement& element, const std::vector<std::uint64_t>& offsets) const {
    const std::size_t k = std::size_t(&element - header_.elements.data());
    return file_.read_at(offsets[k], offsets[k + 1] - offsets[k]);
  }

  Result<std::vector<Range>> read_ranges(const std::vector<std::uint64_t>& offsets) const {
    const auto bytes = bytes_of(*chunk_, offsets);
    if (!bytes) return propagate(bytes);
    std::vector<Range> ranges(chunk_->count);
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      std::array<float, range_names.size()> v{};
      std::fill(v.begin() + 15, v.end(), 1.0f);  // colours from 0 to 1 where the file gives no range
      for (std::size_t k = 0; k < range_offsets_.size(); ++k)
        std::memcpy(&v[k], bytes->data() + i * chunk_->stride + range_offsets_[k], sizeof(float));
      if (const auto bad = engine::first_not_finite(v))
        return fail(ErrorCode::corrupt_data, "a range is NaN or infinite: the file is damaged",
                    file_.name() + ":chunk[" + std::to_string(i) + "]." + range_names[*bad]);
      ranges[i] = {{v[0], v[1], v[2]},   {v[3], v[4], v[5]},    {v[6], v[7], v[8]},
                   {v[9], v[10], v[11]}, {v[12], v[13], v[14]}, {v[15], v[16], v[17]}};
    }
    return ranges;
  }

  void decode(const std::byte* row, const Range& range, std::size_t i, scene::GaussianCloud& cloud) const {
    std::array<std::uint32_t, 4> word;
    for (std::size_t k = 0; k < word.size(); ++k) std::memcpy(&word[k], row + word_offsets_[k], sizeof word[k]);
    const auto [position, rotation, scale, colour] = word;
    cloud.mean.set(i, unpack_11_10_11(position, range.low_position, range.high_position));
    cloud.rotation.set(i, unpack_rotation(rotation));
    cloud.log_scale.set(i, unpack_11_10_11(scale, range.low_log_scale, range.high_log_scale));
    const Vec3 rgb =
        lerp(range.low_colour, range.high_colour, unorm(colour, 24, 8), unorm(colour, 16, 8), unorm(colour, 8, 8));
    for (std::size_t c = 0; c < 3; ++c)
      cloud.sh_row(i)[c * scene::sh_coefficients(sh_degree_)] = float((double(rgb[int(c)]) - 0.5) / sh_c0);
    cloud.opacity_logit[i] = logit_of_byte(std::uint8_t(colour & 255u));
  }

  void decode_sh(const std::vector<std::byte>& bytes, scene::GaussianCloud& cloud) const {
    const std::size_t coefficients = scene::sh_coefficients(sh_degree_);
    parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        for (std::size_t j = 0; j < sh_offsets_.size(); ++j)
          cloud.sh_row(i)[j / (coefficients - 1) * coefficients + j % (coefficients - 1) + 1] =
              unpack_sh(std::to_integer<std::uint8_t>(bytes[i * sh_->stride + sh_offsets_[j]]));
    });
  }

  const InputFile& file_;
  const PlyHeader& header_;
  const PlyElement *chunk_ = nullptr, *vertex_ = nullptr, *sh_ = nullptr;  ///< `sh_` may be absent.
  bool has_colour_ranges_ = false;
  int sh_degree_ = 0;
  std::vector<std::size_t> range_offsets_, sh_offsets_;
  std::array<std::size_t, 4> word_offsets_{};
};

std::uint32_t pack_unorm(double value, double low, double high, int bits) {
  const double most = double((1u << bits) - 1u);
  if (!(high > low)) return 0;
  return std::uint32_t(std::clamp(std::round((value - low) / (high - low) * most), 0.0, most));
}

std::uint32_t pack_11_10_11(Vec3 value, Vec3 low, Vec3 high) {
  const auto packed = [&](int c, int bits) {
    return pack_unorm(double(value[c]), double(low[c]), double(high[c]), bits);
  };
  return packed(0, 11) << 21 | packed(1, 10) << 11 | packed(2, 11);
}

std::uint32_t pack_rotation_once(Quat rotation) {
  const auto [largest, rest] = smallest_three(rotation);
  auto word = std::uint32_t(largest);
  for (const double component : rest) word = word << 10 | pack_unorm(component, 0, 1, 10);
  return word;
}

std::uint32_t pack_rotation(Quat rotation) { return stable_rotation(rotation, pack_rotation_once, unpack_rotation); }

float f_dc_of(float colour) { return float((double(colour) - 0.5) / sh_c0); }
float colour_of(float f_dc) { return float(0.5 + sh_c0 * double(f_dc)); }

/// The end of a range of colours, moved by a rounding or two to one that reading and writing again leaves where it is.
float stable_colour(float colour) {
  for (int tries = 0; tries < 8 && colour_of(f_dc_of(colour)) != colour; ++tries) colour = colour_of(f_dc_of(colour));
  return colour;
}

/// What the rows of a chunk lie between.
Range range_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows) {
  constexpr float most = std::numeric_limits<float>::max();
  Range range{Vec3(most), Vec3(-most), Vec3(most), Vec3(-most), Vec3(most), Vec3(-most)};
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  for (const std::uint32_t i : rows) {
    const Vec3 scale = glm::clamp(cloud.log_scale.get(i), -most_log_scale, most_log_scale);
    Vec3 colour;
    for (int c = 0; c < 3; ++c) colour[c] = colour_of(cloud.sh_row(i)[std::size_t(c) * coefficients]);
    range.low_position = glm::min(range.low_position, cloud.mean.get(i));
    range.high_position = glm::max(range.high_position, cloud.mean.get(i));
    range.low_log_scale = glm::min(range.low_log_scale, scale),
    range.high_log_scale = glm::max(range.high_log_scale, scale);
    range.low_colour = glm::min(range.low_colour, colour), range.high_colour = glm::max(range.high_colour, colour);
  }
  for (int c = 0; c < 3; ++c)
    range.low_colour[c] = stable_colour(range.low_colour[c]),
    range.high_colour[c] = stable_colour(range.high_colour[c]);
  return range;
}

}  // namespace

std::vector<std::byte> encode_compressed_ply(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> order) {
  const std::size_t n = order.size(), chunks = (n + chunk_rows - 1) / chunk_rows;
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree), rest = 3 * (coefficients - 1);
  std::string header = "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
  for (const char* name : range_names) header += "property float " + std::string(name) + "\n";
  header += "element vertex " + std::to_string(n) + "\n";
  for (const char* name : word_names) header += "property uint " + std::string(name) + "\n";
  if (rest > 0) header += "element sh " + std::to_string(n) + "\n";
  for (std::size_t k = 0; k < rest; ++k) header += "property uchar f_rest_" + std::to_string(k) + "\n";
  header += "end_header\n";

  constexpr std::size_t chunk_bytes = range_names.size() * sizeof(float), word_bytes = word_names.size() * 4;
  const std::size_t first_word = header.size() + chunks * chunk_bytes, first_sh = first_word + n * word_bytes;
  std::vector<std::byte> bytes(first_sh + n * rest);
  std::memcpy(bytes.data(), header.data(), header.size());
  parallel_for(chunks, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const std::size_t first = chunk * chunk_rows;
      const auto rows = order.subspan(first, std::min(chunk_rows, n - first));
      const Range range = range_of(cloud, rows);
      std::size_t at = header.size() + chunk * chunk_bytes;
      for (const Vec3& ends : {range.low_position, range.high_position, range.low_log_scale, range.high_log_scale,
                               range.low_colour, range.high_colour})
        for (int c = 0; c < 3; ++c, at += sizeof(float)) std::memcpy(bytes.data() + at, &ends[c], sizeof(float));
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const std::uint32_t i = rows[k];
        const auto sh = cloud.sh_row(i);
        std::uint32_t colour = 0;
        for (int c = 0; c < 3; ++c)
          colour = colour << 8 | pack_unorm(double(colour_of(sh[std::size_t(c) * coefficients])),
                                            double(range.low_colour[c]), double(range.high_colour[c]), 8);
        const std::array<std::uint32_t, 4> words = {
            pack_11_10_11(cloud.mean.get(i), range.low_position, range.high_position),
            pack_rotation(cloud.rotation.get(i)),
            pack_11_10_11(glm::clamp(cloud.log_scale.get(i), -most_log_scale, most_log_scale), range.low_log_scale,
                          range.high_log_scale),
            colour << 8 | byte_of_logit(cloud.opacity_logit[i])};
        std::memcpy(bytes.data() + first_word + (first + k) * word_bytes, words.data(), word_bytes);
        for (std::size_t j = 0; j < rest; ++j) {
          const double value = double(sh[j / (coefficients - 1) * coefficients + j % (coefficients - 1) + 1]);
          bytes[first_sh + (first + k) * rest + j] = std::byte(std::uint8_t(std::clamp(
              std::trunc((value / (2 * compressed_ply_most_sh) + 0.5) * compressed_ply_sh_bins), 0.0, 255.0)));
        }
      }
    }
  });
  return bytes;
}

bool is_compressed_ply(const PlyHeader& header) {
  const PlyElement* vertex = header.find("vertex");
  return header.find("chunk") && vertex && vertex->find(word_names[0]);
}

Result<scene::GaussianCloud> read_compressed_ply(const InputFile& file, const PlyHeader& header,
                                                 const ReadOptions& options) {
  return CompressedPly(file, header).read(options);
}

}  // namespace engine::io
