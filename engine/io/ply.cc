#include "engine/io/ply.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "engine/core/atomic_file.h"
#include "engine/core/parallel.h"
#include "engine/io/checks.h"

namespace engine::io {
namespace {

using scene::GaussianCloud;

constexpr std::uint64_t max_other_bytes = std::uint64_t(256) << 20;  // elements beside the vertices, in memory
constexpr std::size_t block_bytes = std::size_t(8) << 20;            // of rows, read or written at a time
constexpr std::size_t rows_per_task = 1024;                          // a quarter megabyte of INRIA rows: fits a cache

/// The values of one Gaussian property, row by row; `data` is null when the cloud's SH degree does not reach it.
template <class Float>
struct Values {
  Float* data = nullptr;
  std::size_t stride = 1;

  [[nodiscard]] Float& at(std::size_t row) const { return data[row * stride]; }
};

/// f_rest_j of a file of degree d is coefficient j % K + 1 of channel j / K, where K = (d + 1)^2 - 1.
template <class Cloud>
auto values_of(Cloud& cloud, int field, int file_degree) {
  using Float = std::remove_reference_t<decltype(cloud.sh[0])>;
  auto sh = [&](std::size_t channel, std::size_t coefficient) -> Values<Float> {
    const std::size_t count = scene::sh_coefficients(cloud.sh_degree);
    if (coefficient >= count) return {};
    return {cloud.sh.data() + channel * count + coefficient, cloud.sh_stride()};
  };
  if (field >= first_f_rest_field) {
    const std::size_t j = std::size_t(field - first_f_rest_field);
    const std::size_t per_channel = scene::sh_coefficients(file_degree) - 1;
    return sh(j / per_channel, j % per_channel + 1);
  }
  if (field >= first_f_dc_field) return sh(std::size_t(field - first_f_dc_field), 0);
  const std::array columns = {cloud.mean.x.data(),      cloud.mean.y.data(),       cloud.mean.z.data(),
                              cloud.log_scale.x.data(), cloud.log_scale.y.data(),  cloud.log_scale.z.data(),
                              cloud.rotation.w.data(),  cloud.rotation.x.data(),   cloud.rotation.y.data(),
                              cloud.rotation.z.data(),  cloud.opacity_logit.data()};
  return Values<Float>{columns[std::size_t(field)]};
}

/// Calls visit(T{}) with the C++ type of a property.
template <class Visit>
auto with_type(PlyType type, Visit&& visit) {
  switch (type) {
    case PlyType::int8:
      return visit(std::int8_t{});
    case PlyType::uint8:
      return visit(std::uint8_t{});
    case PlyType::int16:
      return visit(std::int16_t{});
    case PlyType::uint16:
      return visit(std::uint16_t{});
    case PlyType::int32:
      return visit(std::int32_t{});
    case PlyType::uint32:
      return visit(std::uint32_t{});
    case PlyType::float64:
      return visit(double{});
    default:
      return visit(float{});
  }
}

template <class T>
float decoded(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  if constexpr (std::is_same_v<T, double>)  // beyond float: the conversion alone would be undefined
    if (std::abs(value) > double(std::numeric_limits<float>::max()))
      return std::copysign(std::numeric_limits<float>::infinity(), float(std::signbit(value) ? -1 : 1));
  return float(value);
}

template <class T>
T encoded(float value) {
  if constexpr (std::is_floating_point_v<T>) return T(value);
  constexpr double low = double(std::numeric_limits<T>::lowest()), high = double(std::numeric_limits<T>::max());
  return T(std::clamp(std::round(double(value)), low, high));
}

/// Rows [first, first + count) of one property, from the file's bytes into the cloud.
void decode_column(const PlyColumn& column, const PlyLayout& layout, const std::byte* rows, std::size_t first,
                   std::size_t count, GaussianCloud& cloud) {
  const std::size_t stride = layout.vertex().stride, size = size_of(column.type);
  const std::byte* in = rows + column.offset;
  if (column.extra_offset) {
    std::byte* out = cloud.extra.data() + first * cloud.extra_stride + *column.extra_offset;
    for (std::size_t i = 0; i < count; ++i) std::memcpy(out + i * cloud.extra_stride, in + i * stride, size);
  }
  if (column.field) {
    const auto values = values_of(cloud, *column.field, layout.sh_degree);
    with_type(column.type, [&]<class T>(T) {
      for (std::size_t i = 0; i < count; ++i) values.at(first + i) = decoded<T>(in + i * stride);
    });
  }
}

/// The same rows, from the cloud into the file's bytes, which are zero before.
void encode_column(const PlyColumn& column, const PlyLayout& layout, const GaussianCloud& cloud, std::size_t first,
                   std::size_t count, std::byte* rows) {
  const std::size_t stride = layout.vertex().stride, size = size_of(column.type);
  std::byte* out = rows + column.offset;
  if (column.extra_offset) {
    const std::byte* in = cloud.extra.data() + first * cloud.extra_stride + *column.extra_offset;
    for (std::size_t i = 0; i < count; ++i) std::memcpy(out + i * stride, in + i * cloud.extra_stride, size);
  }
  if (column.field) {
    const auto values = values_of(cloud, *column.field, layout.sh_degree);
    with_type(column.type, [&]<class T>(T) {
      for (std::size_t i = 0; i < count; ++i) {
        const float value = values.data ? values.at(first + i) : 0.0f;
        std::byte* cell = out + i * stride;
        if (std::bit_cast<std::uint32_t>(decoded<T>(cell)) == std::bit_cast<std::uint32_t>(value)) continue;
        const T stored = encoded<T>(value);
        std::memcpy(cell, &stored, sizeof stored);
      }
    });
  }
}

bool all_zero(const PlyColumn& column, std::size_t stride, const std::byte* rows, std::size_t count) {
  const std::size_t size = size_of(column.type);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, rows + i * stride + column.offset, size);
    if (bits != 0) return false;
  }
  return true;
}

/// Room in `extra`: for every property the cloud's floats cannot give back, but not for those marked as zero.
void assign_extra(PlyLayout& layout, const std::vector<std::atomic<bool>>& has_bytes) {
  layout.extra_stride = 0;
  for (std::size_t i = 0; i < layout.columns.size(); ++i) {
    PlyColumn& column = layout.columns[i];
    column.extra_offset.reset();
    if (column.field ? column.type == PlyType::float32 : !has_bytes[i].load()) continue;
    column.extra_offset = layout.extra_stride;
    layout.extra_stride += size_of(column.type);
  }
}

Result<void> check_memory(const PlyLayout& layout, const InputFile& file, const ReadOptions& options) {
  return check_limits(layout.vertex().count, cloud_row_bytes(layout.sh_degree) + layout.extra_stride, options,
                      file.name());
}

/// Fills the cloud from the rows at `begin`. A property without a place in memory that has a byte other than zero is
/// marked in has_bytes; the caller then reads again.
Result<GaussianCloud> read_rows(const InputFile& file, std::uint64_t begin, const PlyLayout& layout,
                                std::vector<std::atomic<bool>>& has_bytes) {
  GaussianCloud cloud;
  cloud.sh_degree = layout.sh_degree;
  cloud.extra_stride = layout.extra_stride;
  const std::size_t count = std::size_t(layout.vertex().count), stride = layout.vertex().stride;
  cloud.resize(count);
  const std::size_t block_rows = std::min(count, std::max<std::size_t>(1, block_bytes / stride));
  std::vector<std::byte> block(block_rows * stride);
  for (std::size_t first = 0; first < count; first += block_rows) {
    const std::size_t rows = std::min(block_rows, count - first);
    if (auto read = file.read_at(begin + first * stride, std::span(block).first(rows * stride)); !read)
      return propagate(read);
    parallel_for(rows, rows_per_task, [&](std::size_t row, std::size_t end) {
      const std::byte* bytes = block.data() + row * stride;
      for (std::size_t i = 0; i < layout.columns.size(); ++i) {
        const PlyColumn& column = layout.columns[i];
        if (column.field || column.extra_offset)
          decode_column(column, layout, bytes, first + row, end - row, cloud);
        else if (!has_bytes[i].load(std::memory_order_relaxed) && !all_zero(column, stride, bytes, end - row))
          has_bytes[i].store(true, std::memory_order_relaxed);
      }
    });
  }
  return cloud;
}

std::string header_with_count(const PlyLayout& layout, std::size_t count) {
  std::string text = layout.header.text;
  const PlyElement& vertex = layout.vertex();
  if (count != vertex.count) text.replace(vertex.count_begin, vertex.count_size, std::to_string(count));
  return text;
}

}  // namespace

Result<SceneFile> read_ply(const std::filesystem::path& path, const ReadOptions& options) {
  const auto file = InputFile::open(path);
  if (!file) return propagate(file);
  auto header = read_ply_header(*file);
  if (!header) return propagate(header);
  return read_ply(*file, std::move(*header), options);
}

Result<SceneFile> read_ply(const InputFile& file, PlyHeader header, const ReadOptions& options) {
  return within_memory(file.name(), [&]() -> Result<SceneFile> {
    auto made = make_layout(std::move(header), file.name());
    if (!made) return propagate(made);
    PlyLayout& layout = *made;
    const auto offsets = element_offsets(layout.header, file);
    if (!offsets) return propagate(offsets);
    const std::uint64_t begin = (*offsets)[layout.vertex_element], end = (*offsets)[layout.vertex_element + 1];
    if (const auto other = begin - offsets->front() + (offsets->back() - end); other > max_other_bytes)
      return fail(ErrorCode::too_large,
                  "the elements beside the vertices take " + std::to_string(other) + " bytes; the limit is " +
                      std::to_string(max_other_bytes),
                  file.name() + ":header");
    // First in the hope that all unknown properties are zero in every row, as INRIA's normals are.
    std::vector<std::atomic<bool>> has_bytes(layout.columns.size());
    assign_extra(layout, has_bytes);
    if (auto checked = check_memory(layout, file, options); !checked) return propagate(checked);
    auto cloud = read_rows(file, begin, layout, has_bytes);
    if (!cloud) return propagate(cloud);
    if (std::ranges::any_of(has_bytes, [](const auto& has) { return has.load(); })) {
      *cloud = {};
      assign_extra(layout, has_bytes);
      if (auto checked = check_memory(layout, file, options); !checked) return propagate(checked);
      cloud = read_rows(file, begin, layout, has_bytes);
      if (!cloud) return propagate(cloud);
    }
    if (auto finite = check_finite(*cloud, file.name()); !finite) return propagate(finite);

    auto before = file.read_at(offsets->front(), begin - offsets->front());
    if (!before) return propagate(before);
    auto after = file.read_at(end, offsets->back() - end);
    if (!after) return propagate(after);
    layout.before = std::move(*before);
    layout.after = std::move(*after);
    return SceneFile{std::move(*cloud), std::move(layout)};
  });
}

Result<void> write_ply(const std::filesystem::path& path, const GaussianCloud& cloud, const PlyLayout& layout) {
  const std::string name = path.filename().string();
  if (auto writable = check_writable(cloud, name); !writable) return writable;
  if (cloud.extra_stride != layout.extra_stride || cloud.sh_degree > layout.sh_degree)
    return fail(ErrorCode::internal, "the scene does not fit the layout it is to be written in", name);

  auto file = AtomicFile::create(path);
  if (!file) return propagate(file);
  const std::size_t count = cloud.size(), stride = layout.vertex().stride;
  const std::string header = header_with_count(layout, count);
  if (auto written = file->write(std::as_bytes(std::span(header))); !written) return written;
  if (auto written = file->write(layout.before); !written) return written;
  const std::size_t block_rows = std::min(count, std::max<std::size_t>(1, block_bytes / stride));
  std::vector<std::byte> block(block_rows * stride);
  for (std::size_t first = 0; first < count; first += block_rows) {
    const std::size_t rows = std::min(block_rows, count - first);
    std::ranges::fill(block, std::byte{0});
    parallel_for(rows, rows_per_task, [&](std::size_t row, std::size_t end) {
      for (const PlyColumn& column : layout.columns)
        encode_column(column, layout, cloud, first + row, end - row, block.data() + row * stride);
    });
    if (auto written = file->write(std::span(block).first(rows * stride)); !written) return written;
  }
  if (auto written = file->write(layout.after); !written) return written;
  return file->commit();
}

}  // namespace engine::io
