// .splat files: 32 bytes per Gaussian, no header, no SH beyond DC. Source: antimatter15's web viewer, 2023.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/quantised.h"
#include "engine/io/read_options.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::io {

constexpr std::size_t splat_record_bytes = 32;
/// A byte of colour is from black to white.
constexpr StoredRange splat_f_dc{-0.5 / sh_c0, 0.5 / sh_c0, 1 / (255 * sh_c0)};

/// Could these bytes, the first of a file of `size` bytes, be a .splat file? There is no magic number: asks for whole
/// records, and believable positions, sigmas and rotations in each record that lies in `bytes`.
[[nodiscard]] bool looks_like_splat(std::span<const std::byte> bytes, std::uint64_t size);

/// Decodes a whole file. Quaternions come out with unit length (four bytes of 128, which mean none, as the identity);
/// a sigma of zero as log_scale -20, where the engine saturates; opacity as logit_of_byte() says.
///   errors  corrupt_data: the size, NaN or infinity, a negative sigma; unprocessable; too_large
[[nodiscard]] Result<scene::GaussianCloud> decode_splat(std::span<const std::byte> bytes, const std::string& file,
                                                        const ReadOptions& options);

/// The cloud's rows in their order, rounded to what a record holds; SH beyond DC is lost.
[[nodiscard]] std::vector<std::byte> encode_splat(const scene::GaussianCloud& cloud);

}  // namespace engine::io
