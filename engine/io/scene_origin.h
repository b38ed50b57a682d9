// What a scene's file said beside its Gaussians and its rows: format, axes, packing, and what others put into it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/names.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Formats of scene files.
enum class SceneFormat {
  ply,             ///< INRIA: everything, and the only one that gives rows back byte for byte.
  compressed_ply,  ///< PlayCanvas, SuperSplat: 16 bytes per Gaussian and its SH in bytes, in chunks with a range each.
  splat,           ///< 32 bytes per Gaussian; no SH beyond DC.
  spz,             ///< About a tenth of the size, rounded.
  sog,             ///< Pictures with palettes, about a fifteenth of the size; written bundled, version 2.
  glb              ///< glTF with KHR_gaussian_splatting: floats.
};
constexpr auto names_of(SceneFormat) {
  return std::array{Name{SceneFormat::ply, "ply"},     Name{SceneFormat::compressed_ply, "compressed_ply"},
                    Name{SceneFormat::splat, "splat"}, Name{SceneFormat::spz, "spz"},
                    Name{SceneFormat::sog, "sog"},     Name{SceneFormat::glb, "glb"}};
}

/// The usual end of a file's name, without the first dot: "ply", "compressed.ply", ...
[[nodiscard]] constexpr const char* extension_of(SceneFormat format) {
  switch (format) {
    case SceneFormat::compressed_ply:
      return "compressed.ply";
    case SceneFormat::splat:
      return "splat";
    case SceneFormat::spz:
      return "spz";
    case SceneFormat::sog:
      return "sog";
    case SceneFormat::glb:
      return "glb";
    default:
      return "ply";
  }
}

/// A record in an .spz file that is not about its Gaussians.
struct SpzExtension {
  std::uint32_t type = 0;  ///< Vendor in the high 16 bits, the vendor's own number in the low ones.
  std::vector<std::byte> payload;
  bool operator==(const SpzExtension&) const = default;
};

/// Where a scene comes from. A writer of the same format gives back what of it the format holds.
struct SceneOrigin {
  SceneFormat format = SceneFormat::ply;
  int version = 0;             ///< Of the format, where it has versions: .spz 1 to 4, SOG 1 and 2, glTF 2.
  std::string axes = "RDF";    ///< The file's x, y, z: Left or Right, Up or Down, Front or Back, in any order.
  bool axes_declared = false;  ///< By the file itself; else they are what the format says or everybody does.
  std::string packing;         ///< How the Gaussians are packed, for people: "gzip", "zstd", "WebP, palettes".
  bool antialiased = false;    ///< Trained with the low-pass filter of Mip-Splatting; the renderer here has none.
  std::vector<SpzExtension> spz_extensions;  ///< But for the one that declares the axes.
  std::vector<std::string> left_out;         ///< What the file held and reading left out: a sentence each.
};

/// A scene out of a file that has no rows to keep.
struct DecodedScene {
  scene::GaussianCloud cloud;
  SceneOrigin origin;
};

}  // namespace engine::io
