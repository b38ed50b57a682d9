#include "engine/scene/cloud_bytes.h"

#include <gtest/gtest.h>

#include "tests/engine/scene/random_cloud.h"

namespace engine::scene {
namespace {

TEST(CloudBytes, AreReadAsTheyWereWritten) {
  for (const int degree : {0, 1, 2, 3})
    for (const std::size_t rows : {0u, 1u, 17u}) {
      GaussianCloud cloud = random_cloud(rows, degree, rows, (rows + 3) % 5);
      ByteWriter out;
      write_cloud(out, cloud);
      out.write(std::uint8_t{42});
      ByteReader in(out.bytes());
      EXPECT_EQ(read_cloud(in), cloud);
      EXPECT_EQ(in.read<std::uint8_t>(), 42) << "as much was read as was written";
      EXPECT_TRUE(in.ok());
    }
}

TEST(CloudBytes, CutAnywhereTheyGiveAnEmptyCloudAndAFailedReader) {
  ByteWriter out;
  write_cloud(out, random_cloud(3, 1, 9, 2));
  for (std::size_t length = 0; length < out.bytes().size(); ++length) {
    ByteReader in(out.bytes().first(length));
    EXPECT_EQ(read_cloud(in).size(), 0u) << length;
    EXPECT_FALSE(in.ok()) << length;
  }
}

TEST(CloudBytes, CountsThatOverflowAllocateNothing) {
  for (const std::uint64_t rows : {~std::uint64_t{0}, std::uint64_t{1} << 60, std::uint64_t{1} << 33})
    for (const std::uint64_t stride : {std::uint64_t{0}, std::uint64_t{3}, ~std::uint64_t{0}})
      for (const std::int32_t degree : {-1, 0, 3, 4, 1 << 30}) {
        ByteWriter out;
        out.write(rows), out.write(degree), out.write(stride), out.write(std::uint64_t{0});
        ByteReader in(out.bytes());
        EXPECT_EQ(read_cloud(in).size(), 0u);
        EXPECT_FALSE(in.ok());
      }
}

}  // namespace
}  // namespace engine::scene
