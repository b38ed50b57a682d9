#include "tests/fuzz/scene_target.h"

void fuzz::run(std::span<const std::byte> bytes) { read_as_scene(bytes); }

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  for (const int degree : {0, 1, 3}) all.push_back(engine::io::simple_ply(degree, 2));
  return all;
}
