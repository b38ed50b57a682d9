// Binary glTF with Gaussians: KHR_gaussian_splatting, and KHR_gaussian_splatting_compression_spz_2 where a file has it.
// Source: Khronos, "glTF 2.0"; "KHR_gaussian_splatting", release candidate of 2025 and 2026; "..._compression_spz_2",
// draft.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/read_options.h"
#include "engine/io/scene_origin.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

/// Do these first bytes of a file say binary glTF?
[[nodiscard]] bool looks_like_glb(std::span<const std::byte> bytes);

/// Bytes that the Gaussians of a file take in memory, by its JSON: at least the file's own size, and that alone where
/// the JSON says nothing that the file could hold, or takes more than options.memory lends.
[[nodiscard]] std::uint64_t expected_glb_bytes(std::span<const std::byte> bytes, const ReadOptions& options = {});

/// Decodes a whole file: all Gaussians of the scene that it names (without one: of all nodes), where their nodes put
/// them, turned from glTF's left, up, front to right, down, front. Meshes, cameras and materials are left out, and what
/// another colour space would mean; that is said.
///   errors  corrupt_data: chunks, views or accessors that contradict each other or the file; a circle of nodes; NaN
///           unsupported: no Gaussians (a mesh), SH degree 4, data in other files, a node that scales unevenly or
///           shears, another kernel, an extension that is required and unknown
///           unprocessable, too_large: asked before anything is decoded; those of options.memory
///   `where` is "<file>:nodes[3].scale", "<file>:accessors[2]"
[[nodiscard]] Result<DecodedScene> decode_glb(std::span<const std::byte> bytes, const std::string& file,
                                              const ReadOptions& options);

/// One node, one primitive, floats throughout: rows in their order, nothing rounded but by exp() of the scale and the
/// opacity's sigmoid, and rotations to unit length. COLOR_0 for viewers that know points alone.
///   errors  too_large: 4 GiB, the most that the container can hold
[[nodiscard]] Result<std::vector<std::byte>> encode_glb(const scene::GaussianCloud& cloud, const std::string& file);

}  // namespace engine::io
