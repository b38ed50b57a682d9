#include "engine/io/cameras_json.h"

#include "engine/io/json_fields.h"

namespace engine::io {
namespace {

Shot parse_view(const JsonFields& view) {
  Shot shot;
  shot.where = view.where();
  shot.name = view.at("img_name").string();
  shot.lens.width = view.at("width").pixels();
  shot.lens.height = view.at("height").pixels();
  shot.lens.fx = view.at("fx").number();
  shot.lens.fy = view.at("fy").number();
  shot.lens.cx = 0.5 * shot.lens.width;
  shot.lens.cy = 0.5 * shot.lens.height;

  DVec3 centre;
  view.at("position").numbers(&centre.x, 3);
  const auto rows = view.at("rotation");
  if (rows.size() != 3) rows.fail_here("expected 3 rows of 3 numbers");
  // A row of world_from_cam is a column of its transpose, cam_from_world.
  DMat3 cam_from_world;
  for (int row = 0; row < 3; ++row) rows.at(std::size_t(row)).numbers(&cam_from_world[row].x, 3);
  const auto rotation = as_rotation(cam_from_world);
  if (!rotation) rows.fail_here("expected a rotation matrix");
  shot.rotation = rotation.value_or(DMat3(1.0));
  shot.translation = -(shot.rotation * centre);
  return shot;
}

}  // namespace

Result<std::vector<Shot>> parse_cameras_json(std::span<const std::byte> bytes, const std::string& file) {
  const auto document = parse_json(bytes, file);
  if (!document) return propagate(document);
  std::optional<Error> error;
  const JsonFields views(*document, file + ":", error);
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < views.size() && !error; ++i) shots.push_back(parse_view(views.at(i)));
  if (error) return tl::make_unexpected(std::move(*error));
  return shots;
}

}  // namespace engine::io
