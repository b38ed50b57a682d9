#include "server/scenes/disk/scene_format.h"

#include <gtest/gtest.h>

#include <string>

#include "engine/io/checks.h"
#include "tests/support/data.h"

namespace server::scenes {
namespace {

namespace io = engine::io;

/// A .glb file of Gaussians at the origin, of which only the positions are there, with much JSON that says nothing.
std::string glb_of(std::size_t gaussians, std::size_t empty_objects) {
  const auto number = [](std::size_t value) {
    std::string bytes;
    for (int shift = 0; shift < 32; shift += 8) bytes += char(value >> shift & 255u);
    return bytes;
  };
  const std::size_t size = 12 * gaussians;
  const std::string bytes = std::to_string(size), count = std::to_string(gaussians);
  std::string json = R"({"nodes": [{"mesh": 0}], "buffers": [{"byteLength": )" + bytes +
                     R"(}], "bufferViews": [{"buffer": 0, "byteLength": )" + bytes +
                     R"(}], "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": )" + count +
                     R"(}], "meshes": [{"primitives": [{"mode": 0, "attributes": {"POSITION": 0},
                        "extensions": {"KHR_gaussian_splatting": {}}}]}], "extras": [{})";
  for (std::size_t k = 1; k < empty_objects; ++k) json += ",{}";
  json += "]}";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  return "glTF" + number(2) + number(28 + json.size() + size) + number(json.size()) + "JSON" + json + number(size) +
         std::string("BIN\0", 4) + std::string(size, '\0');
}

TEST(SceneFormat, TellingWhatAFileTakesStaysWithinTheMemoryForWork) {
  const support::TempDir folder;
  const auto path = folder.path() / "a.glb";
  const std::string file = glb_of(10'000, 100'000);
  support::write_file(path, file);
  EXPECT_GE(expected_memory_bytes(path, {}), 10'000 * io::cloud_row_bytes(0));
  // The file fits, its tree does not; then not even the file.
  for (const std::uint64_t bytes : {std::uint64_t{2} << 20, std::uint64_t{1} << 10}) {
    engine::MemoryBudget work(bytes);
    EXPECT_LT(expected_memory_bytes(path, {.memory = &work}), 10'000 * io::cloud_row_bytes(0)) << bytes;
    EXPECT_EQ(work.lent(), 0u);
    const auto scene = io::read_scene(path, {.memory = &work});
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, engine::ErrorCode::too_large);
  }
}

}  // namespace
}  // namespace server::scenes
