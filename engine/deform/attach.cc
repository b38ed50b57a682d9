#include "engine/deform/attach.h"

#include <algorithm>
#include <cmath>

namespace engine::deform {
namespace {

using How = Attachment::How;

// Of the longest way: people place handles no better, and nobody sees the difference. Handles in a row say no more than
// how far apart they go, which is the more exact for it.
constexpr double tolerance = 0.05, tolerance_in_a_row = 0.03;
// Share of a part's border across which its surface goes on, where it grows out of what stays. Of a jaw, whose border
// is half lips, two fifths.
constexpr double grown = 0.2;
// A part grows out of the rest where its weakest border is this firm. Made-up captures of a mug, a ball, a block, a
// board and a rod have 0.02 to 0.07, however widely they are selected; of a jaw and of a plant cut through its stem
// 0.22 to 0.26. Real ones: a toy, a bow and a knot 0 to 0.04, a rider's jacket 0.12, a fox's head and neck, a guitar's
// body and neck 0.18 to 0.19, the fox's head 0.26 (docs/adr/0031-what-holds-a-part-is-its-weakest-border.md).
constexpr double firm = 0.12;
// Where it touches with little of what shows, it takes more: the ball of the demo scene stands on its book with 0.012
// to 0.020 of it, at 0.11 to 0.13; with 0.014 the guitar's neck is held at 0.19.
constexpr double little = 0.02, firm_by_little = 0.16;
// It hangs on by less: a doll's head by its neck, a sleeve, at 0.08 to 0.09; the ball among 20,000 Gaussians has 0.07.
constexpr double hanging = 0.075;
// Whether somebody who takes a part means to bend it or to take it away, the way says: a nudge bends whatever hangs on,
// in parts of its size, and what is this firm, as a fox's ear and its head, bends until it is drawn out to twice its
// size. Between them the way goes with the firmness: a lamp before a wall has 0.128 if rows of the wall were taken with
// it, and goes by nine tenths of its size (docs/adr/0062-the-looser-the-sooner-it-goes.md).
constexpr double nudge = 0.2, firmly = 0.2;

/// Does each handle turn and grow as it asks for?
bool turns_as_asked(std::span<const Drag> drags, int group, const RigidMotion& motion) {
  constexpr double least_cosine = 0.999;  // of half the angle: 5 degrees
  return std::ranges::all_of(drags, [&](const Drag& drag) {
    if (drag.group != group || drag.anchor) return true;
    const bool turns = !drag.turn || std::abs(glm::dot(*drag.turn, motion.turn)) > least_cosine;
    return turns && std::abs(std::log(drag.scale / motion.scale)) < tolerance;
  });
}

/// Does its surface go on into what stays, across a border of this firmness at least?
bool goes_on(const Contact& contact, double firmness) {
  return contact.touches > 0 && double(contact.goes_on) >= grown * double(contact.touches) &&
         contact.firmness >= firmness;
}

bool touches_by_little(const Contact& contact) { return double(contact.touches) < little * double(contact.shown); }

/// The longest way, world units, by which a part that hangs on is bent; what goes farther comes off.
double bends_by(const Contact& contact) {
  const double share = (contact.firmness - hanging) / (firmly - hanging);
  return contact.size * std::lerp(nudge, 1.0, std::clamp(share, 0.0, 1.0));
}

/// Is a part shifted by so little that it bends?
bool is_nudged(std::span<const Drag> drags, int group, const Contact& contact) {
  const std::optional<DVec3> pull = pull_of(drags, group);
  return pull && glm::length(*pull) < bends_by(contact);
}

}  // namespace

RigidMotion nearest_motion(std::span<const Drag> drags, int group, bool scales) {
  const Places places = places_of(drags, group);
  if (places.from.size() > 1)
    return scales ? fit_similarity(places.from, places.to) : fit_any_turn(places.from, places.to);
  const auto drag = std::ranges::find(drags, group, &Drag::group);
  RigidMotion motion;
  motion.centre = places.from[0], motion.shift = places.to[0] - places.from[0];
  motion.turn = drag->turn.value_or(motion.turn);
  motion.scale = drag->scale;
  return motion;
}

std::optional<RigidMotion> motion_as_one_piece(std::span<const Drag> drags, int group) {
  const Places places = places_of(drags, group);
  const bool is_row = !span_a_plane(places.from);
  constexpr double rounding = 1e-12;  // of coordinates: handles that all stay are one piece, too
  const double slack = (is_row ? tolerance_in_a_row : tolerance) * places.longest + rounding * places.extent;
  const auto suits = [&](const RigidMotion& motion, std::span<const Drag> asked) {
    return motion.residual <= slack && turns_as_asked(asked, group, motion);
  };
  const RigidMotion rigid = nearest_motion(drags, group, false);
  if (suits(rigid, drags)) return rigid;
  // Two handles drawn apart may as well mean to stretch, and anchors do not grow.
  if (is_row || places.anchors > 0) return std::nullopt;
  const RigidMotion similar = nearest_motion(drags, group, true);
  std::vector<Drag> scaled(drags.begin(), drags.end());  // handles that give no scale leave it open
  for (Drag& drag : scaled)
    if (drag.scale == 1) drag.scale = similar.scale;
  if (suits(similar, scaled)) return similar;
  return std::nullopt;
}

std::optional<DVec3> pull_of(std::span<const Drag> drags, int group) {
  const Places places = places_of(drags, group);
  RigidMotion shift;
  shift.shift = nearest_motion(drags, group, false).shift;
  double off = 0;
  for (std::size_t i = 0; i < places.from.size(); ++i)
    off = std::max(off, glm::distance(shift(places.from[i]), places.to[i]));
  const bool is_all = places.anchors == 0 && off <= tolerance * places.longest && turns_as_asked(drags, group, shift);
  if (!is_all || shift.shift == DVec3(0.0)) return std::nullopt;
  return shift.shift;
}

Attachment attach(std::span<const Drag> drags, int group, const Contact& contact, Attach asked, bool draws_out) {
  const Places places = places_of(drags, group);
  const auto motion = motion_as_one_piece(drags, group);
  const bool is_one_piece = motion.has_value(), scales = is_one_piece && motion->scale != 1;
  const bool touches = contact.touches > 0;
  const bool grows_out = goes_on(contact, touches_by_little(contact) ? firm_by_little : firm);
  const bool hangs = !touches_by_little(contact) && goes_on(contact, hanging);
  if (asked == Attach::held)
    return {
        group, touches ? How::held : How::free, false, grows_out || hangs,
        touches ? "the request asks for it" : "the request asks for it to be held, but it touches nothing that stays"};
  if (asked == Attach::free)
    return {group, is_one_piece ? How::one_piece : How::free, scales, grows_out, "the request asks for it to be free"};

  if (draws_out && touches) return {group, How::held, false, grows_out, "it is drawn out of what it touches"};
  if (is_one_piece && places.from.size() > 2 && span_a_plane(places.from))
    return {group, How::one_piece, scales, grows_out, "one motion takes all its handles to their targets"};
  // It is half of a thing that somebody means to take away, or was selected with a piece of what it stands on.
  if (is_one_piece && grows_out && places.longest > bends_by(contact))
    return {.group = group,
            .how = How::one_piece,
            .scales = scales,
            .grows_out = grows_out,
            .why = "it goes farther than a part that is held like this bends (attach \"held\" keeps it)",
            .comes_off = true};
  if (grows_out) return {group, How::held, false, grows_out, "its surface goes on into what stays"};
  if (hangs && is_nudged(drags, group, contact))
    return {group, How::held, false, true, "it hangs on to what stays, and is nudged"};
  if (is_one_piece)
    return {group, How::one_piece, scales, grows_out,
            hangs     ? "it hangs on to what stays by little, and is more than nudged (attach \"held\" keeps it)"
            : touches ? "it only stands next to what stays"
                      : "it touches nothing that stays"};
  if (places.anchors > 0) return {group, How::free, false, grows_out, "its anchors hold it"};
  if (touches) return {group, How::held, false, grows_out, "its handles bend it, and it stands on what stays"};
  return {group, How::free, false, grows_out, "its handles bend it, and it touches nothing that stays"};
}

}  // namespace engine::deform
