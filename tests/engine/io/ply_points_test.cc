#include "engine/io/ply_points.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/support/data.h"

namespace engine::io {
namespace {

template <class T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

TEST(PlyPoints, AreReadByNameWhateverTheOrder) {
  const support::TempDir dir;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nproperty float nx\nproperty double z\nproperty float x\nproperty float y\nend_header\n";
  for (int i = 0; i < 2; ++i) {
    for (const int channel : {1, 2, 3}) append(bytes, std::uint8_t(10 * i + channel));
    append(bytes, 9.0f), append(bytes, 1.0 / 3 + i), append(bytes, 1.5f), append(bytes, -2.5f);
  }
  const auto path = dir.path() / "points3D.ply";
  support::write_file(path, bytes);
  const auto points = read_ply_points(path);
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_EQ(points->size(), 2u);
  EXPECT_EQ((*points)[1], (Point{{1.5, -2.5, 1.0 / 3 + 1}, {11, 12, 13}}));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    support::write_file(path, bytes.substr(0, size));
    EXPECT_FALSE(read_ply_points(path)) << "cut at " << size;
  }
  const float nan_value = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - 4, &nan_value, 4);
  support::write_file(path, bytes);
  EXPECT_EQ(read_ply_points(path).error().where, "points3D.ply:vertex[1].y");
}

TEST(PlyPoints, NeedPositions) {
  const support::TempDir dir;
  const auto path = dir.path() / "input.ply";
  support::write_file(path, "ply\nformat binary_little_endian 1.0\nelement face 0\nproperty float x\nend_header\n");
  EXPECT_EQ(read_ply_points(path).error().code, ErrorCode::unsupported);
  support::write_file(path,
                      "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
                      "property int z\nend_header\n");
  EXPECT_EQ(read_ply_points(path).error().code, ErrorCode::unsupported);
  EXPECT_EQ(read_ply_points(dir.path() / "absent.ply").error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace engine::io
