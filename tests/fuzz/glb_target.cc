#include "engine/io/glb.h"

#include "tests/fuzz/scene_target.h"

void fuzz::run(std::span<const std::byte> bytes) {
  (void)engine::io::expected_glb_bytes(bytes);
  const auto scene = engine::io::decode_glb(bytes, "a.glb", small_limits());
  if (!scene) return;
  demand(!engine::scene::first_not_finite(scene->cloud), "a scene that is accepted is finite");
  const auto again = engine::io::encode_glb(scene->cloud, "a.glb");
  demand(again.has_value(), "a scene that is accepted can be written");
}

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  for (const int degree : {0, 1})
    all.push_back(text_of(*engine::io::encode_glb(engine::io::random_cloud(2, degree, 1), "")));
  return all;
}
