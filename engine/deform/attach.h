// Whether a part moves as one piece, as an elastic body of its own, or as one that grows out of what stays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/deform/choices.h"
#include "engine/deform/motion.h"
#include "engine/deform/rigid.h"

namespace engine::deform {

/// How a part hangs on to what stays.
struct Contact {
  std::size_t shown = 0;    ///< Rows of the part that show from outside.
  std::size_t touches = 0;  ///< Those of them next to a row that stays.
  std::size_t goes_on = 0;  ///< Those of these where the surface goes on there.
  double firmness = 0;      ///< Of its weakest border, of what is usual within it (select::Contact).
  double size = 0;          ///< Longest edge of the box around the part, but for what lies astray, world units.
};

/// How a group moves.
struct Attachment {
  enum class How {
    one_piece,  ///< By one motion that takes every handle to its target.
    free,       ///< As an elastic body between its handles.
    held,       ///< The same, and where it touches what stays it stays.
    drawn_out,  ///< Held, and stretched between there and its handles, which all go one way.
    continued,  ///< As one piece; what it grows out of, which repeats along its way, goes on behind it.
  };
  int group = 0;
  How how = How::one_piece;
  bool scales = false;     ///< One piece that grows or shrinks as its handles do.
  bool grows_out = false;  ///< Its surface goes on into what stays: that is where it is held, if it is.
  std::string why;         ///< For people, as the end of "it moves as one piece, because ...".
  bool comes_off = false;  ///< It grows out of what stays, and goes as it goes too far to bend.
  double settled = 0;      ///< So far from where its handles ask it is set down on what it stands on, world units.
};
constexpr auto names_of(Attachment::How) {
  using How = Attachment::How;
  return std::array{Name{How::one_piece, "one_piece"}, Name{How::free, "free"}, Name{How::held, "held"},
                    Name{How::drawn_out, "drawn_out"}, Name{How::continued, "continued"}};
}

/// The motion of a group, if one takes each of its handles to within a twentieth of the longest way of its target
/// (people place handles no better; handles in a row, which say less, to within 3 %), and turns and scales them as they
/// ask for. An anchor is a handle that stays. Turning and shifting alone come first; that all of it grows or shrinks
/// takes three handles that are not in a row, or one that says so.
[[nodiscard]] std::optional<RigidMotion> motion_as_one_piece(std::span<const Drag> drags, int group);

/// The shift that takes all handles of a group to their targets, if one does as exactly as one motion would have to,
/// and none of them asks for more than that; nothing where it is zero, or where an anchor belongs to them.
[[nodiscard]] std::optional<DVec3> pull_of(std::span<const Drag> drags, int group);

/// The motion that comes nearest to what the handles ask for.
[[nodiscard]] RigidMotion nearest_motion(std::span<const Drag> drags, int group, bool scales);

/// Decides for a group; with `asked` other than automatic, as asked. What is drawn out is held by all that it touches.
///   contact  of the group's rows
[[nodiscard]] Attachment attach(std::span<const Drag> drags, int group, const Contact& contact, Attach asked,
                                bool draws_out = false);

}  // namespace engine::deform
