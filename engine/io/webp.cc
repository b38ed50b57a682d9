#include "engine/io/webp.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <new>

namespace engine::io {
namespace {

constexpr int lossless_method = 4;     // of 0 to 6: beyond it, encoding takes several times as long for a percent
constexpr float lossless_effort = 75;  // of 0 to 100, the encoder's default
constexpr std::uint64_t decoder_bytes_per_pixel = 12;  // the library's own picture, ours, and a third for its tables

const std::uint8_t* octets(std::span<const std::byte> bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());
}

struct Written {
  WebPMemoryWriter writer;
  Written() { WebPMemoryWriterInit(&writer); }
  ~Written() { WebPMemoryWriterClear(&writer); }
  Written(const Written&) = delete;
  Written& operator=(const Written&) = delete;
};

struct EncoderPicture {
  WebPPicture picture{};
  bool ok = WebPPictureInit(&picture) != 0;
  EncoderPicture() = default;
  ~EncoderPicture() { WebPPictureFree(&picture); }
  EncoderPicture(const EncoderPicture&) = delete;
  EncoderPicture& operator=(const EncoderPicture&) = delete;
};

}  // namespace

Result<BytePicture> decode_webp(std::span<const std::byte> bytes, std::uint64_t max_pixels, MemoryBudget* budget,
                                const std::string& where) {
  WebPBitstreamFeatures features{};
  const auto status = WebPGetFeatures(octets(bytes), bytes.size(), &features);
  if (status == VP8_STATUS_NOT_ENOUGH_DATA)
    return fail(ErrorCode::corrupt_data, "the picture is cut short: copy or download the file again", where);
  if (status != VP8_STATUS_OK || features.has_animation != 0)
    return fail(ErrorCode::unsupported, "expected a WebP picture, and one that does not move", where);
  const auto pixels = std::uint64_t(features.width) * std::uint64_t(features.height);
  if (pixels > max_pixels)
    return fail(ErrorCode::corrupt_data,
                "a picture of " + std::to_string(features.width) + " x " + std::to_string(features.height) +
                    " pixels, where at most " + std::to_string(max_pixels) + " make sense",
                where);
  auto lent = take_from(budget, decoder_bytes_per_pixel * pixels, where);
  if (!lent) return propagate(lent);
  BytePicture picture;
  picture.memory = std::move(*lent);
  picture.width = std::size_t(features.width), picture.height = std::size_t(features.height);
  picture.rgba.resize(4 * picture.pixels());
  constexpr int lossless = 2;  // what libwebp calls the format
  picture.exact = features.format == lossless;
  if (WebPDecodeRGBAInto(octets(bytes), bytes.size(), picture.rgba.data(), picture.rgba.size(),
                         int(4 * picture.width)) == nullptr)
    return fail(ErrorCode::corrupt_data, "the picture cannot be decoded: copy or download the file again", where);
  return picture;
}

Result<std::vector<std::byte>> encode_webp(const BytePicture& picture, const std::string& where) {
  if (picture.width > WEBP_MAX_DIMENSION || picture.height > WEBP_MAX_DIMENSION)
    return fail(ErrorCode::too_large,
                "WebP pictures have at most " + std::to_string(WEBP_MAX_DIMENSION) + " pixels on a side: write a .ply",
                where);
  WebPConfig config;
  EncoderPicture in;
  Written out;
  if (WebPConfigInit(&config) == 0 || !in.ok) return fail(ErrorCode::internal, "libwebp is of another version", where);
  config.lossless = 1;
  config.exact = 1;  // or what lies under an alpha of 0 is made up
  config.method = lossless_method;
  config.quality = lossless_effort;
  in.picture.use_argb = 1;
  in.picture.width = int(picture.width), in.picture.height = int(picture.height);
  if (WebPPictureImportRGBA(&in.picture, picture.rgba.data(), int(4 * picture.width)) == 0) throw std::bad_alloc();
  in.picture.writer = WebPMemoryWrite;
  in.picture.custom_ptr = &out.writer;
  if (WebPEncode(&config, &in.picture) == 0) {
    if (in.picture.error_code == VP8_ENC_ERROR_OUT_OF_MEMORY ||
        in.picture.error_code == VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY)
      throw std::bad_alloc();
    return fail(ErrorCode::internal, "the picture could not be encoded", where);
  }
  const auto* first = reinterpret_cast<const std::byte*>(out.writer.mem);
  return std::vector<std::byte>(first, first + out.writer.size);
}

}  // namespace engine::io
