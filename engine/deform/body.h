// Dragged rows as an elastic body: as rigid as possible between what grips and what holds it.
// Source: Sumner et al. 2007, section 3, for how rows follow nodes; engine/elastic for the rest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/deform.h"
#include "engine/deform/motion.h"
#include "engine/elastic/embedding.h"
#include "engine/elastic/solver.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::deform {

/// The rows of one group, ready to follow its handles anywhere.
class Body {
 public:
  /// A handle grips what is within its `grip` of the row nearest to it, along the body, and takes that along as one
  /// piece; an anchor holds all of that where it is, and so is every row that is held. What several could grip goes
  /// with the nearest of them; of handles in one place only the first grips anything. Where a handle grips or is near,
  /// compared with the size of the body, no row is held: that is the rim that shall move.
  ///   rows   of the cloud, at least one
  ///   drags  of the group, in the frame of the cloud: at least one; where they go does not matter yet
  ///   held   [rows] 1: stays where it is
  /// About 0.2 s for 30,000 rows that hang together.
  Body(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, std::span<const Drag> drags,
       std::span<const std::uint8_t> held);

  [[nodiscard]] std::size_t size() const { return rows_.size(); }

  /// Would the constructor make the same of these?
  [[nodiscard]] bool is_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                           std::span<const Drag> drags, std::span<const std::uint8_t> held) const;

  /// Where the rows go, with their extents: stretched as the body is.
  ///   drags  those of the constructor, with targets
  [[nodiscard]] Deformation follow(const scene::GaussianCloud& cloud, std::span<const Drag> drags) const;
  /// Where they go if the body is drawn out: what is level with the handles or ahead of them is shifted by `pull`, what
  /// is held or anchored stays, and between the two a row goes by its share of the way along the body. Nothing turns.
  ///   drags  those of the constructor, at least one of them no anchor
  ///   pull   not zero
  [[nodiscard]] Deformation draw_out(const scene::GaussianCloud& cloud, std::span<const Drag> drags, DVec3 pull) const;

 private:
  void grip(const neighbours::NeighbourGraph& joined, std::span<const std::uint32_t> nearest,
            std::span<const Drag> drags);
  void hold(const neighbours::NeighbourGraph& joined, std::span<const std::uint32_t> nearest,
            std::span<const Drag> drags, std::span<const std::uint8_t> held);
  void add_grip(std::vector<std::uint32_t> nodes, DVec3 source, int drag);
  [[nodiscard]] Deformation carry(const scene::GaussianCloud& cloud, const elastic::Pose& pose) const;
  [[nodiscard]] std::vector<std::vector<elastic::GripPose>> way_of(std::span<const Drag> drags) const;

  std::vector<std::uint32_t> rows_;
  std::vector<Drag> drags_;         ///< Where they go does not matter.
  std::vector<std::uint8_t> held_;  ///< [rows]
  Array3 means_;                    ///< [rows] in the frame of the cloud.
  DVec3 origin_{0.0};               ///< Of the nodes' coordinates, in the frame of the cloud.
  double size_ = 0;                 ///< Longest side of the box around the rows.
  /// [rows] how much of the body's motion a row takes: 0 where it is held, 1 a node's spacing away. Empty: all of it.
  std::vector<float> freedom_;
  elastic::Embedding embedding_;
  std::vector<int> drag_of_grip_;  ///< Drag that a grip belongs to; -1: held.
  std::vector<elastic::Grip> grips_;
  std::vector<std::uint8_t> gripped_;  ///< [nodes] 1: in a grip.
  std::unique_ptr<elastic::Solver> solver_;
};

}  // namespace engine::deform
