#include "engine/select/operation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

namespace engine::select {
namespace {

std::string indexed(const char* list, std::size_t i) { return std::string(list) + "[" + std::to_string(i) + "]"; }

bool is_world(double value) { return std::isfinite(value) && std::abs(value) <= max_world_number; }
bool is_world(DVec3 point) { return is_world(point.x) && is_world(point.y) && is_world(point.z); }

/// Checks operations one after the other and counts what they ask for in all.
class Check {
 public:
  explicit Check(std::size_t rows) : rows_(rows) {}

  Result<void> operation(const Operation& operation, std::size_t number) {
    where_ = address(number);
    const bool changes =
        std::holds_alternative<Expand>(operation.action) || std::holds_alternative<Shrink>(operation.action) ||
        std::holds_alternative<Largest>(operation.action) || std::holds_alternative<Invert>(operation.action);
    if (operation.op != Op::add && operation.op != Op::subtract && operation.op != Op::intersect)
      return bad("op", "expected add, subtract or intersect");
    if (changes && operation.op != Op::add)
      return bad("op", std::string(name_of(operation.action)) + " changes what is selected and takes no op but add");
    name_ = name_of(operation.action);
    const bool searches = std::holds_alternative<Grow>(operation.action) ||
                          std::holds_alternative<Masks>(operation.action) ||
                          (changes && !std::holds_alternative<Invert>(operation.action));
    if (auto fits = count("", searches, searches_, max_searches, "operations that look for neighbours"); !fits)
      return fits;
    return std::visit([&](const auto& action) { return check(action); }, operation.action);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(const std::string& member, std::string message,
                                          ErrorCode code = ErrorCode::invalid_argument) const {
    return fail(code, std::move(message), where_ + (member.empty() || member.front() == '[' ? "" : ".") + member);
  }
  [[nodiscard]] std::string of(const std::string& member) const {
    return member.empty() || member.front() == '[' ? name_ + member : name_ + "." + member;
  }
  [[nodiscard]] Result<void> length(const std::string& member, double value, const char* unit) const {
    if (is_world(value) && value > 0) return {};
    return bad(of(member), std::string("expected a number of ") + unit + " above 0, at most 1e38");
  }
  [[nodiscard]] Result<void> world(const std::string& member, DVec3 value) const {
    if (is_world(value)) return {};
    return bad(of(member), "expected three finite numbers of at most 1e38");
  }
  /// Counts towards a limit.
  [[nodiscard]] Result<void> count(const std::string& member, std::size_t more, std::size_t& so_far, std::size_t limit,
                                   const char* things) const {
    so_far += more;
    if (so_far <= limit) return {};
    return bad(of(member), "a selection takes at most " + std::to_string(limit) + " " + things + " in all",
               ErrorCode::too_large);
  }

  [[nodiscard]] Result<void> camera(const std::string& member, const scene::Camera& camera, bool is_rendered) {
    if (const auto valid = scene::validate(camera); !valid)
      return bad(of(member) + "." + valid.error().where, valid.error().message);
    if (!is_rendered) return {};
    if (std::size_t(camera.width) * std::size_t(camera.height) > max_pixels)
      return bad(of(member) + ".width",
                 "expected a picture of at most " + std::to_string(max_pixels) + " pixels: scale the view down",
                 ErrorCode::too_large);
    return count(member, 1, views_, max_views, "views that are rendered");
  }

  [[nodiscard]] Result<void> pixels(std::span<const DVec2> points, std::size_t least) {
    if (points.size() < least)
      return bad(of("points"),
                 "expected " + std::to_string(least) + " points or more, found " + std::to_string(points.size()));
    if (auto fits = count("points", points.size(), points_, max_points, "points"); !fits) return fits;
    for (std::size_t i = 0; i < points.size(); ++i)
      for (const double value : {points[i].x, points[i].y})
        if (!std::isfinite(value) || std::abs(value) > max_pixel_position)
          return bad(of(indexed("points", i)), "expected two numbers of pixels of at most 1e6");
    return {};
  }
  [[nodiscard]] Result<void> depth(Depth depth) const {
    if (depth == Depth::visible || depth == Depth::through) return {};
    return bad(of("depth"), "expected visible or through");
  }

  Result<void> check(const Sphere& sphere) {
    if (auto fine = world("center", sphere.center); !fine) return fine;
    return length("radius", sphere.radius, "world units");
  }
  Result<void> check(const Box& box) {
    if (auto fine = world("center", box.center); !fine) return fine;
    for (int axis = 0; axis < 3; ++axis)
      if (auto fine = length(indexed("size", std::size_t(axis)), box.size[axis], "world units"); !fine) return fine;
    double largest = 0;
    for (const double value : {box.rotation.w, box.rotation.x, box.rotation.y, box.rotation.z}) {
      if (!is_world(value)) return bad(of("rotation"), "expected four finite numbers of at most 1e38");
      largest = std::max(largest, std::abs(value));
    }
    if (!(largest > 1e-30)) return bad(of("rotation"), "expected a quaternion that is not zero");
    return {};
  }
  Result<void> check(const Plane& plane) {
    if (auto fine = world("point", plane.point); !fine) return fine;
    if (auto fine = world("normal", plane.normal); !fine) return fine;
    if (!(std::max({std::abs(plane.normal.x), std::abs(plane.normal.y), std::abs(plane.normal.z)}) > 1e-30))
      return bad(of("normal"), "expected a direction that is not zero");
    return {};
  }
  Result<void> check(const Polygon& polygon) {
    if (auto fine = depth(polygon.depth); !fine) return fine;
    if (auto fine = camera("camera", polygon.camera, polygon.depth == Depth::visible); !fine) return fine;
    return pixels(polygon.points, 3);
  }
  Result<void> check(const Stroke& stroke) {
    if (auto fine = depth(stroke.depth); !fine) return fine;
    if (auto fine = camera("camera", stroke.camera, stroke.depth == Depth::visible); !fine) return fine;
    if (auto fine = pixels(stroke.points, 1); !fine) return fine;
    if (std::isfinite(stroke.radius) && stroke.radius > 0 && stroke.radius <= max_pixel_position) return {};
    return bad(of("radius"), "expected a number of pixels above 0, at most 1e6");
  }
  Result<void> check(const Grow& grow) {
    if (grow.inside.empty()) return bad(of("inside"), "expected one point or more on the thing that is meant");
    for (const auto& [member, points] : {std::pair{"inside", &grow.inside}, {"outside", &grow.outside}}) {
      if (auto fits = count(member, points->size(), points_, max_points, "points"); !fits) return fits;
      for (std::size_t i = 0; i < points->size(); ++i)
        if (auto fine = world(indexed(member, i), (*points)[i]); !fine) return fine;
    }
    for (std::size_t i = 0; i < grow.outside.size(); ++i)
      if (std::find(grow.inside.begin(), grow.inside.end(), grow.outside[i]) != grow.inside.end())
        return bad(of(indexed("outside", i)), "the same point is among the inside ones");
    if (grow.wider < -max_wider || grow.wider > max_wider)
      return bad(of("wider"), "expected a number of borders from -" + std::to_string(max_wider) + " to " +
                                  std::to_string(max_wider));
    // Without `whole`, less of the scene is looked at, and has other borders: there is nothing to count from.
    if (grow.wider != 0 && !grow.whole)
      return bad(of("wider"), "expected `whole` with it: borders are counted from that of the whole");
    return grow.reach ? length("reach", *grow.reach, "world units") : Result<void>{};
  }
  Result<void> check(const Masks& masks) {
    if (masks.views.empty()) return bad(of(""), "expected one mask or more");
    for (std::size_t i = 0; i < masks.views.size(); ++i) {
      const auto& [view, image] = masks.views[i];
      const std::string member = "[" + std::to_string(i) + "]";
      if (auto fine = camera(member + ".camera", view, true); !fine) return fine;
      if (image.width != view.width || image.height != view.height ||
          image.data.size() != std::size_t(view.width) * std::size_t(view.height))
        return bad(of(member + ".image"), "expected the camera's " + std::to_string(view.width) + " x " +
                                              std::to_string(view.height) + " pixels, found " +
                                              std::to_string(image.width) + " x " + std::to_string(image.height));
    }
    return {};
  }
  Result<void> check(const Rows& rows) {
    if (rows.ranges.empty()) return bad(of(""), "expected one range of rows or more");
    if (auto fits = count("", rows.ranges.size(), ranges_, max_ranges, "ranges of rows"); !fits) return fits;
    for (std::size_t i = 0; i < rows.ranges.size(); ++i) {
      const auto [from, to] = rows.ranges[i];
      const std::string found = "[" + std::to_string(from) + ", " + std::to_string(to) + ")";
      if (from >= to) return bad(of(indexed("", i)), "expected a range that begins before it ends, found " + found);
      if (to > rows_)
        return bad(of(indexed("", i)), "the scene has " + std::to_string(rows_) + " rows, found " + found,
                   ErrorCode::unprocessable);
    }
    return {};
  }
  Result<void> check(const Expand& expand) { return length("", expand.distance, "world units"); }
  Result<void> check(const Shrink& shrink) { return length("", shrink.distance, "world units"); }
  Result<void> check(const Largest& largest) {
    if (largest.n > 0) return {};
    return bad(of(""), "expected one piece or more");
  }
  Result<void> check(const Invert&) { return {}; }

  std::size_t rows_;
  std::size_t points_ = 0, views_ = 0, searches_ = 0, ranges_ = 0;
  std::string where_, name_;
};

}  // namespace

const char* name_of(const Action& action) {
  constexpr std::array names{"sphere", "box",  "plane",  "polygon", "stroke",  "grow",
                             "masks",  "rows", "expand", "shrink",  "largest", "invert"};
  static_assert(names.size() == std::variant_size_v<Action>);
  return names[action.index()];
}

std::string address(std::size_t operation) { return indexed("selection", operation); }

Result<void> validate(const Selection& selection, std::size_t rows) {
  if (selection.size() > max_operations)
    return fail(ErrorCode::too_large,
                "a selection takes at most " + std::to_string(max_operations) + " operations, found " +
                    std::to_string(selection.size()),
                "selection");
  Check check(rows);
  for (std::size_t i = 0; i < selection.size(); ++i)
    if (auto fine = check.operation(selection[i], i); !fine) return fine;
  return {};
}

}  // namespace engine::select
