#include "engine/core/byte_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace engine {
namespace {

TEST(ByteWriter, WritesWhatAReaderReadsBack) {
  ByteWriter out;
  out.write(std::uint16_t{0x0201});
  out.write_string("a view");
  const std::vector<float> values_out{1.5f, -0.0f};
  out.write_all(std::span(values_out));
  out.write(-2.25);
  const std::string bytes = std::move(out).take();
  EXPECT_EQ(bytes.substr(0, 2), "\x01\x02");
  ByteReader in(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(in.read<std::uint16_t>(), 0x0201);
  EXPECT_EQ(in.read_string(), "a view");
  std::vector<float> values(2);
  in.read_all(std::span(values));
  EXPECT_EQ(values[0], 1.5f);
  EXPECT_TRUE(std::signbit(values[1]));
  EXPECT_EQ(in.read<double>(), -2.25);
  EXPECT_TRUE(in.ok());
  EXPECT_EQ(in.remaining(), 0u);
}

TEST(ByteReader, AStringThatClaimsMoreThanThereIsFails) {
  ByteWriter out;
  out.write(std::uint32_t{0xffffffff});
  out.write_all(std::as_bytes(std::span("short", 5)));
  ByteReader in(out.bytes());
  EXPECT_EQ(in.read_string(), "");
  EXPECT_FALSE(in.ok());
}

TEST(ByteReader, ValuesThatDoNotAllFitAreNotRead) {
  ByteWriter out;
  out.write(1.0f);
  ByteReader in(out.bytes());
  std::vector<float> values{7, 7};
  in.read_all(std::span(values));
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(values, (std::vector<float>{7, 7}));
}

}  // namespace
}  // namespace engine
