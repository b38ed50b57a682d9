// Cameras, render and pick requests: what they accept, and the address of everything they refuse.
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "proto/pick.h"
#include "proto/render_request.h"

namespace proto {
namespace {

using engine::ErrorCode;

const std::string pose = "[[1,0,0,1],[0,1,0,2],[0,0,1,3]]";
const std::string pinhole = R"({"width":64,"height":48,"fx":50,"fy":51,"cx":32,"cy":24,"cam_from_world":)" + pose + "}";
const std::string look_at = R"({"eye":[0,0,-4],"target":[0,0,0],"width":64,"height":48})";

std::string render_with(const std::string& camera) { return R"({"camera":)" + camera + "}"; }

std::string refused_at(const std::string& text) {
  const auto request = parse_render_request(text);
  if (request) return "accepted";
  EXPECT_EQ(request.error().code, ErrorCode::invalid_argument) << text;
  EXPECT_FALSE(request.error().message.empty());
  return request.error().where;
}

std::string pick_refused_at(const std::string& text) {
  const auto request = parse_pick_request(text);
  if (request) return "accepted";
  EXPECT_EQ(request.error().code, ErrorCode::invalid_argument) << text;
  return request.error().where;
}

std::string query_refused_at(const std::map<std::string, std::string>& query) {
  const auto request = parse_render_query([&](std::string_view name) -> std::optional<std::string> {
    const auto found = query.find(std::string(name));
    return found == query.end() ? std::nullopt : std::optional(found->second);
  });
  return request ? "accepted" : request.error().where;
}

/// The text with the first `from` replaced.
std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(RenderRequest, ReadsAPinholeCamera) {
  const auto request = parse_render_request(render_with(pinhole));
  ASSERT_TRUE(request) << request.error().message;
  const auto& camera = std::get<PinholeCamera>(std::get<Camera>(request->viewpoint));
  EXPECT_EQ(camera, (PinholeCamera{64, 48, 50, 51, 32, 24, {{{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}}));
  EXPECT_EQ(request->content, PictureContent::color);
  EXPECT_FALSE(request->format);
  EXPECT_EQ(request->quality, 90);
}

TEST(RenderRequest, ReadsACameraThatLooksAtAPoint) {
  const auto request = parse_render_request(
      R"({"camera":{"eye":[1,2,3],"target":[0,0,0],"up":[0,0,1],"fov_y_deg":40,"width":8,"height":9},)"
      R"("what":"depth","format":"exr","max_side":100,"background":[0,0.5,1],"sh_degree":0,"quality":1})");
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(std::get<LookAtCamera>(std::get<Camera>(request->viewpoint)),
            (LookAtCamera{{1, 2, 3}, {0, 0, 0}, Point{0, 0, 1}, 40, 8, 9}));
  EXPECT_EQ(request->content, PictureContent::depth);
  EXPECT_EQ(request->format, PictureFormat::exr);
  EXPECT_EQ(request->max_side, 100);
  EXPECT_EQ(request->background, (Point{0, 0.5, 1}));
  EXPECT_EQ(request->sh_degree, 0);
}

TEST(RenderRequest, WantsExactlyOneOfCameraAndView) {
  EXPECT_TRUE(parse_render_request(R"({"view":"0001.jpg"})"));
  EXPECT_EQ(refused_at("{}"), "");
  EXPECT_EQ(refused_at(R"({"view":"a","camera":)" + look_at + "}"), "");
}

TEST(RenderRequest, NamesEveryWrongFieldOfAPinholeCamera) {
  for (const char* name : {"width", "height", "fx", "fy", "cx", "cy", "cam_from_world"}) {
    const std::string where = std::string("camera.") + name, quoted = '"' + std::string(name) + "\":";
    EXPECT_EQ(refused_at(render_with(with(pinhole, quoted, quoted + "null,\"" + name + "x\":"))), where + "x");
    EXPECT_EQ(refused_at(render_with(with(pinhole, quoted, "\"other\":"))), "camera.other");
  }
  EXPECT_EQ(refused_at(render_with(R"({"width":64,"height":48,"fx":50,"fy":51,"cx":32,"cy":24})")),
            "camera.cam_from_world");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"width\":64", "\"width\":0"))), "camera.width");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"height\":48", "\"height\":16385"))), "camera.height");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"fx\":50", "\"fx\":0"))), "camera.fx");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"fx\":50", "\"fx\":1e-300"))), "camera.fx");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"fy\":51", "\"fy\":-1"))), "camera.fy");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"fy\":51", "\"fy\":0.0009"))), "camera.fy");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"fy\":51", "\"fy\":0.001"))), "accepted");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"cx\":32", "\"cx\":\"32\""))), "camera.cx");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"cy\":24", "\"cy\":1e400"))), "camera.cy");
  EXPECT_EQ(refused_at(render_with(with(pinhole, "\"cx\":32", "\"cx\":32,\"cx\":32"))), "camera.cx");
}

TEST(RenderRequest, WantsARotationInThePose) {
  const auto at = [&](const std::string& other) { return refused_at(render_with(with(pinhole, pose, other))); };
  EXPECT_EQ(at("[[2,0,0,1],[0,2,0,2],[0,0,2,3]]"), "camera.cam_from_world") << "a scale";
  EXPECT_EQ(at("[[1,0,0,1],[0,1,0,2],[0,0,-1,3]]"), "camera.cam_from_world") << "a mirror";
  EXPECT_EQ(at("[[1,0.5,0,1],[0,1,0,2],[0,0,1,3]]"), "camera.cam_from_world") << "a shear";
  EXPECT_EQ(at("[[0,0,0,0],[0,0,0,0],[0,0,0,0]]"), "camera.cam_from_world");
  EXPECT_EQ(at("[[1,0,0,1],[0,1,0,2]]"), "camera.cam_from_world");
  EXPECT_EQ(at("[[1,0,0,1],[0,1,0],[0,0,1,3]]"), "camera.cam_from_world[1]");
  EXPECT_EQ(at("[[1,0,0,1],[0,1,0,2],[0,0,1,null]]"), "camera.cam_from_world[2][3]");
  EXPECT_EQ(at("[[0.8,0.6,0,1],[-0.6,0.8,0,2],[0,0,1,3]]"), "accepted");
}

TEST(RenderRequest, NamesEveryWrongFieldOfALookAtCamera) {
  const auto at = [&](const std::string& from, const std::string& to) {
    return refused_at(render_with(with(look_at, from, to)));
  };
  EXPECT_EQ(at("\"eye\":[0,0,-4]", "\"eye\":[0,0]"), "camera.eye");
  EXPECT_EQ(at("\"eye\":[0,0,-4],", ""), "camera.eye");
  EXPECT_EQ(at("\"target\":[0,0,0]", "\"target\":[0,0,1e13]"), "camera.target[2]");
  EXPECT_EQ(at("\"target\":[0,0,0]", "\"up\":[0,0,1]"), "camera.target");
  EXPECT_EQ(at("\"width\"", "\"up\":[0,0,0],\"width\""), "camera.up");
  EXPECT_EQ(at("\"width\"", "\"up\":[1e-200,0,0],\"width\""), "camera.up");
  EXPECT_EQ(at("\"width\"", "\"up\":[0,1e-12,0],\"width\""), "accepted");
  EXPECT_EQ(at("\"width\"", "\"up\":[1e12,1e12,1e12],\"width\""), "accepted");
  EXPECT_EQ(at("\"width\"", "\"fov_y_deg\":180,\"width\""), "camera.fov_y_deg");
  EXPECT_EQ(at("\"width\"", "\"fov_y_deg\":0,\"width\""), "camera.fov_y_deg");
  EXPECT_EQ(at("\"width\"", "\"fx\":10,\"width\""), "camera.fx");
  EXPECT_EQ(at("\"width\":64", "\"width\":1.5"), "camera.width");
  EXPECT_EQ(at("\"height\":48", "\"height\":-1"), "camera.height");
  EXPECT_EQ(refused_at(R"({"camera":[1]})"), "camera");
}

TEST(RenderRequest, NamesEveryWrongOption) {
  const auto at = [&](const std::string& option) { return refused_at(R"({"view":"a",)" + option + "}"); };
  EXPECT_EQ(at(R"("what":"normals")"), "what");
  EXPECT_EQ(at(R"("format":"bmp")"), "format");
  EXPECT_EQ(at(R"("max_side":0)"), "max_side");
  EXPECT_EQ(at(R"("background":[0,0,2])"), "background[2]");
  EXPECT_EQ(at(R"("background":1)"), "background");
  EXPECT_EQ(at(R"("sh_degree":4)"), "sh_degree");
  EXPECT_EQ(at(R"("quality":101)"), "quality");
  EXPECT_EQ(at(R"("colour":1)"), "colour");
  EXPECT_EQ(refused_at(R"({"view":7})"), "view");
  EXPECT_EQ(refused_at("[]"), "");
  EXPECT_EQ(refused_at("{"), "line 1, column 1");
}

TEST(RenderQuery, SaysTheSameAsTheBody) {
  const std::map<std::string, std::string> query{{"eye", "0,-1.5,-4e0"}, {"target", "0,0,0"},       {"up", "0,0,1"},
                                                 {"fov", "40"},          {"width", "64"},           {"height", "48"},
                                                 {"what", "alpha"},      {"background", "0,0.5,1"}, {"format", "png"},
                                                 {"max_side", "32"},     {"sh_degree", "1"},        {"quality", "50"}};
  const auto request = parse_render_query([&](std::string_view name) -> std::optional<std::string> {
    const auto found = query.find(std::string(name));
    return found == query.end() ? std::nullopt : std::optional(found->second);
  });
  ASSERT_TRUE(request) << request.error().message << request.error().where;
  const auto body = parse_render_request(
      R"({"camera":{"eye":[0,-1.5,-4],"target":[0,0,0],"up":[0,0,1],"fov_y_deg":40,"width":64,"height":48},)"
      R"("what":"alpha","background":[0,0.5,1],"format":"png","max_side":32,"sh_degree":1,"quality":50})");
  ASSERT_TRUE(body);
  EXPECT_EQ(*request, *body);
}

TEST(RenderQuery, NamesEveryWrongParameter) {
  const std::map<std::string, std::string> good{
      {"eye", "0,0,-4"}, {"target", "0,0,0"}, {"width", "64"}, {"height", "48"}};
  const auto at = [&](const std::string& name, const std::string& value) {
    auto query = good;
    query[name] = value;
    return query_refused_at(query);
  };
  EXPECT_EQ(query_refused_at(good), "accepted");
  EXPECT_EQ(query_refused_at({{"view", "0001.jpg"}}), "accepted");
  EXPECT_EQ(query_refused_at({}), "eye");
  EXPECT_EQ(at("view", "a"), "eye");
  EXPECT_EQ(at("eye", "0,0"), "eye");
  EXPECT_EQ(at("eye", "0,0,x"), "eye[2]");
  EXPECT_EQ(at("eye", "0,0,nan"), "eye[2]");
  EXPECT_EQ(at("eye", "0,0,inf"), "eye[2]");
  EXPECT_EQ(at("eye", "0,0, 1"), "eye[2]");
  EXPECT_EQ(at("eye", "0,0,1,"), "eye");
  EXPECT_EQ(at("target", ""), "target");
  EXPECT_EQ(at("up", "0,0,0"), "up");
  EXPECT_EQ(at("fov", "180"), "fov");
  EXPECT_EQ(at("fov", "wide"), "fov");
  EXPECT_EQ(at("width", "64.5"), "width");
  EXPECT_EQ(at("width", ""), "width");
  EXPECT_EQ(at("height", "0x30"), "height");
  EXPECT_EQ(at("height", "99999999999999999999"), "height");
  EXPECT_EQ(at("what", "colour"), "what");
  EXPECT_EQ(at("format", "jpg"), "format");
  EXPECT_EQ(at("max_side", "-1"), "max_side");
  EXPECT_EQ(at("background", "1,1,1.5"), "background[2]");
  EXPECT_EQ(at("sh_degree", "4"), "sh_degree");
  EXPECT_EQ(at("quality", "0"), "quality");
}

TEST(PickRequest, ReadsAPixelAndASphere) {
  const auto pixel = parse_pick_request(R"({"view":"a","x":10.5,"y":20.5,"radius":0.2})");
  ASSERT_TRUE(pixel);
  EXPECT_EQ(std::get<std::string>(*pixel->viewpoint), "a");
  EXPECT_EQ(pixel->x, 10.5);
  EXPECT_EQ(pixel->radius, 0.2);
  const auto sphere = parse_pick_request(R"({"point":[1,2,3],"radius":0.2})");
  ASSERT_TRUE(sphere);
  EXPECT_EQ(sphere->point, (Point{1, 2, 3}));
  EXPECT_FALSE(sphere->viewpoint);
}

TEST(PickRequest, NamesEveryWrongField) {
  EXPECT_EQ(pick_refused_at("{}"), "");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","y":1})"), "x");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":1})"), "y");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":-1,"y":1})"), "x");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":1,"y":"1"})"), "y");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":1,"y":1,"radius":0})"), "radius");
  EXPECT_EQ(pick_refused_at(R"({"x":1,"y":1})"), "");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":1,"y":1,"z":1})"), "z");
  EXPECT_EQ(pick_refused_at(R"({"view":"a","x":1,"y":1,"camera":)" + look_at + "}"), "");
  EXPECT_EQ(pick_refused_at(R"({"x":1,"y":1,"camera":)" + with(pinhole, "\"fx\":50", "\"fx\":0") + "}"), "camera.fx");
  EXPECT_EQ(pick_refused_at(R"({"point":[1,2,3]})"), "radius");
  EXPECT_EQ(pick_refused_at(R"({"point":[1,2],"radius":1})"), "point");
  EXPECT_EQ(pick_refused_at(R"({"point":[1,2,3],"radius":1,"x":2})"), "x");
}

TEST(PickResult, WritesAMissWithEveryField) {
  const auto out = nlohmann::json::parse(to_json(PickResult{}));
  EXPECT_EQ(out, nlohmann::json::parse(R"({"hit": false, "point": null, "depth": null, "normal": null,
    "gaussian": null, "gaussians_in_radius": null})"));
}

}  // namespace
}  // namespace proto
