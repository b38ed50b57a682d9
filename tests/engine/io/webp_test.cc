#include "engine/io/webp.h"

#include <gtest/gtest.h>

#include "engine/core/rng.h"

namespace engine::io {
namespace {

BytePicture noise(std::size_t width, std::size_t height) {
  BytePicture picture;
  picture.width = width, picture.height = height;
  Rng rng(1);
  for (std::size_t k = 0; k < 4 * picture.pixels(); ++k) picture.rgba.push_back(std::uint8_t(rng.below(256)));
  return picture;
}

TEST(Webp, GivesBackEveryByteAlsoUnderAnAlphaOfZero) {
  BytePicture picture = noise(37, 21);
  for (std::size_t i = 0; i < picture.pixels(); i += 2) picture.pixel(i)[3] = 0;
  const auto bytes = encode_webp(picture, "a.webp");
  ASSERT_TRUE(bytes);
  EXPECT_EQ(*bytes, encode_webp(picture, "a.webp").value()) << "the same bytes every time";
  const auto back = decode_webp(*bytes, 1000, nullptr, "a.webp");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->width, 37u);
  EXPECT_EQ(back->rgba, picture.rgba);
  EXPECT_TRUE(back->exact);
}

TEST(Webp, CutAtAnyByteIsAnError) {
  const auto bytes = encode_webp(noise(9, 5), "a.webp").value();
  for (std::size_t size = 0; size + 2 < bytes.size(); ++size)
    EXPECT_FALSE(decode_webp(std::span(bytes).first(size), 1000, nullptr, "a.webp")) << size;
}

TEST(Webp, IsCountedBeforeItIsDecoded) {
  const auto bytes = encode_webp(noise(40, 40), "a.webp").value();
  EXPECT_EQ(decode_webp(bytes, 1599, nullptr, "a.webp").error().code, ErrorCode::corrupt_data);
  MemoryBudget little(4 * 1600), enough(16 * 1600);
  EXPECT_EQ(decode_webp(bytes, 1600, &little, "a.webp").error().code, ErrorCode::too_large);
  EXPECT_TRUE(decode_webp(bytes, 1600, &enough, "a.webp"));
  EXPECT_EQ(enough.lent(), 0u);
}

TEST(Webp, ASideBeyondTheFormatIsRefused) {
  BytePicture picture;
  picture.width = 16384, picture.height = 1;
  picture.rgba.resize(4 * 16384);
  EXPECT_EQ(encode_webp(picture, "a.webp").error().code, ErrorCode::too_large);
}

}  // namespace
}  // namespace engine::io
