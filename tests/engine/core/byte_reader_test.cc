#include "engine/core/byte_reader.h"

#include <gtest/gtest.h>

#include <limits>
#include <span>
#include <string>

namespace engine {
namespace {

TEST(ByteReader, ReadsLittleEndianValuesInOrder) {
  const std::string bytes("\x01\x02\x00\x00\x80\x3f", 6);
  ByteReader in(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(in.read<std::uint16_t>(), 0x0201);
  EXPECT_EQ(in.read<float>(), 1.0f);
  EXPECT_TRUE(in.ok());
  EXPECT_EQ(in.offset(), 6u);
  EXPECT_EQ(in.remaining(), 0u);
}

TEST(ByteReader, FailsForGoodAtTheFirstReadThatDoesNotFit) {
  const std::string bytes = "abc";
  ByteReader in(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(in.read<std::uint32_t>(), 0u);
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.read<std::uint8_t>(), 0u);  // would fit, but what it means is unknown now
  EXPECT_FALSE(in.has(0));
}

TEST(ByteReader, CountsThatOverflowDoNotFit) {
  const std::string bytes(64, 'x');
  ByteReader in(std::as_bytes(std::span(bytes)));
  constexpr auto most = std::numeric_limits<std::uint64_t>::max();
  EXPECT_TRUE(in.has(8, 8));
  EXPECT_FALSE(in.has(9, 8));
  EXPECT_FALSE(in.has(most / 4 + 1, 8));  // times 8 is 0 in 64 bits
  EXPECT_FALSE(in.has(most, most));
  EXPECT_TRUE(in.take(most / 4 + 1, 8).empty());
  EXPECT_FALSE(in.ok());
}

TEST(ByteReader, ReadsAStringUpToItsZeroOrFails) {
  const std::string bytes("photo.jpg\0rest", 14);
  ByteReader in(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(in.read_c_string(), "photo.jpg");
  EXPECT_EQ(in.remaining(), 4u);
  EXPECT_EQ(in.read_c_string(), "");
  EXPECT_FALSE(in.ok());
}

}  // namespace
}  // namespace engine
