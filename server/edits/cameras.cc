#include "server/edits/cameras.h"

#include <numbers>
#include <utility>
#include <variant>

#include "server/edits/points.h"

namespace server::edits {
namespace {

using engine::DVec3;
using engine::scene::Camera;

Camera to_camera(const proto::PinholeCamera& given) {
  Camera camera;
  camera.width = given.width, camera.height = given.height;
  camera.fx = given.fx, camera.fy = given.fy, camera.cx = given.cx, camera.cy = given.cy;
  for (int row = 0; row < 3; ++row) {
    const auto& values = given.cam_from_world[std::size_t(row)];
    for (int column = 0; column < 3; ++column) camera.rotation[column][row] = values[std::size_t(column)];
    camera.translation[row] = values[3];
  }
  return camera;
}

engine::Result<Camera> to_camera(const proto::LookAtCamera& given, DVec3 scene_up, const std::string& where) {
  const DVec3 up = glm::normalize(given.up ? to_vec(*given.up) : scene_up);
  const Camera camera = engine::scene::look_at(to_vec(given.eye), to_vec(given.target), up,
                                               given.fov_y_deg * std::numbers::pi / 180, given.width, given.height);
  if (!engine::scene::validate(camera))
    return engine::fail(engine::ErrorCode::invalid_argument,
                        "the camera has no direction: eye and target are one point, or as good as one",
                        where + "target");
  return camera;
}

}  // namespace

engine::Result<Camera> to_camera(const proto::Camera& given, DVec3 scene_up, const std::string& where) {
  if (const auto* pinhole = std::get_if<proto::PinholeCamera>(&given)) return to_camera(*pinhole);
  return to_camera(std::get<proto::LookAtCamera>(given), scene_up, where);
}

proto::PinholeCamera to_proto(const Camera& camera) {
  proto::PinholeCamera out{camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, {}};
  for (int row = 0; row < 3; ++row) {
    auto& values = out.cam_from_world[std::size_t(row)];
    for (int column = 0; column < 3; ++column) values[std::size_t(column)] = camera.rotation[column][row];
    values[3] = camera.translation[row];
  }
  return out;
}

engine::Error no_such_view(const std::vector<std::string>& some, std::size_t count, std::string where) {
  std::string names;
  for (const std::string& name : some) names += (names.empty() ? "" : ", ") + name;
  return {engine::ErrorCode::not_found,
          "the scene has no such view; its " + std::to_string(count) + " views begin with " + names, std::move(where)};
}

}  // namespace server::edits
