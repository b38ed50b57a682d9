#include "engine/io/image_file.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

#include "engine/core/byte_writer.h"
#include "engine/core/rng.h"
#include "engine/io/read_bytes.h"
#include "tests/support/data.h"
#include "tests/support/processor_time.h"

namespace engine::io {
namespace {

using scene::Image;
using support::TempDir;

/// Seeded values that 8 bits hold exactly.
Image noise(int width, int height, int channels, std::uint64_t seed = 3) {
  Image image(width, height, channels);
  Rng rng(seed);
  for (float& value : image.data) value = float(rng.below(256)) / 255.0f;
  return image;
}

/// Smooth enough for JPEG.
Image ramp(int width, int height) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at(x, y, 0) = float(x) / float(width), image.at(x, y, 1) = float(y) / float(height),
                     image.at(x, y, 2) = 0.5f;
  return image;
}

float max_difference(const Image& a, const Image& b) {
  float worst = a.width == b.width && a.height == b.height && a.channels == b.channels ? 0.0f : 1e9f;
  for (std::size_t i = 0; worst < 1e9f && i < a.data.size(); ++i)
    worst = std::max(worst, std::abs(a.data[i] - b.data[i]));
  return worst;
}

Image decoded(const std::vector<std::byte>& bytes, const ImageOptions& options = {}) {
  auto image = decode_image(bytes, "picture", options);
  EXPECT_TRUE(image) << image.error().message;
  return image.value_or(Image());
}

/// Written by the library itself, for forms that we read and do not write.
void write_with_library(const std::filesystem::path& path, const OIIO::ImageSpec& spec,
                        const std::vector<float>& interleaved) {
  auto writer = OIIO::ImageOutput::create(path.string());
  ASSERT_TRUE(writer && writer->open(path.string(), spec));
  ASSERT_TRUE(writer->write_image(OIIO::TypeDesc::FLOAT, interleaved.data()));
  ASSERT_TRUE(writer->close());
}

/// Something like 2024:05:17, as EXIF and EXR write dates.
bool holds_a_date(std::string_view bytes) {
  constexpr std::string_view form = "dddd:dd:dd";
  for (std::size_t i = 0; i + form.size() <= bytes.size(); ++i)
    if (std::ranges::equal(bytes.substr(i, form.size()), form, [](char found, char wanted) {
          return wanted == 'd' ? std::isdigit(static_cast<unsigned char>(found)) != 0 : found == wanted;
        }))
      return true;
  return false;
}

/// The message of an error whose sentence is none of image_file.cc's own.
std::string foreign_words(const Result<Image>& read) {
  constexpr std::string_view sentences[] = {
      "is not a PNG, JPEG, EXR, TIFF or WebP picture: save it as one",
      "the picture ends before its last row: copy or download it again",
      "picture is damaged: its header cannot be decoded; copy or download it again, or save it anew",
      "picture is damaged: its pixels cannot be decoded; copy or download it again, or save it anew",
      "the picture cannot be decoded: copy or download it again, or save it anew",
      "the picture's header describes no flat picture",
      "the picture has no channels R, G, B and none called Y",
      "a pixel is NaN or infinite",
      "does not fit into the memory of this machine",
      "pixels a side",
      "pixels of 4 channels"};
  if (read) return "";
  const std::string& message = read.error().message;
  const auto ends_it = [&](std::string_view sentence) { return message.ends_with(sentence); };
  return std::ranges::any_of(sentences, ends_it) ? "" : message;
}

TEST(EncodeImage, PngComesBackAsItWas) {
  for (const int channels : {1, 3, 4}) {
    SCOPED_TRACE(channels);
    const Image image = noise(37, 23, channels);
    const auto bytes = encode_image(image, ImageFormat::png);
    ASSERT_TRUE(bytes) << bytes.error().message;
    const Image back = decoded(*bytes, {.alpha = Alpha::keep});
    ASSERT_EQ(back.channels, channels == 4 ? 4 : 3);
    for (int c = 0; c < back.channels; ++c)
      for (int i = 0; i < 37 * 23; ++i)
        ASSERT_NEAR(back.plane(c)[std::size_t(i)], image.plane(channels == 1 ? 0 : c)[std::size_t(i)], 1e-7f);
  }
  const Image fine(5, 4, 3, 12345.0f / 65535.0f);
  EXPECT_LT(max_difference(decoded(*encode_image(fine, ImageFormat::png, {.png_bits = 16})), fine), 1e-7f);
}

/// The steps of a PNG of so many bits that these values are written as.
std::vector<long> written_steps(const std::vector<float>& values, int bits) {
  Image image(int(values.size()), 1, 1);
  image.data = values;
  const Image back = decoded(*encode_image(image, ImageFormat::png, {.png_bits = bits}));
  std::vector<long> steps;
  for (int x = 0; x < image.width; ++x) steps.push_back(std::lround(float((1 << bits) - 1) * back.at(x, 0)));
  return steps;
}

TEST(EncodeImage, RoundsToTheNearestStepAndClamps) {
  constexpr float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (const int bits : {8, 16}) {
    SCOPED_TRACE(bits);
    const long top = (1 << bits) - 1;
    EXPECT_EQ(written_steps({-3.0f, -0.0f, 0.4f / float(top), 0.6f / float(top), 1.7f, nan, infinity, -infinity}, bits),
              (std::vector<long>{0, 0, 0, 1, top, 0, top, 0}));
  }
}

TEST(EncodeImage, RoundsHalvesUpwardsToTheLastBit) {
  for (const int bits : {8, 16}) {
    SCOPED_TRACE(bits);
    const long top = (1 << bits) - 1, stride = bits == 8 ? 1 : 13;  // of 65535 steps every so many
    std::vector<float> values;
    std::vector<long> expected;
    for (long step = 0; step < top; step += stride) {
      const float half = (float(step) + 0.5f) / float(top);
      for (const float value : {std::nextafter(half, 0.0f), half, std::nextafter(half, 1.0f)}) {
        values.push_back(value);
        expected.push_back(std::lround(float(top) * value));  // halves away from zero, of the same product
      }
    }
    EXPECT_EQ(written_steps(values, bits), expected);
  }
}

TEST(EncodeImage, JpegIsCloseAndQualityCosts) {
  const Image image = ramp(64, 48);
  const auto fine = encode_image(image, ImageFormat::jpeg, {.jpeg_quality = 97});
  const auto coarse = encode_image(image, ImageFormat::jpeg, {.jpeg_quality = 30});
  ASSERT_TRUE(fine);
  ASSERT_TRUE(coarse);
  EXPECT_LT(max_difference(decoded(*fine), image), 0.04f);
  EXPECT_LT(coarse->size(), fine->size());
}

TEST(EncodeImage, ExrHoldsFloatsExactly) {
  Image image(7, 5, 3);
  Rng rng(5);
  for (float& value : image.data) value = 100 * rng.normal();
  EXPECT_EQ(decoded(*encode_image(image, ImageFormat::exr)), image);
}

TEST(EncodeImage, GivesTheSameBytesAgainAndNoDate) {
  const Image image = ramp(33, 21);
  for (const auto format : {ImageFormat::png, ImageFormat::jpeg, ImageFormat::exr}) {
    const auto bytes = encode_image(image, format);
    ASSERT_TRUE(bytes);
    EXPECT_EQ(*bytes, *encode_image(image, format));
    EXPECT_FALSE(holds_a_date({reinterpret_cast<const char*>(bytes->data()), bytes->size()}));
  }
}

TEST(EncodeImage, RefusesWhatAFormatCannotHold) {
  EXPECT_EQ(encode_image(noise(4, 4, 4), ImageFormat::jpeg).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(encode_image(noise(4, 4, 2), ImageFormat::png).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(encode_image(Image(), ImageFormat::png).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(encode_image(noise(4, 4, 3), ImageFormat::jpeg, {.jpeg_quality = 0}).error().code,
            ErrorCode::invalid_argument);
  EXPECT_EQ(encode_image(noise(4, 4, 3), ImageFormat::png, {.png_bits = 12}).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(encode_exr({}).error().code, ErrorCode::invalid_argument);
  const Image color = noise(4, 4, 3), depth = noise(5, 4, 1);
  EXPECT_EQ(encode_exr({.color = &color, .depth = &depth}).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(encode_exr({.color = &depth}).error().code, ErrorCode::invalid_argument);
}

TEST(WriteExr, NamesItsChannelsAsTheFieldDoes) {
  const TempDir dir;
  const Image color = noise(6, 4, 3, 1), alpha = noise(6, 4, 1, 2), depth = noise(6, 4, 1, 3);
  const auto path = dir.path() / "render.exr";
  ASSERT_TRUE(write_exr(path, {.color = &color, .alpha = &alpha, .depth = &depth}));
  auto reader = OIIO::ImageInput::open(path.string());
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->spec().channelnames, (std::vector<std::string>{"R", "G", "B", "A", "Z"}));
  EXPECT_EQ(reader->spec().format, OIIO::TypeDesc::FLOAT);
  std::vector<float> pixels(6 * 4 * 5);
  ASSERT_TRUE(reader->read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, pixels.data()));
  for (int i = 0; i < 24; ++i) {
    EXPECT_EQ(pixels[std::size_t(i) * 5 + 1], color.plane(1)[std::size_t(i)]);
    EXPECT_EQ(pixels[std::size_t(i) * 5 + 3], alpha.plane(0)[std::size_t(i)]);
    EXPECT_EQ(pixels[std::size_t(i) * 5 + 4], depth.plane(0)[std::size_t(i)]);
  }
  ASSERT_TRUE(write_exr(dir.path() / "depth.exr", {.depth = &depth}));
  EXPECT_EQ(read_image(dir.path() / "depth.exr").error().code, ErrorCode::unsupported);  // no colour in it
}

TEST(WriteImage, ChoosesTheFormatByExtension) {
  const TempDir dir;
  const Image image = noise(8, 8, 3);
  for (const char* name : {"a.png", "b.JPG", "c.jpeg", "d.exr"}) {
    ASSERT_TRUE(write_image(dir.path() / name, image)) << name;
    EXPECT_TRUE(read_image(dir.path() / name)) << name;
  }
  EXPECT_EQ(write_image(dir.path() / "e.gif", image).error().code, ErrorCode::unsupported);
  EXPECT_EQ(write_image(dir.path() / "none" / "f.png", image).error().code, ErrorCode::not_found);
}

TEST(ReadImage, ReadsByContentWhateverTheName) {
  const TempDir dir;
  const Image image = noise(9, 7, 3);
  for (const auto format : {ImageFormat::png, ImageFormat::exr}) {
    const auto bytes = encode_image(image, format);
    ASSERT_TRUE(bytes);
    support::write_file(dir.path() / "photo.jpg?x=1", {reinterpret_cast<const char*>(bytes->data()), bytes->size()});
    const auto back = read_image(dir.path() / "photo.jpg?x=1");
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_LT(max_difference(*back, image), 1e-6f);
    EXPECT_EQ(picture_size(dir.path() / "photo.jpg?x=1").value(), (PictureSize{9, 7}));
  }
  support::write_file(dir.path() / "text.png", "this is not a picture");
  EXPECT_EQ(read_image(dir.path() / "text.png").error().code, ErrorCode::unsupported);
  EXPECT_EQ(picture_size(dir.path() / "text.png").error().code, ErrorCode::unsupported);
  EXPECT_EQ(read_image(dir.path() / "absent.png").error().code, ErrorCode::not_found);
  EXPECT_FALSE(read_image(dir.path()));
}

TEST(ReadImage, ReadsTiffAndWebpToo) {
  const TempDir dir;
  const Image image = ramp(16, 11);
  std::vector<float> interleaved;
  for (std::size_t i = 0; i < image.pixels(); ++i)
    for (int c = 0; c < 3; ++c) interleaved.push_back(image.plane(c)[i]);
  for (const char* name : {"a.tif", "b.webp"}) {
    OIIO::ImageSpec spec(16, 11, 3, OIIO::TypeDesc::UINT8);
    write_with_library(dir.path() / name, spec, interleaved);
    const auto back = read_image(dir.path() / name);
    ASSERT_TRUE(back) << name << back.error().message;
    EXPECT_LT(max_difference(*back, image), std::string(name) == "b.webp" ? 0.06f : 0.5f / 255 + 1e-6f) << name;
  }
}

TEST(ReadImage, OpensNoOtherFormatThatTheLibraryKnows) {
  const TempDir dir;
  for (const char* name : {"a.bmp", "b.tga", "c.ppm", "d.hdr", "e.sgi"}) {
    write_with_library(dir.path() / name, OIIO::ImageSpec(4, 3, 3, OIIO::TypeDesc::UINT8),
                       std::vector<float>(36, 0.5f));
    const auto read = read_image(dir.path() / name);
    ASSERT_FALSE(read) << name;
    EXPECT_EQ(read.error().code, ErrorCode::unsupported) << name;
    EXPECT_EQ(read.error().where, name);
    EXPECT_NE(read.error().message.find("is not a PNG, JPEG, EXR, TIFF or WebP picture"), std::string::npos);
    EXPECT_FALSE(picture_size(dir.path() / name)) << name;
  }
}

TEST(ReadImage, PutsTransparentPicturesInFrontOfBlack) {
  Image image(2, 1, 4);
  for (int c = 0; c < 3; ++c) image.at(0, 0, c) = 0.8f, image.at(1, 0, c) = 1.0f;
  image.at(0, 0, 3) = 1.0f, image.at(1, 0, 3) = 0.2f;
  const auto bytes = encode_image(image, ImageFormat::png);
  ASSERT_TRUE(bytes);
  const Image flat = decoded(*bytes);
  ASSERT_EQ(flat.channels, 3);
  EXPECT_NEAR(flat.at(0, 0, 1), 0.8f, 1e-6f);
  EXPECT_NEAR(flat.at(1, 0, 1), 0.2f, 1e-6f);
  const Image kept = decoded(*bytes, {.alpha = Alpha::keep});
  EXPECT_NEAR(kept.at(1, 0, 1), 1.0f, 1e-6f);
  EXPECT_NEAR(kept.at(1, 0, 3), 0.2f, 1e-6f);
}

/// EXIF data, little-endian: a directory that asks for a picture to be turned, and that leads to another one.
std::string exif_of(std::uint32_t orientation) {
  ByteWriter tiff;
  tiff.write_all(std::span("II*", 4));
  tiff.write(std::uint32_t{8});  // where the directory begins
  tiff.write(std::uint16_t{2});  // its entries: tag, type, count, and the value or where it is
  const auto entry = [&](std::uint16_t tag, std::uint16_t type, std::uint32_t value) {
    tiff.write(tag), tiff.write(type), tiff.write(std::uint32_t{1}), tiff.write(value);
  };
  entry(0x0112, 3, orientation);
  entry(0x8769, 4, 38);          // the camera's directory
  tiff.write(std::uint32_t{0});  // none follows
  tiff.write(std::uint16_t{1});  // the camera's: one entry
  entry(0xa001, 3, 1);           // sRGB
  return std::string("Exif\0\0", 6) + std::move(tiff).take();
}

/// The JPEG with these EXIF data.
std::vector<std::byte> with_exif(const std::vector<std::byte>& jpeg, const std::string& exif) {
  const std::size_t length = exif.size() + 2;
  const std::string segment = std::string("\xff\xe1") + char(length >> 8) + char(length & 0xff) + exif;
  const auto bytes = std::as_bytes(std::span(segment));
  std::vector<std::byte> out = jpeg;
  out.insert(out.begin() + 2, bytes.begin(), bytes.end());
  return out;
}

TEST(DecodeImage, RowsAreThoseOfTheFileWhateverItsExifDataAskFor) {
  const auto jpeg = encode_image(ramp(24, 16), ImageFormat::jpeg);
  ASSERT_TRUE(jpeg);
  const Image stored = decoded(*jpeg);
  for (std::uint32_t orientation = 0; orientation <= 9; ++orientation)
    EXPECT_EQ(max_difference(decoded(with_exif(*jpeg, exif_of(orientation))), stored), 0) << orientation;
}

// The library reads tags of damaged EXIF data that are not there: whether a photo was turned was up to what was last in
// that memory.
TEST(DecodeImage, OfDamagedExifDataIsTheSamePictureEachTime) {
  const auto jpeg = encode_image(ramp(24, 16), ImageFormat::jpeg);
  ASSERT_TRUE(jpeg);
  const Image stored = decoded(*jpeg);
  const std::string exif = exif_of(6);
  for (std::size_t size = 0; size < exif.size(); ++size)
    EXPECT_EQ(max_difference(decoded(with_exif(*jpeg, exif.substr(0, size))), stored), 0) << "cut to " << size;
  for (std::size_t at = 6; at < exif.size(); ++at)  // behind the name
    for (const int value : {0x00, 0x06, 0x12, 0x7f, 0xff}) {
      std::string damaged = exif;
      damaged[at] = char(value);
      EXPECT_EQ(max_difference(decoded(with_exif(*jpeg, damaged)), stored), 0) << "byte " << at << " is " << value;
    }
}

TEST(ReadImage, NamesTheLimitBeforeItAllocates) {
  const auto bytes = encode_image(noise(40, 30, 3), ImageFormat::png);
  ASSERT_TRUE(bytes);
  EXPECT_EQ(decode_image(*bytes, "a.png", {.max_side = 39}).error().code, ErrorCode::too_large);
  EXPECT_EQ(decode_image(*bytes, "a.png", {.max_pixels = 1199}).error().code, ErrorCode::too_large);
  EXPECT_TRUE(decode_image(*bytes, "a.png", {.max_side = 40, .max_pixels = 1200}));
  const TempDir dir;
  ASSERT_TRUE(write_image(dir.path() / "a.png", noise(40, 30, 3)));
  EXPECT_EQ(read_image(dir.path() / "a.png", {.max_file_bytes = 100}).error().code, ErrorCode::too_large);
  // A header that claims 2^31 - 1 pixels a side (and whose checksum is thereby wrong) must not be believed either.
  auto absurd = *bytes;
  for (std::size_t i = 16; i < 24; ++i) absurd[i] = std::byte(i % 4 == 0 ? 0x7f : 0xff);
  EXPECT_FALSE(decode_image(absurd, "absurd.png"));
}

TEST(ReadImage, NamesThePixelThatIsNotANumber) {
  Image image = noise(5, 4, 3);
  image.at(3, 2, 1) = std::numeric_limits<float>::quiet_NaN();
  const auto read = decode_image(*encode_image(image, ImageFormat::exr), "a.exr");
  EXPECT_EQ(read.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(read.error().where, "a.exr:pixel[3,2]");
}

TEST(DecodeImage, CutAnywhereIsANamedError) {
  for (const auto format : {ImageFormat::png, ImageFormat::jpeg, ImageFormat::exr}) {
    const auto bytes = encode_image(noise(9, 8, 3), format);
    ASSERT_TRUE(bytes && decode_image(*bytes, "whole"));
    for (std::size_t size = 0; size < bytes->size(); ++size) {
      const auto cut = decode_image(std::span(*bytes).first(size), "cut");
      ASSERT_FALSE(cut) << "format " << int(format) << " cut at " << size << " of " << bytes->size();
      EXPECT_EQ(cut.error().where.substr(0, 3), "cut");
      EXPECT_FALSE(cut.error().message.empty());
    }
  }
}

TEST(DecodeImage, SurvivesCorruptedPictures) {
  for (const auto format : {ImageFormat::png, ImageFormat::jpeg, ImageFormat::exr}) {
    const auto whole = encode_image(noise(9, 8, 3), format);
    ASSERT_TRUE(whole);
    for (std::uint64_t seed = 0; seed < 400; ++seed) {
      Rng rng(seed, std::uint64_t(format));
      auto bytes = *whole;
      for (auto changes = 1 + rng.below(3); changes > 0; --changes)
        bytes[rng.below(std::uint32_t(bytes.size()))] = std::byte(rng.below(256));
      const auto image = decode_image(bytes, "picture", {.max_side = 64});
      SCOPED_TRACE(testing::Message() << "format " << int(format) << ", seed " << seed);
      EXPECT_TRUE(image ? std::max(image->width, image->height) <= 64 : image.error().where.starts_with("picture"));
      EXPECT_EQ(foreign_words(image), "");
    }
  }
}

TEST(DecodeImage, NeverRepeatsWhatALibrarySays) {
  const TempDir dir;
  write_with_library(dir.path() / "a.tif", OIIO::ImageSpec(9, 8, 3, OIIO::TypeDesc::UINT8),
                     std::vector<float>(216, 0.5f));
  write_with_library(dir.path() / "a.webp", OIIO::ImageSpec(9, 8, 3, OIIO::TypeDesc::UINT8),
                     std::vector<float>(216, 0.5f));
  std::vector<std::vector<std::byte>> pictures{*read_bytes(dir.path() / "a.tif", 1 << 20),
                                               *read_bytes(dir.path() / "a.webp", 1 << 20),
                                               *encode_image(noise(9, 8, 3), ImageFormat::exr)};
  for (std::size_t i = 0; i < pictures.size(); ++i)
    for (std::size_t size = 12; size < pictures[i].size(); ++size) {
      const auto cut = decode_image(std::span(pictures[i]).first(size), "cut");
      EXPECT_EQ(foreign_words(cut), "") << "picture " << i << " cut at " << size;
    }
}

TEST(Resized, KeepsFlatColourAndSize) {
  const Image flat(17, 13, 3, 0.3f);
  for (const auto filter : {ResizeFilter::box, ResizeFilter::lanczos3}) {
    for (const auto& [w, h] : {std::pair{8, 6}, std::pair{40, 31}, std::pair{1, 1}, std::pair{17, 13}}) {
      const auto out = resized(flat, w, h, filter);
      ASSERT_TRUE(out) << out.error().message;
      ASSERT_EQ(out->width, w);
      ASSERT_EQ(out->height, h);
      for (const float value : out->data) EXPECT_NEAR(value, 0.3f, 1e-5f);
    }
  }
  EXPECT_EQ(resized(flat, 0, 3).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(resized(Image(), 3, 3).error().code, ErrorCode::invalid_argument);
}

TEST(Resized, HalvingAveragesFourPixels) {
  const Image image = noise(12, 8, 3);
  const auto half = resized(image, 6, 4);
  ASSERT_TRUE(half);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 6; ++x) {
        const float mean = (image.at(2 * x, 2 * y, c) + image.at(2 * x + 1, 2 * y, c) + image.at(2 * x, 2 * y + 1, c) +
                            image.at(2 * x + 1, 2 * y + 1, c)) /
                           4;
        EXPECT_NEAR(half->at(x, y, c), mean, 1e-6f);
      }
}

std::string little(std::uint32_t value, int bytes = 4) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += char(value >> 8 * i & 255);
  return text;
}

std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  return name + '\0' + type + '\0' + little(std::uint32_t(value.size())) + value;
}

/// An EXR file whose header promises a picture that its bytes cannot hold.
///   compression  0: none, 3: zip, 4: piz, 9: dwab
///   tile_side    0: scan lines
std::vector<std::byte> promising_exr(std::uint32_t width, std::uint32_t height, int compression,
                                     std::uint32_t tile_side, int channels, std::size_t total_bytes) {
  const std::string window = little(0) + little(0) + little(width - 1) + little(height - 1);
  std::string list;
  for (int c = 0; c < channels; ++c)
    list += (channels == 1 ? std::string("Y") : "c" + std::to_string(1000 + c)) + '\0' + little(1) + little(0) +
            little(1) + little(1);
  std::string text = "\x76\x2f\x31\x01" + little(tile_side > 0 ? 0x202 : 2);
  text += attribute("channels", "chlist", list + '\0');
  text += attribute("compression", "compression", std::string(1, char(compression)));
  text += attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window);
  text += attribute("lineOrder", "lineOrder", std::string(1, '\0'));
  text += attribute("pixelAspectRatio", "float", little(0x3f800000));
  text += attribute("screenWindowCenter", "v2f", little(0) + little(0));
  text += attribute("screenWindowWidth", "float", little(0x3f800000));
  if (tile_side > 0) text += attribute("tiles", "tiledesc", little(tile_side) + little(tile_side) + '\0');
  text += '\0';
  text.resize(std::max(text.size(), total_bytes), '\0');
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

// 16 KB with tiles of 8192x8192 took half a second, larger ones 2 to 8: the library made room for tiles and lines, and
// began to read, before it saw that the file ends. Who is refused for the header's sake waits for none of it.
TEST(DecodeImage, BelievesNoHeaderThatPromisesMoreThanItsBytesCanHold) {
#ifdef __SANITIZE_ADDRESS__
  constexpr auto most_seconds = std::numeric_limits<double>::infinity();  // its account of what the library reserves
#else
  constexpr double most_seconds = 1;
#endif
  for (const int compression : {0, 3, 4, 9})
    for (const std::uint32_t tile : {0u, 8192u, 16384u, 0x40000000u})
      for (const std::uint32_t width : {16384u, 1448u}) {
        SCOPED_TRACE(std::to_string(compression) + " " + std::to_string(tile) + " " + std::to_string(width));
        Result<Image> image;
        const double seconds = support::processor_seconds(
            [&] { image = decode_image(promising_exr(width, width / 2, compression, tile, 1, 16384), "a.exr", {}); });
        EXPECT_LT(seconds, most_seconds);
        ASSERT_FALSE(image);
        EXPECT_EQ(image.error().code, ErrorCode::corrupt_data) << image.error().message;
        const bool is_believable = tile == 0 && width == 1448;  // 4 MB of pixels in 16 KB: zeros could be packed so
        EXPECT_EQ(image.error().message.find("its pixels") != std::string::npos, is_believable)
            << image.error().message;
      }
  const auto promised = decode_image(promising_exr(16384, 8192, 3, 0, 1, 16384), "a.exr", {});
  EXPECT_NE(promised.error().message.find("16384x8192 pixels and 1 channels; a file of 16384 bytes cannot hold them"),
            std::string::npos)
      << promised.error().message;
}

TEST(DecodeImage, BelievesPicturesOfOneColour) {
  const auto bytes = encode_image(Image(3600, 2400, 3), ImageFormat::png);
  ASSERT_TRUE(bytes);
  EXPECT_LT(bytes->size(), std::size_t{40'000});  // near the most that deflate can do
  EXPECT_TRUE(decode_image(*bytes, "black.png", {}));
}

}  // namespace
}  // namespace engine::io
