// How the rows of an INRIA 3DGS .ply file map to a GaussianCloud and back.
// Source of the property names and their meaning: Kerbl et al. 2023, the authors' released files.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/ply_header.h"
#include "engine/io/scene_origin.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// The properties of a Gaussian, numbered: x y z, scale_0..2, rot_0..3, opacity, f_dc_0..2, f_rest_0..44.
constexpr int first_f_dc_field = 11, first_f_rest_field = 14;

/// One property of the vertex element: where it is in the file's row, and where it lives in memory. A Gaussian
/// property that is a float32 lives in the cloud alone; of another type, its value lives in the cloud and its bytes in
/// `extra`, so that they can be given back. Any other property lives in `extra`, or nowhere if all its bytes are zero.
struct PlyColumn {
  std::size_t offset = 0;  ///< In the file's row, bytes.
  PlyType type = PlyType::float32;
  std::optional<int> field;                 ///< Number of the Gaussian property it is.
  std::optional<std::size_t> extra_offset;  ///< In a row of GaussianCloud::extra.
};

/// All of a .ply file but its Gaussians: what write_ply() needs to give the file back byte for byte.
struct PlyLayout {
  PlyHeader header;                      ///< Text as given; write_ply() changes nothing but the vertex count.
  std::size_t vertex_element = 0;        ///< Its index in header.elements.
  std::vector<std::byte> before, after;  ///< The elements before and after the vertices, as bytes.
  std::vector<PlyColumn> columns;        ///< One per vertex property, in file order.
  std::size_t extra_stride = 0;          ///< Bytes per row that the cloud keeps in `extra`.
  int sh_degree = 0;                     ///< Of the property list; the cloud may have less, then zeros are written.

  [[nodiscard]] const PlyElement& vertex() const { return header.elements[vertex_element]; }
};

/// A scene with what its file holds beside the Gaussians.
struct SceneFile {
  scene::GaussianCloud cloud;
  PlyLayout layout;
  SceneOrigin origin = {};
};

/// Number of the Gaussian property of that name.
[[nodiscard]] std::optional<int> field_named(std::string_view name);

/// The layout of a header, with `extra` room for every property but the Gaussian ones of type float32.
///   errors  unsupported: no vertices, a point cloud or mesh, an f_rest count that is no SH degree from 0 to 3;
///           corrupt_data: a Gaussian property is missing. `where` is "<file>:header".
[[nodiscard]] Result<PlyLayout> make_layout(PlyHeader header, const std::string& file);

/// The layout that INRIA's trainer writes for a degree from 0 to 3, with nx ny nz (zeros), 62 properties at degree 3.
[[nodiscard]] PlyLayout inria_layout(int sh_degree);

}  // namespace engine::io
