#include "engine/io/transforms_json.h"

#include <array>
#include <cmath>
#include <string_view>

#include "engine/io/json_fields.h"

namespace engine::io {
namespace {

/// x_after = scale * (linear * x_before + offset)
struct WorldChange {
  DMat3 linear{1.0};
  DVec3 offset{0.0};
  double scale = 1;
};

/// Rows of 4 numbers: the linear part, its fourth column apart. A fourth row is 0 0 0 1.
void parse_rows(const JsonFields& matrix, std::size_t least_rows, DMat3& linear, DVec3& offset) {
  const std::size_t rows = matrix.size();
  if (rows < least_rows || rows > 4)
    return matrix.fail_here("expected " + std::to_string(least_rows) + " rows of 4 numbers");
  for (std::size_t row = 0; row < rows; ++row) {
    std::array<double, 4> values{};
    matrix.at(row).numbers(values.data(), 4);
    if (row == 3) {
      if (values != std::array<double, 4>{0, 0, 0, 1}) matrix.at(row).fail_here("expected the row 0 0 0 1");
      break;
    }
    for (int column = 0; column < 3; ++column) linear[column][int(row)] = values[std::size_t(column)];
    offset[int(row)] = values[3];
  }
}

/// A field of the frame or, where the frame has none, of the file.
struct Scope {
  const JsonFields &frame, &file;

  [[nodiscard]] const JsonFields* find(const char* key) const {
    return frame.has(key) ? &frame : file.has(key) ? &file : nullptr;
  }
  [[nodiscard]] double number(const char* key, double otherwise) const {
    const auto* level = find(key);
    return level ? level->at(key).number() : otherwise;
  }
};

/// Of the nearest level that has either a focal length or a field of view; 0 if none has.
double focal_length(const Scope& scope, const char* length_key, const char* angle_key, int side) {
  for (const auto* level : {&scope.frame, &scope.file}) {
    if (level->has(length_key)) return level->at(length_key).number();
    if (level->has(angle_key)) return 0.5 * side / std::tan(0.5 * level->at(angle_key).number());
  }
  return 0;
}

Result<LensModel> lens_model(const Scope& scope) {
  if (const auto* level = scope.find("is_fisheye"); level && level->at("is_fisheye").boolean())
    return LensModel::fisheye;
  const auto* level = scope.find("camera_model");
  if (level == nullptr) return LensModel::perspective;
  const JsonFields field = level->at("camera_model");
  const std::string name = field.string();
  if (name == "OPENCV_FISHEYE") return LensModel::fisheye;
  for (const std::string_view known : {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", ""})
    if (name == known) return LensModel::perspective;
  return fail(ErrorCode::unsupported,
              "camera model " + name.substr(0, 40) + " is not supported: undistort the photos first", field.where());
}

Result<Shot> parse_frame(const JsonFields& frame, const JsonFields& file, const WorldChange& applied,
                         const std::function<Result<PictureSize>(const std::string&)>& size_of) {
  const Scope scope{frame, file};
  Shot shot;
  shot.where = frame.where();
  shot.name = frame.at("file_path").string();

  Lens& lens = shot.lens;
  const auto *w = scope.find("w"), *h = scope.find("h");
  if (w && h) {
    lens.width = w->at("w").pixels(), lens.height = h->at("h").pixels();
  } else if (!shot.name.empty()) {
    const auto size = size_of(shot.name);
    if (!size) return propagate(size);
    lens.width = size->width, lens.height = size->height;
  }
  lens.fx = focal_length(scope, "fl_x", "camera_angle_x", lens.width);
  lens.fy = focal_length(scope, "fl_y", "camera_angle_y", lens.height);
  if (lens.fx == 0) lens.fx = lens.fy;
  if (lens.fy == 0) lens.fy = lens.fx;
  if (lens.fx == 0)
    frame.fail_here("there is no focal length: expected fl_x or camera_angle_x here or in the whole file");
  lens.cx = scope.number("cx", 0.5 * lens.width);
  lens.cy = scope.number("cy", 0.5 * lens.height);
  const auto model = lens_model(scope);
  if (!model) return propagate(model);
  lens.model = *model;
  lens.k = {scope.number("k1", 0), scope.number("k2", 0), scope.number("k3", 0), scope.number("k4", 0)};
  if (lens.model == LensModel::perspective) {
    lens.p = {scope.number("p1", 0), scope.number("p2", 0)};
    // Some tools read k4 as a fourth power of r^2, others as OpenCV does, in a denominator.
    if (lens.k[3] != 0)
      return fail(ErrorCode::unsupported, "k4 of a perspective lens has no one meaning: undistort the photos first",
                  scope.find("k4")->at("k4").where());
  }

  DMat3 world_from_gl(0.0);  // and that is what it stays where the field is not as asked for
  DVec3 centre(0.0);
  const JsonFields matrix = frame.at("transform_matrix");
  parse_rows(matrix, 4, world_from_gl, centre);
  // Into the world before the change: linear^-1 (x / scale - offset).
  const DMat3 undo = glm::inverse(applied.linear);
  const auto rotation = as_rotation(undo * world_from_gl);
  if (!rotation) matrix.fail_here("expected a rotation in the upper left 3x3");
  DMat3 world_from_cam = rotation.value_or(DMat3(1.0));
  centre = undo * (centre / applied.scale - applied.offset);
  world_from_cam[1] = -world_from_cam[1];  // OpenGL's camera looks along -z, with y up
  world_from_cam[2] = -world_from_cam[2];
  shot.rotation = glm::transpose(world_from_cam);
  shot.translation = -(shot.rotation * centre);
  return shot;
}

WorldChange parse_applied(const JsonFields& file) {
  WorldChange applied;
  if (file.has("applied_transform")) {
    const JsonFields matrix = file.at("applied_transform");
    parse_rows(matrix, 3, applied.linear, applied.offset);
    const auto rotation = as_rotation(applied.linear);
    if (!rotation) matrix.fail_here("expected a rotation in the first three columns");
    applied.linear = rotation.value_or(DMat3(1.0));
  }
  if (file.has("applied_scale")) {
    applied.scale = file.at("applied_scale").number();
    if (!(applied.scale > 0)) file.at("applied_scale").fail_here("expected a positive number");
  }
  return applied;
}

}  // namespace

Result<std::vector<Shot>> parse_transforms_json(
    std::span<const std::byte> bytes, const std::string& file, TransformsWorld world,
    const std::function<Result<PictureSize>(const std::string& file_path)>& size_of) {
  const auto document = parse_json(bytes, file);
  if (!document) return propagate(document);
  std::optional<Error> error;
  const JsonFields top(*document, file + ":", error);
  const WorldChange applied = world == TransformsWorld::before_applied ? parse_applied(top) : WorldChange{};
  const JsonFields frames = top.at("frames");
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < frames.size() && !error; ++i) {
    auto shot = parse_frame(frames.at(i), top, applied, size_of);
    if (error) break;
    if (!shot) return propagate(shot);
    shots.push_back(std::move(*shot));
  }
  if (error) return tl::make_unexpected(std::move(*error));
  return shots;
}

}  // namespace engine::io
