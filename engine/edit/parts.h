// The parts of a drag that move as elastic bodies: how each hangs on to what stays. Found once, before anything moves.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/deform/attach.h"
#include "engine/edit/request.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// What follows from input and request alone. Nothing in it but for Interpolation::arap.
struct Parts {
  std::vector<deform::Attachment> attachments;  ///< Of each group that has rows, by its number.
  std::vector<std::uint32_t> rim;               ///< Rows of the input that are held where they are, ascending.
  std::vector<std::size_t> idle;  ///< Anchors that hold nothing, as nothing of their group is within their grip.
};

/// Looks where each group touches what stays, and decides how it moves.
///   handle  [N] of assign()
[[nodiscard]] Parts parts_of(const scene::LayeredCloud& scene, std::span<const std::uint16_t> handle,
                             const Request& request);
[[nodiscard]] Parts parts_of(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle,
                             const Request& request);

/// The same parts of a scene that consists of these rows alone.
///   rows  ascending
[[nodiscard]] Parts among(const Parts& parts, std::span<const std::uint32_t> rows);

}  // namespace engine::edit
