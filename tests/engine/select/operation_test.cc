#include "engine/select/operation.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();

/// "code where" of the refusal; "fine" if there is none. The operation stands behind a valid one.
std::string refusal(const Operation& operation, std::size_t rows = 10) {
  const auto valid = validate({{Op::add, Sphere{{0, 0, 0}, 1}}, operation}, rows);
  if (valid) return "fine";
  EXPECT_FALSE(valid.error().message.empty());
  const char* code = valid.error().code == ErrorCode::invalid_argument ? "invalid"
                     : valid.error().code == ErrorCode::too_large      ? "too large"
                     : valid.error().code == ErrorCode::unprocessable  ? "unprocessable"
                                                                       : "other";
  return code + (" " + valid.error().where);
}
std::string refusal(const Action& action, std::size_t rows = 10) { return refusal(Operation{Op::add, action}, rows); }

const std::vector<DVec2> triangle{{1, 1}, {9, 1}, {5, 9}};

TEST(ValidateSelection, AcceptsOneOfEach) {
  const scene::Camera camera = front_camera();
  const Selection selection{{Op::add, Sphere{{1, 2, 3}, 0.5}},
                            {Op::subtract, Box{{0, 0, 0}, {1, 2, 3}, {0.5, 0, 0, 0}}},
                            {Op::intersect, Plane{{0, 0, 0}, {0, 0, -7}}},
                            {Op::add, Polygon{camera, triangle, Depth::visible}},
                            {Op::add, Stroke{camera, {{-50, 3}}, 4, Depth::through}},
                            {Op::add, Grow{{{0, 0, 0}}, {}, {}}},
                            {Op::add, Masks{{{camera, scene::Mask(100, 100)}}}},
                            {Op::add, Rows{{{0, 10}, {3, 4}}}},
                            {Op::add, Expand{0.1}},
                            {Op::add, Shrink{0.1}},
                            {Op::add, Largest{2}},
                            {Op::add, Invert{}}};
  EXPECT_TRUE(validate(selection, 10));
  EXPECT_TRUE(validate({}, 0));
}

TEST(ValidateSelection, NamesWhatIsWrongWithAShape) {
  EXPECT_EQ(refusal(Sphere{{0, nan, 0}, 1}), "invalid selection[1].sphere.center");
  for (const double radius : {0.0, -1.0, nan, inf, 1e39})
    EXPECT_EQ(refusal(Sphere{{0, 0, 0}, radius}), "invalid selection[1].sphere.radius") << radius;
  EXPECT_EQ(refusal(Sphere{{1e30, -1e30, 0}, 1e30}), "fine") << "far away, but a place";
  EXPECT_EQ(refusal(Box{{0, 0, inf}, {1, 1, 1}}), "invalid selection[1].box.center");
  EXPECT_EQ(refusal(Box{{0, 0, 0}, {1, 0, 1}}), "invalid selection[1].box.size[1]");
  EXPECT_EQ(refusal(Box{{0, 0, 0}, {1, 1, 1}, {0, 0, 0, 0}}), "invalid selection[1].box.rotation");
  EXPECT_EQ(refusal(Box{{0, 0, 0}, {1, 1, 1}, {1, 0, nan, 0}}), "invalid selection[1].box.rotation");
  EXPECT_EQ(refusal(Plane{{nan, 0, 0}, {0, 0, 1}}), "invalid selection[1].plane.point");
  EXPECT_EQ(refusal(Plane{{0, 0, 0}, {0, 0, 0}}), "invalid selection[1].plane.normal");
}

TEST(ValidateSelection, NamesWhatIsWrongInAPicture) {
  const scene::Camera camera = front_camera();
  EXPECT_EQ(refusal(Polygon{camera, {{1, 1}, {2, nan}, {3, 3}}}), "invalid selection[1].polygon.points[1]");
  EXPECT_EQ(refusal(Polygon{camera, {{1, 1}, {2, 2}, {1e30, 3}}}), "invalid selection[1].polygon.points[2]");
  EXPECT_EQ(refusal(Polygon{camera, {{1, 1}, {2, 2}}}), "invalid selection[1].polygon.points");
  EXPECT_EQ(refusal(Stroke{camera, {}, 3}), "invalid selection[1].stroke.points");
  for (const double radius : {0.0, -1.0, nan, 1e7})
    EXPECT_EQ(refusal(Stroke{camera, {{1, 1}}, radius}), "invalid selection[1].stroke.radius") << radius;
  scene::Camera broken = camera;
  broken.fx = 0;
  EXPECT_EQ(refusal(Polygon{broken, triangle}), "invalid selection[1].polygon.camera.fx");
  scene::Camera vast = camera;
  vast.width = vast.height = 8192;
  EXPECT_EQ(refusal(Polygon{vast, triangle, Depth::visible}), "too large selection[1].polygon.camera.width");
  EXPECT_EQ(refusal(Polygon{vast, triangle, Depth::through}), "fine") << "nothing is rendered";
  EXPECT_EQ(refusal(Polygon{camera, triangle, Depth(7)}), "invalid selection[1].polygon.depth");
}

TEST(ValidateSelection, NamesWhatIsWrongWithPointsMasksAndRows) {
  const scene::Camera camera = front_camera();
  EXPECT_EQ(refusal(Grow{{}, {{0, 0, 0}}, {}}), "invalid selection[1].grow.inside");
  EXPECT_EQ(refusal(Grow{{{0, 0, 0}, {0, 0, -inf}}, {}, {}}), "invalid selection[1].grow.inside[1]");
  EXPECT_EQ(refusal(Grow{{{0, 0, 0}}, {{1, 0, 0}, {0, 0, 0}}, {}}), "invalid selection[1].grow.outside[1]");
  EXPECT_EQ(refusal(Grow{{{0, 0, 0}}, {}, 0.0}), "invalid selection[1].grow.reach");
  for (const int wider : {65, -65, std::numeric_limits<int>::min()})
    EXPECT_EQ(refusal(Grow{{{0, 0, 0}}, {}, {}, true, wider}), "invalid selection[1].grow.wider") << wider;
  EXPECT_EQ(refusal(Grow{{{0, 0, 0}}, {}, {}, false, 1}), "invalid selection[1].grow.wider") << "no whole";
  EXPECT_EQ(refusal(Masks{}), "invalid selection[1].masks");
  EXPECT_EQ(refusal(Masks{{{camera, scene::Mask(100, 100)}, {camera, scene::Mask(100, 99)}}}),
            "invalid selection[1].masks[1].image");
  scene::Camera broken = camera;
  broken.cy = nan;
  EXPECT_EQ(refusal(Masks{{{broken, scene::Mask(100, 100)}}}), "invalid selection[1].masks[0].camera.cy");
  EXPECT_EQ(refusal(Rows{}), "invalid selection[1].rows");
  EXPECT_EQ(refusal(Rows{{{0, 1}, {5, 4}}}), "invalid selection[1].rows[1]");
  EXPECT_EQ(refusal(Rows{{{4, 4}}}), "invalid selection[1].rows[0]");
  EXPECT_EQ(refusal(Rows{{{9, 11}}}), "unprocessable selection[1].rows[0]");
  EXPECT_EQ(refusal(Rows{{{0, std::numeric_limits<std::uint64_t>::max()}}}), "unprocessable selection[1].rows[0]");
}

TEST(ValidateSelection, NamesWhatIsWrongWithAChange) {
  EXPECT_EQ(refusal(Expand{0}), "invalid selection[1].expand");
  EXPECT_EQ(refusal(Shrink{nan}), "invalid selection[1].shrink");
  EXPECT_EQ(refusal(Largest{0}), "invalid selection[1].largest");
  for (const Action& action : {Action(Expand{1}), Action(Shrink{1}), Action(Largest{1}), Action(Invert{})}) {
    EXPECT_EQ(refusal(Operation{Op::subtract, action}), "invalid selection[1].op") << name_of(action);
    EXPECT_EQ(refusal(Operation{Op::intersect, action}), "invalid selection[1].op") << name_of(action);
  }
  EXPECT_EQ(refusal(Operation{Op(9), Sphere{{0, 0, 0}, 1}}), "invalid selection[1].op");
}

TEST(ValidateSelection, BoundsWhatAListAsksForInAll) {
  const auto where = [](const Selection& selection) {
    const auto valid = validate(selection, 10);
    return valid ? "fine" : valid.error().code == ErrorCode::too_large ? valid.error().where : "other";
  };
  EXPECT_EQ(where(Selection(10'000, {Op::add, Invert{}})), "selection");
  EXPECT_EQ(where(Selection(max_operations, {Op::add, Invert{}})), "fine");
  const Stroke half{front_camera(), std::vector<DVec2>(max_points / 2, {1, 1}), 1, Depth::through};
  EXPECT_EQ(where(Selection(2, {Op::add, half})), "fine");
  EXPECT_EQ(where({{Op::add, half}, {Op::add, half}, {Op::add, Grow{{{0, 0, 0}}, {}, {}}}}),
            "selection[2].grow.inside");
  EXPECT_EQ(where(Selection(max_views + 1, {Op::add, Polygon{front_camera(), triangle, Depth::visible}})),
            "selection[64].polygon.camera");
  EXPECT_EQ(where(Selection(max_searches, {Op::add, Largest{1}})), "fine");
  EXPECT_EQ(where(Selection(max_searches + 1, {Op::add, Largest{1}})), "selection[32].largest");
  EXPECT_EQ(where({{Op::add, Rows{std::vector<RowRange>(max_ranges + 1, {0, 1})}}}), "selection[0].rows");
}

}  // namespace
}  // namespace engine::select
