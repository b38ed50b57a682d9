#include "engine/io/ply_points.h"

#include <array>
#include <cmath>
#include <string>

#include "engine/core/byte_reader.h"
#include "engine/io/input_file.h"
#include "engine/io/ply_header.h"

namespace engine::io {

Result<std::vector<Point>> read_ply_points(const std::filesystem::path& path) {
  const auto file = InputFile::open(path);
  if (!file) return propagate(file);
  const auto header = read_ply_header(*file);
  if (!header) return propagate(header);
  const auto offsets = element_offsets(*header, *file);
  if (!offsets) return propagate(offsets);

  const PlyElement* vertex = header->find("vertex");
  constexpr std::array position_names{"x", "y", "z"}, color_names{"red", "green", "blue"};
  std::array<const PlyProperty*, 3> position{}, color{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (vertex != nullptr) position[i] = vertex->find(position_names[i]), color[i] = vertex->find(color_names[i]);
    if (position[i] == nullptr || (position[i]->type != PlyType::float32 && position[i]->type != PlyType::float64))
      return fail(
          ErrorCode::unsupported,
          std::string("expected an element vertex with a property ") + position_names[i] + " of type float or double",
          file->name() + ":header");
    if (color[i] != nullptr && color[i]->type != PlyType::uint8)
      return fail(ErrorCode::unsupported, std::string("expected property ") + color_names[i] + " to be of type uchar",
                  file->name() + ":header");
  }

  const auto begin = (*offsets)[std::size_t(vertex - header->elements.data())];
  const auto bytes = file->read_at(begin, vertex->count * vertex->stride);  // fits: element_offsets() has checked
  if (!bytes) return propagate(bytes);
  std::vector<Point> points(vertex->count);
  for (std::size_t row = 0; row < points.size(); ++row) {
    const auto at = [&](const PlyProperty& property) {
      return ByteReader(std::span(*bytes).subspan(row * vertex->stride + property.offset));
    };
    for (std::size_t i = 0; i < 3; ++i) {
      const bool is_float = position[i]->type == PlyType::float32;
      const double value = is_float ? double(at(*position[i]).read<float>()) : at(*position[i]).read<double>();
      if (!std::isfinite(value))
        return fail(ErrorCode::corrupt_data, "expected a finite number",
                    file->name() + ":vertex[" + std::to_string(row) + "]." + position_names[i]);
      points[row].position[int(i)] = value;
      if (color[i] != nullptr) points[row].rgb[i] = at(*color[i]).read<std::uint8_t>();
    }
  }
  return points;
}

}  // namespace engine::io
