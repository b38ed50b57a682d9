// Requests for a picture: as JSON, or as the query of a URL.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/camera.h"

namespace proto {

/// Which quantity of a rendering the picture shows.
enum class PictureContent { color, depth, alpha, mask };
enum class PictureFormat { jpeg, png, exr };

/// One picture of a version.
struct RenderRequest {
  Viewpoint viewpoint;
  PictureContent content = PictureContent::color;  ///< On the wire: `what`.
  std::optional<PictureFormat> format;             ///< Without one, the format that the client accepts.
  std::optional<int> max_side;                     ///< Pixels, from 1: the camera is scaled down to it.
  Point background{};                              ///< Colour, each 0 to 1.
  int sh_degree = 3;                               ///< 0 to 3: bands above are left out.
  int quality = 90;                                ///< 1 to 100, of a JPEG.
  std::optional<std::string> selection = {};       ///< Id of a selection: what it selects is tinted.
  bool operator==(const RenderRequest&) const = default;
};

/// Strict, as parse_edit_request(), with its errors. `where` is such as "camera.fx" or "max_side".
[[nodiscard]] Result<RenderRequest> parse_render_request(std::string_view text, const JsonLimits& limits = {});

/// Names of the query parameters: view; eye, target, up, fov, width, height; what, format, max_side, background,
/// sh_degree, quality, selection.
[[nodiscard]] std::vector<std::string> render_queries();

/// Reads the request from a query: view=NAME, or eye=x,y,z&target=x,y,z&width=px&height=px with up=x,y,z and
/// fov=degrees if they are wanted.
///   query   the parameter of that name, if it is there
///   errors  invalid_argument: `where` is the parameter
[[nodiscard]] Result<RenderRequest> parse_render_query(
    const std::function<std::optional<std::string>(std::string_view)>& query);

}  // namespace proto
