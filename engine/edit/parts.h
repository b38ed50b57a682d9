// The parts of a drag that move as elastic bodies: how each hangs on to what stays. Found once, before anything moves.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/deform/attach.h"
#include "engine/edit/memory.h"
#include "engine/edit/request.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// What goes on behind a part that is drawn out, as what it grows out of repeats (select::Repeat).
struct Continuation {
  int group = 0;
  double way = 0;                   ///< How far the part goes, world units.
  DVec3 step{0.0};                  ///< One period, that way, world units.
  std::vector<std::uint32_t> tile;  ///< Rows of the input, ascending.
  std::vector<double> depth;        ///< [tile] before the end of what repeats, along the step, world units.
};

/// What follows from input and request alone. Nothing in it but for Interpolation::arap.
struct Parts {
  std::vector<deform::Attachment> attachments;  ///< Of each group that has rows, by its number.
  std::vector<std::uint32_t> rim;               ///< Rows of the input that are held where they are, ascending.
  std::vector<Continuation> continuations;      ///< Of the groups with Attachment::How::continued.
  std::vector<std::size_t> idle;  ///< Anchors that hold nothing, as nothing of their group is within their grip.
  /// A handle farther from all that it moves than that is long, but for what lies astray itself: most likely a slip.
  struct Astray {
    std::size_t handle = 0;  ///< From 0.
    double away = 0;         ///< From the nearest row, world units.
  };
  std::vector<Astray> astray;  ///< By handle.
  /// Where a handle goes in place of its target, as its part is set down on what it stands on.
  struct Corrected {
    std::size_t handle = 0;  ///< From 0.
    DVec3 target{0.0};       ///< World units.
  };
  std::vector<Corrected> corrected = {};
};

/// Looks where each group touches what stays, and decides how it moves.
///   handle  [N] of assign()
///   memory  of this scene
[[nodiscard]] Parts parts_of(const scene::LayeredCloud& scene, std::span<const std::uint16_t> handle,
                             const Request& request, Memory& memory);
[[nodiscard]] Parts parts_of(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle,
                             const Request& request);

/// The rows that a drag takes into account: those with a handle, and those that go on behind them. Ascending.
[[nodiscard]] std::vector<std::uint32_t> rows_in_use(std::span<const std::uint16_t> handle, const Parts& parts);

/// The same parts of a scene that consists of these rows alone.
///   rows  ascending, all of rows_in_use()
[[nodiscard]] Parts among(const Parts& parts, std::span<const std::uint32_t> rows);

}  // namespace engine::edit
