#include "engine/io/ply_layout.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>

namespace engine::io {
namespace {

constexpr std::array<std::string_view, first_f_rest_field> required = {
    "x",     "y",     "z",     "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",  "f_dc_1",  "f_dc_2"};

/// k of "f_rest_k", written as a trainer writes it: no sign, no leading zero.
std::optional<std::size_t> f_rest_number(std::string_view name) {
  constexpr std::string_view prefix = "f_rest_";
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || std::to_string(number) != name) return std::nullopt;
  return number;
}

std::optional<int> degree_of(std::size_t f_rest_count) {
  for (int degree = 0; degree <= scene::max_sh_degree; ++degree)
    if (f_rest_count == 3 * (scene::sh_coefficients(degree) - 1)) return degree;
  return std::nullopt;
}

/// Positions without anything a trained Gaussian has.
bool is_point_cloud(const PlyElement& vertex) {
  return vertex.find("x") && vertex.find("y") && vertex.find("z") && !vertex.find("opacity") &&
         !vertex.find("scale_0") && !vertex.find("rot_0");
}

Result<int> sh_degree_of(const PlyElement& vertex, const std::string& where) {
  const auto count = std::size_t(std::ranges::count_if(
      vertex.properties, [](const PlyProperty& property) { return f_rest_number(property.name).has_value(); }));
  const auto degree = degree_of(count);
  if (!degree)
    return fail(
        ErrorCode::unsupported,
        "the vertices have " + std::to_string(count) + " f_rest properties; SH degree 0, 1, 2 or 3 has 0, 9, 24 or 45",
        where);
  for (std::size_t k = 0; k < count; ++k)
    if (const std::string name = "f_rest_" + std::to_string(k); !vertex.find(name))
      return fail(ErrorCode::corrupt_data, "property '" + name + "' is missing", where);
  return *degree;
}

Result<void> check_vertex(const PlyElement& vertex, const std::string& where) {
  if (is_point_cloud(vertex))
    return fail(ErrorCode::unsupported,
                "this is a point cloud or mesh, not a trained Gaussian scene: its vertices have positions but no "
                "opacity, scale_* and rot_*. Train it first with a 3D Gaussian Splatting trainer, then open the "
                "point_cloud.ply that comes out",
                where);
  for (const std::string_view name : required)
    if (!vertex.find(name))
      return fail(ErrorCode::corrupt_data,
                  "property '" + std::string(name) +
                      "' is missing: a trained Gaussian scene has x y z, f_dc_0..2, "
                      "opacity, scale_0..2 and rot_0..3",
                  where);
  return {};
}

}  // namespace

std::optional<int> field_named(std::string_view name) {
  if (const auto found = std::ranges::find(required, name); found != required.end())
    return int(found - required.begin());
  const auto number = f_rest_number(name);
  if (!number || *number >= 3 * (scene::sh_coefficients(scene::max_sh_degree) - 1)) return std::nullopt;
  return first_f_rest_field + int(*number);
}

Result<PlyLayout> make_layout(PlyHeader header, const std::string& file) {
  const std::string where = file + ":header";
  const PlyElement* vertex = header.find("vertex");
  if (!vertex) return fail(ErrorCode::unsupported, "the file has no 'vertex' element, so no Gaussians", where);
  if (auto checked = check_vertex(*vertex, where); !checked) return propagate(checked);
  const auto degree = sh_degree_of(*vertex, where);
  if (!degree) return propagate(degree);

  PlyLayout layout;
  layout.vertex_element = std::size_t(vertex - header.elements.data());
  layout.sh_degree = *degree;
  for (const PlyProperty& property : vertex->properties) {
    PlyColumn column{property.offset, property.type, field_named(property.name), std::nullopt};
    if (!column.field || column.type != PlyType::float32) {
      column.extra_offset = layout.extra_stride;
      layout.extra_stride += size_of(column.type);
    }
    layout.columns.push_back(column);
  }
  layout.header = std::move(header);
  return layout;
}

PlyLayout inria_layout(int sh_degree) {
  assert(sh_degree >= 0 && sh_degree <= scene::max_sh_degree);
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex 0\n";
  const auto add = [&](const std::string& name) { text += "property float " + name + "\n"; };
  const auto add_numbered = [&](const std::string& name, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) add(name + std::to_string(k));
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) add(name);
  add_numbered("f_dc_", 3);
  add_numbered("f_rest_", 3 * (scene::sh_coefficients(sh_degree) - 1));
  add("opacity");
  add_numbered("scale_", 3);
  add_numbered("rot_", 4);
  text += "end_header\n";
  PlyLayout layout = *make_layout(*parse_ply_header(text, "inria"), "inria");
  for (PlyColumn& column : layout.columns) column.extra_offset.reset();  // the normals: zero in every row
  layout.extra_stride = 0;
  return layout;
}

}  // namespace engine::io
