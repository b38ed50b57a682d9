// The scene while it is edited: the input's rows, then those an edit adds, with the columns the edit needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/soa.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/frame.h"

namespace engine::working {

struct Members;

/// What a row is to the edit. All but `frozen` make up the 3D mask M.
enum class Role : std::uint8_t {
  frozen,     ///< Outside M: is never changed.
  held,       ///< An input row of P_h that has not moved yet.
  original,   ///< An input row whose copy has left, or that was given up; its opacity was lowered.
  copy,       ///< A deformed copy at its latest place, in P_h.
  trail,      ///< Not the input's and not in P_h: a copy that was copied in turn, in an extend, its opacity lowered; or
              ///< a child that the optimisation gave an original.
  seed,       ///< New, of the repair: a surface that nobody has seen goes on there. So are its children.
  continued,  ///< New, of the deformation: what a part was drawn out of goes on there. So are its children.
  relit       ///< An input row that stays, in other colours.
};

/// Are rows of this role members of P_h?
[[nodiscard]] constexpr bool is_dragged(Role role) { return role == Role::held || role == Role::copy; }
/// Are rows of this role the input's, and where they were?
[[nodiscard]] constexpr bool stays(Role role) { return role == Role::frozen || role == Role::relit; }
/// Have rows of this role left their place, in a move? Originals have, and children that the optimisation gave them.
[[nodiscard]] constexpr bool has_left(Role role) { return role == Role::original || role == Role::trail; }
/// Are rows of this role neither the input's nor copies of what is dragged?
[[nodiscard]] constexpr bool is_new(Role role) { return role == Role::seed || role == Role::continued; }
/// Are rows of this role where the drag brought something?
[[nodiscard]] constexpr bool has_arrived(Role role) { return role == Role::copy || role == Role::continued; }
/// May rows of this role be the input's?
[[nodiscard]] constexpr bool is_of_input(Role role) {
  return role == Role::frozen || role == Role::held || role == Role::original || role == Role::relit;
}

/// Handle number + 1 of each row that belongs to P_h, else 0 (deform::HandleColumn).
using HandleColumn = std::vector<std::uint16_t>;

/// A Gaussian and what the edit knows of it, N rows of one kind. Invariants, which check() states as code:
/// - every column has a value for each Gaussian of the cloud;
/// - rows [0, input_rows()) are the input's, in its order, each its own parent, frozen, held, original or relit; the
///   rest were
///   appended, in the order they were made, and are copies, trails, seeds or continued, with an input row for a parent;
/// - a row has a handle exactly if it belongs to P_h: if it is held or a copy;
/// - frozen rows are the input's bytes, in the frame of the edit.
class WorkingScene {
 public:
  WorkingScene() = default;
  /// The input with its rows assigned: one copy of the cloud. Rows with a handle are held, the others frozen.
  ///   handle  [N]
  WorkingScene(const scene::GaussianCloud& input, const Frame& frame, HandleColumn handle);

  [[nodiscard]] std::size_t size() const { return role_.size(); }
  [[nodiscard]] std::size_t input_rows() const { return input_rows_; }
  [[nodiscard]] const Frame& frame() const { return frame_; }
  [[nodiscard]] const scene::GaussianCloud& cloud() const { return cloud_; }  ///< In frame().
  [[nodiscard]] const HandleColumn& handle() const { return handle_; }
  [[nodiscard]] const std::vector<Role>& role() const { return role_; }
  [[nodiscard]] const std::vector<std::uint32_t>& parent() const { return parent_; }  ///< Input row each comes from.
  /// Of members of P_h: where they were before the interval's deformation.
  [[nodiscard]] const Array3& mean_at_deform() const { return mean_at_deform_; }

  /// Rows of P_h, that have left their place (has_left()), of M, of one role; ascending.
  [[nodiscard]] std::vector<std::uint32_t> dragged_rows() const;
  [[nodiscard]] std::vector<std::uint32_t> rows_that_left() const;
  [[nodiscard]] std::vector<std::uint32_t> member_rows() const;
  [[nodiscard]] std::vector<std::uint32_t> rows_of(Role role) const;

  /// The Gaussians, to give members of M other values. Their number and the frozen rows are not to be touched.
  [[nodiscard]] scene::GaussianCloud& gaussians() { return cloud_; }
  /// Row k of the new ones is row rows[k] of `from` (which may be cloud() itself), of role[k], and comes from row
  /// ancestor[k] of this scene: it has its parent and, where its role has one, its handle and its mean_at_deform.
  ///   role     copy, trail, seed or continued; a copy's ancestor belongs to P_h
  ///   returns  the first new row
  std::uint32_t append(const scene::GaussianCloud& from, std::span<const std::uint32_t> rows,
                       std::span<const Role> role, std::span<const std::uint32_t> ancestor);
  /// The row leaves P_h and stays where it is: as an original if it is the input's, else as a trail.
  void leave_behind(std::uint32_t row);
  /// A row that is frozen or relit is to be given other colours.
  void relight(std::uint32_t row);
  /// A row that is frozen or relit is to go, though nothing of it moves: it becomes an original, its opacity lowered as
  /// in a move.
  void give_up(std::uint32_t row);
  /// A deformation begins: mean_at_deform of this row is where it is now.
  void note_mean(std::uint32_t row) { mean_at_deform_.set(row, cloud_.mean.get(row)); }

  /// Those of `rows` that are the input's, as the edit found them, in frame().
  [[nodiscard]] scene::GaussianCloud unedited(const scene::GaussianCloud& input,
                                              std::span<const std::uint32_t> rows) const;

  /// The invariants, but for the bytes of frozen rows.
  [[nodiscard]] bool check() const;

 private:
  friend Members members_of(const WorkingScene& working);
  friend Result<WorkingScene> restore(const Members& members, const scene::GaussianCloud& input, const Frame& frame);

  Frame frame_;
  std::size_t input_rows_ = 0;
  scene::GaussianCloud cloud_;
  HandleColumn handle_;
  std::vector<Role> role_;
  std::vector<std::uint32_t> parent_;
  Array3 mean_at_deform_;
};

/// Row `a` of `from`, everything included, in place of row `b` of `to`. Same degree and extra bytes.
void copy_row(const scene::GaussianCloud& from, std::size_t a, scene::GaussianCloud& to, std::size_t b);

/// The rows of M of a working scene: what it takes, beside the input, to have it again. Never the frozen rows.
struct Members {
  std::vector<std::uint32_t> inputs;  ///< Rows of the input that belong to M, ascending.
  scene::GaussianCloud cloud;         ///< Those rows, then all appended ones, in the frame of the edit.
  std::vector<Role> role;             ///< [M]
  HandleColumn handle;                ///< [M]
  std::vector<std::uint32_t> parent;  ///< [M]
  Array3 mean_at_deform;              ///< [M]
  bool operator==(const Members&) const = default;
};

[[nodiscard]] Members members_of(const WorkingScene& working);

/// The working scene that these rows and the frozen ones of the input make.
///   errors  invalid_argument: they are of another scene, or of none; `where` is empty
[[nodiscard]] Result<WorkingScene> restore(const Members& members, const scene::GaussianCloud& input,
                                           const Frame& frame);

}  // namespace engine::working
