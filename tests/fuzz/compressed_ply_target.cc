#include "engine/io/compressed_ply.h"

#include <numeric>

#include "tests/fuzz/scene_target.h"

void fuzz::run(std::span<const std::byte> bytes) { read_as_scene(bytes); }

std::vector<std::string> fuzz::seeds() {
  std::vector<std::string> all;
  for (const int degree : {0, 1}) {
    std::vector<std::uint32_t> order(3);
    std::iota(order.begin(), order.end(), 0u);
    all.push_back(text_of(engine::io::encode_compressed_ply(engine::io::random_cloud(3, degree, 1), order)));
  }
  return all;
}
