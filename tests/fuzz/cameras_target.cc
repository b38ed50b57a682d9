// transforms.json and cameras.json.
#include "engine/io/cameras_json.h"
#include "engine/io/transforms_json.h"
#include "tests/fuzz/fuzz.h"

void fuzz::run(std::span<const std::byte> bytes) {
  const auto size_of = [](const std::string&) -> engine::Result<engine::io::PictureSize> {
    return engine::io::PictureSize{100, 80};
  };
  for (const auto world : {engine::io::TransformsWorld::as_in_file, engine::io::TransformsWorld::before_applied})
    (void)engine::io::parse_transforms_json(bytes, "transforms.json", world, size_of);
  (void)engine::io::parse_cameras_json(bytes, "cameras.json");
}

std::vector<std::string> fuzz::seeds() {
  return {
      R"({"fl_x":90,"cx":50,"cy":40,"w":100,"h":80,"k1":0.1,"frames":[{"file_path":"a.jpg","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]}],"applied_transform":[[1,0,0,0],[0,0,1,0],[0,-1,0,0]]})",
      R"({"camera_angle_x":0.7,"frames":[{"file_path":"a","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]}]})",
      R"([{"id":0,"img_name":"a","width":100,"height":80,"position":[0,0,1],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":90,"fy":90}])"};
}
