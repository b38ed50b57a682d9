#include "engine/io/splat.h"

#include "tests/fuzz/scene_target.h"

void fuzz::run(std::span<const std::byte> bytes) {
  const auto cloud = engine::io::decode_splat(bytes, "a.splat", small_limits());
  if (cloud) demand(engine::io::encode_splat(*cloud).size() == bytes.size(), "a scene that is accepted can be written");
  read_as_scene(bytes);
}

std::vector<std::string> fuzz::seeds() {
  return {text_of(engine::io::encode_splat(engine::io::random_cloud(3, 0, 1)))};
}
