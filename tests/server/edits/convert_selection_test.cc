#include "server/edits/convert_selection.h"

#include <gtest/gtest.h>

#include <span>

#include "engine/io/image_file.h"
#include "server/edits/cameras.h"
#include "tests/engine/jobs/jobs_support.h"

namespace server::edits {
namespace {

namespace scene = engine::scene;
namespace select = engine::select;
namespace on_wire = proto::selection;
using engine::DVec3;
using engine::ErrorCode;
using engine::jobs::value;

scene::Camera front(const std::string& name, int width = 8, int height = 6) {
  scene::Camera camera = scene::look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, width, height);
  camera.name = name;
  return camera;
}

template <class T>
void expect_refused(const engine::Result<T>& result, ErrorCode code, const std::string& where) {
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, code) << result.error().message;
  EXPECT_EQ(result.error().where, where) << result.error().message;
}

/// A grey PNG; each pixel's value, 0 to 255, by its number.
template <class Value>
std::string grey_png(int width, int height, Value value_of) {
  scene::Image image(width, height, 1);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(value_of(int(i))) / 255;
  const auto bytes = value(engine::io::encode_image(image, engine::io::ImageFormat::png));
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

proto::Selection masked(const std::string& image, const proto::Viewpoint& viewpoint) {
  return {{.action = on_wire::Masks{{{viewpoint, image}}}}};
}

TEST(WithCameras, PutsTheCameraInPlaceOfAViewsName) {
  const std::vector<scene::Camera> views{front("a.png"), front("b.png", 12, 9)};
  const proto::Selection asked{{.action = on_wire::Stroke{"b.png", {{1, 2}}, 3}},
                               {.op = on_wire::Op::subtract, .action = on_wire::Sphere{{0, 0, 0}, 1}}};
  const auto resolved = value(with_cameras(asked, {.views = views}));
  EXPECT_EQ(std::get<on_wire::Stroke>(resolved[0].action).viewpoint,
            proto::Viewpoint(proto::Camera(to_proto(views[1]))));
  EXPECT_EQ(resolved[1], asked[1]);
  EXPECT_EQ(value(with_cameras(resolved, {})), resolved) << "then it refers to nothing";
}

TEST(WithCameras, TurnsACameraThatLooksAtAPointByTheScenesUp) {
  const proto::Selection asked{
      {.action = on_wire::Polygon{proto::Camera(proto::LookAtCamera{{0, 0, -4}, {0, 0, 0}, {}, 50, 8, 6}),
                                  {{0, 0}, {8, 0}, {0, 6}}}}};
  const auto down = value(with_cameras(asked, {})), up = value(with_cameras(asked, {.views = {}, .up = {0, 1, 0}}));
  EXPECT_NE(down, up);
  const auto selection = value(to_engine(up));
  EXPECT_EQ(std::get<select::Polygon>(selection[0].action).camera.rotation,
            scene::look_at({0, 0, -4}, {0, 0, 0}, {0, 1, 0}, 1, 8, 6).rotation);
}

TEST(WithCameras, NamesTheViewThatIsNotThere) {
  const std::vector<scene::Camera> views{front("a.png")};
  const proto::Selection asked{{.action = on_wire::Invert{}}, {.action = on_wire::Stroke{"c.png", {{1, 2}}, 3}}};
  const auto unknown = with_cameras(asked, {.views = views});
  expect_refused(unknown, ErrorCode::not_found, "selection[1].stroke.view");
  EXPECT_NE(unknown.error().message.find("a.png"), std::string::npos);
  const auto without = with_cameras(asked, {});
  expect_refused(without, ErrorCode::not_found, "selection[1].stroke.view");
  EXPECT_NE(without.error().message.find("camera"), std::string::npos) << "says what to do";
  expect_refused(with_cameras(masked("x", "c.png"), {.views = views}), ErrorCode::not_found,
                 "selection[0].masks[0].view");
  expect_refused(
      with_cameras(
          {{.action =
                on_wire::Stroke{proto::Camera(proto::LookAtCamera{{1, 1, 1}, {1, 1, 1}, {}, 50, 8, 6}), {{1, 2}}, 3}}},
          {}),
      ErrorCode::invalid_argument, "selection[0].stroke.camera.target");
}

TEST(SelectionToEngine, CarriesEveryAction) {
  const proto::Selection asked{
      {.action = on_wire::Sphere{{1, 2, 3}, 4}},
      {.op = on_wire::Op::subtract, .action = on_wire::Box{{1, 2, 3}, {4, 5, 6}, {0.5, 0.5, -0.5, 0.5}}},
      {.op = on_wire::Op::intersect, .action = on_wire::Plane{{1, 2, 3}, {0, 0, 1}}},
      {.action = on_wire::Grow{{{1, 1, 1}}, {{2, 2, 2}}, 7, true, -3}},
      {.action = on_wire::Rows{{{2, 5}}}},
      {.action = on_wire::Expand{0.5}},
      {.action = on_wire::Shrink{0.25}},
      {.action = on_wire::Largest{3}},
      {.action = on_wire::Invert{}}};
  const auto selection = value(to_engine(asked));
  ASSERT_EQ(selection.size(), asked.size());
  EXPECT_EQ(selection[0].op, select::Op::add);
  EXPECT_EQ(selection[1].op, select::Op::subtract);
  EXPECT_EQ(selection[2].op, select::Op::intersect);
  for (std::size_t i = 0; i < asked.size(); ++i)
    EXPECT_EQ(select::name_of(selection[i].action), on_wire::name_of(asked[i].action)) << i;
  EXPECT_EQ(std::get<select::Sphere>(selection[0].action).center, DVec3(1, 2, 3));
  EXPECT_EQ(std::get<select::Sphere>(selection[0].action).radius, 4);
  EXPECT_EQ(std::get<select::Box>(selection[1].action).size, DVec3(4, 5, 6));
  EXPECT_EQ(std::get<select::Box>(selection[1].action).rotation, engine::DQuat(0.5, 0.5, -0.5, 0.5));
  EXPECT_EQ(std::get<select::Plane>(selection[2].action).normal, DVec3(0, 0, 1));
  EXPECT_EQ(std::get<select::Grow>(selection[3].action).outside, std::vector<DVec3>{DVec3(2)});
  EXPECT_EQ(std::get<select::Grow>(selection[3].action).reach, 7);
  EXPECT_TRUE(std::get<select::Grow>(selection[3].action).whole);
  EXPECT_EQ(std::get<select::Grow>(selection[3].action).wider, -3);
  EXPECT_EQ(std::get<select::Rows>(selection[4].action).ranges[0].to, 5u);
  EXPECT_EQ(std::get<select::Expand>(selection[5].action).distance, 0.5);
  EXPECT_EQ(std::get<select::Shrink>(selection[6].action).distance, 0.25);
  EXPECT_EQ(std::get<select::Largest>(selection[7].action).n, 3u);
}

TEST(SelectionToEngine, CountsWhatIsHalfOfWhiteAsInsideAMask) {
  const std::vector<scene::Camera> views{front("a.png", 4, 2)};
  const std::string image =
      grey_png(4, 2, [](int i) { return std::array{0, 127, 128, 255, 64, 200, 126, 129}[std::size_t(i)]; });
  const auto selection = value(to_engine(value(with_cameras(masked(image, "a.png"), {.views = views}))));
  const auto& mask = std::get<select::Masks>(selection[0].action).views.at(0).image;
  EXPECT_EQ(mask.data, (std::vector<std::uint8_t>{0, 0, 1, 1, 0, 1, 0, 1}));
}

TEST(SelectionToEngine, RefusesAMaskThatIsNone) {
  const std::vector<scene::Camera> views{front("a.png", 4, 2)};
  const auto decoded = [&](const std::string& image) {
    return to_engine(value(with_cameras(masked(image, "a.png"), {.views = views})));
  };
  const auto white = [](int) { return 255; };
  for (const auto& [width, height] : {std::pair{2, 4}, {4, 1}, {5, 2}, {400, 200}})
    expect_refused(decoded(grey_png(width, height, white)), ErrorCode::invalid_argument, "selection[0].masks[0].image");
  expect_refused(decoded("no picture"), ErrorCode::unsupported, "selection[0].masks[0].image");
  expect_refused(decoded(grey_png(4, 2, white).substr(0, 40)), ErrorCode::corrupt_data, "selection[0].masks[0].image");
}

TEST(SelectionToEngine, HoldsOnlySoManyPixelsOfMasks) {
  proto::PinholeCamera camera = to_proto(front("", 16384, 8192));
  const proto::Selection asked{
      {.action = on_wire::Masks{{{proto::Camera(camera), "x"}, {proto::Camera(camera), "x"}}}}};
  expect_refused(to_engine(asked), ErrorCode::unsupported, "selection[0].masks[0].image");
  camera.height = 16384;
  expect_refused(to_engine(masked("x", proto::Camera(camera))), ErrorCode::too_large, "selection[0].masks[0].image");
}

/// Five rows in a line, of which the middle three are selected.
select::Selected three_in_a_line() {
  return {.rows = {0, 1, 1, 1, 0},
          .count = 3,
          .bounds = {{1, 0, 0}, {3, 0.5f, 0}},
          .centre = {2, 0, 0},
          .border = {},
          .warnings = {}};
}

TEST(HandOver, SaysTheRowsAndHowFarHandlesGrip) {
  engine::edit::Request request;
  request.handles = {{.source = {1, 0, 0}, .target = DVec3(1, 1, 0), .radius = 0},
                     {.source = {3, 0, 0}, .target = {}, .radius = 0.25}};
  EXPECT_TRUE(hand_over(three_in_a_line(), {}, nullptr, request).empty());
  EXPECT_EQ(request.selected, (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(request.handles[0].radius, 1) << "half of the longest edge";
  EXPECT_EQ(request.handles[1].radius, 0.25) << "as it was given";
}

TEST(HandOver, LetsAHandleOfASingleGaussianGoInOneStep) {
  select::Selected one{.rows = {1}, .count = 1, .bounds = {}, .centre = {}, .border = {}, .warnings = {}};
  engine::edit::Request request;
  request.handles = {{.source = {0, 0, 0}, .target = DVec3(0, 3, 0), .radius = 0}};
  (void)hand_over(one, {}, nullptr, request);
  EXPECT_EQ(request.handles[0].radius, 3);
  request.handles = {{.source = {0, 0, 0}, .target = {}, .radius = 0}};
  (void)hand_over(one, {}, nullptr, request);
  EXPECT_GT(request.handles[0].radius, 0);
}

TEST(HandOver, WarnsOfASelectionThatTakesWhatAHandlesViewShows) {
  scene::Camera aside = front("aside");
  aside.cx = 7;
  const std::vector<scene::Camera> cameras{aside, front("middle"),
                                           scene::look_at({0, 0, -4}, {0, 0, -8}, {0, -1, 0}, 0.8, 8, 6)};
  engine::edit::Request request;
  request.handles = {{.source = {0, 0, 0}, .target = DVec3(1, 0, 0), .radius = 1},
                     {.source = {0.01, 0, 0}, .target = DVec3(1, 0, 0), .radius = 1}};
  const auto warnings = [&](double share) {
    return hand_over(
        three_in_a_line(), cameras,
        [&](const std::vector<scene::Camera>& views) {
          EXPECT_EQ(views.size(), 1u) << "both handles are seen best in one";
          EXPECT_EQ(views.at(0).name, "middle");
          return std::vector<double>{share};
        },
        request);
  };
  EXPECT_TRUE(warnings(0.9).empty());
  ASSERT_EQ(warnings(0.95).size(), 1u);
  EXPECT_NE(warnings(0.95)[0].find("95 % of what is seen around handle 1"), std::string::npos) << warnings(0.95)[0];
}

}  // namespace
}  // namespace server::edits
