#include "engine/core/checksum.h"

#include <gtest/gtest.h>

#include <string>

namespace engine {
namespace {

std::uint64_t of(const std::string& text) { return fnv1a(std::as_bytes(std::span(text))); }

TEST(Checksum, IsThePublishedFunction) {  // vectors of the draft
  EXPECT_EQ(of(""), 0xcbf29ce484222325u);
  EXPECT_EQ(of("a"), 0xaf63dc4c8601ec8cu);
  EXPECT_EQ(of("foobar"), 0x85944171f73967e8u);
}

TEST(Checksum, SeesEveryBitOfEveryByte) {
  std::string bytes = "some thirty bytes of nothing much";
  const std::uint64_t before = of(bytes);
  for (char& byte : bytes)
    for (int bit = 0; bit < 8; ++bit) {
      byte = char(byte ^ 1 << bit);
      EXPECT_NE(of(bytes), before);
      byte = char(byte ^ 1 << bit);
    }
}

}  // namespace
}  // namespace engine
