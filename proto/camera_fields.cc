#include "proto/camera_fields.h"

#include <cmath>

namespace proto {
namespace {

constexpr double min_focal_length = 1e-3;       // pixels; what is less sees all of a half-space in one
constexpr double min_direction_length = 1e-12;  // so that its square is a number yet

/// Orthonormal and no mirror image, to the digits that people print.
bool is_rotation(const Pose& pose) {
  constexpr double tolerance = 1e-3;  // of each entry of R R^T: three digits, as people print
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < 3; ++k) product += pose[i][k] * pose[j][k];
      if (!(std::abs(product - (i == j ? 1 : 0)) <= tolerance)) return false;
    }
  const auto minor = [&](std::size_t a, std::size_t b) { return pose[1][a] * pose[2][b] - pose[1][b] * pose[2][a]; };
  return pose[0][0] * minor(1, 2) - pose[0][1] * minor(0, 2) + pose[0][2] * minor(0, 1) > 0;
}

Pose read_pose(const JsonField& field) {
  Pose pose{};
  const auto rows = field.elements(3, 3, "rows");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto values = rows[i].elements(4, 4, "numbers");
    for (std::size_t j = 0; j < values.size(); ++j) pose[i][j] = values[j].number(-max_coordinate, max_coordinate);
  }
  if (!is_rotation(pose)) field.refuse("expected a rotation in the first three columns, without scale or mirror");
  return pose;
}

PinholeCamera read_pinhole(const JsonField& field) {
  const Members members(field, {"width", "height", "fx", "fy", "cx", "cy", "cam_from_world"});
  PinholeCamera camera;
  if (const auto f = members.required("width")) camera.width = f->whole(1, max_camera_side);
  if (const auto f = members.required("height")) camera.height = f->whole(1, max_camera_side);
  if (const auto f = members.required("fx")) camera.fx = f->number(min_focal_length, max_coordinate);
  if (const auto f = members.required("fy")) camera.fy = f->number(min_focal_length, max_coordinate);
  if (const auto f = members.required("cx")) camera.cx = f->number(-max_coordinate, max_coordinate);
  if (const auto f = members.required("cy")) camera.cy = f->number(-max_coordinate, max_coordinate);
  if (const auto f = members.required("cam_from_world")) camera.cam_from_world = read_pose(*f);
  return camera;
}

LookAtCamera read_look_at(const JsonField& field) {
  const Members members(field, {"eye", "target", "up", "fov_y_deg", "width", "height"});
  LookAtCamera camera;
  if (const auto f = members.required("eye")) camera.eye = f->point();
  if (const auto f = members.required("target")) camera.target = f->point();
  if (const auto f = members.optional("up")) camera.up = read_direction(*f);
  if (const auto f = members.optional("fov_y_deg")) camera.fov_y_deg = read_fov(*f);
  if (const auto f = members.required("width")) camera.width = f->whole(1, max_camera_side);
  if (const auto f = members.required("height")) camera.height = f->whole(1, max_camera_side);
  return camera;
}

}  // namespace

double read_fov(const JsonField& field) { return field.number(0.001, 179.999); }

Point read_direction(const JsonField& field) {
  const Point direction = field.point();
  if (std::hypot(direction[0], direction[1], direction[2]) < min_direction_length)
    field.refuse("expected a direction: three numbers that are not all 0, or next to it");
  return direction;
}

Camera read_camera(const JsonField& field) {
  const Members any(field,
                    {"eye", "target", "up", "fov_y_deg", "width", "height", "fx", "fy", "cx", "cy", "cam_from_world"});
  if (any.optional("eye") || any.optional("target")) return read_look_at(field);
  return read_pinhole(field);
}

nlohmann::ordered_json encode(const PinholeCamera& camera) {
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"cam_from_world", camera.cam_from_world}};
}

nlohmann::ordered_json encode(const Camera& camera) {
  if (const auto* pinhole = std::get_if<PinholeCamera>(&camera)) return encode(*pinhole);
  const auto& look_at = std::get<LookAtCamera>(camera);
  nlohmann::ordered_json out{{"eye", look_at.eye}, {"target", look_at.target}};
  if (look_at.up) out["up"] = *look_at.up;
  out["fov_y_deg"] = look_at.fov_y_deg;
  out["width"] = look_at.width;
  out["height"] = look_at.height;
  return out;
}

Viewpoint read_viewpoint(const JsonField& object, const Members& members) {
  const auto camera = members.optional("camera"), view = members.optional("view");
  if (camera.has_value() == view.has_value()) {
    object.refuse("expected exactly one of camera and view");
    return std::string();
  }
  if (camera) return read_camera(*camera);
  return view->text();
}

}  // namespace proto
