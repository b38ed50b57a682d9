// Pictures as files: PNG, JPEG, EXR, TIFF and WebP in; PNG, JPEG and EXR out. By content, never by name. Errors are in
// our own words: what a library says of a stranger's bytes may hold more than it should.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/image.h"

namespace engine::io {

/// What becomes of the alpha of a picture that is read.
enum class Alpha {
  on_black,  ///< Colour times alpha, 3 channels: the picture in front of black, as 3DGS trains on it.
  keep       ///< 4 channels where the file has alpha; colour as the file stores it.
};

/// How a picture is read, and the limits, which hold before memory is allocated. The limits are choices.
struct ImageOptions {
  Alpha alpha = Alpha::on_black;
  int max_side = 16384;                                   ///< Pixels; larger pictures are refused (too_large).
  std::uint64_t max_pixels = std::uint64_t{1} << 27;      ///< Pixels of 4 channels; more is refused (too_large).
  std::uint64_t max_file_bytes = std::uint64_t{1} << 30;  ///< Larger files are refused (too_large).
};

/// Size of a picture file.
struct PictureSize {
  int width = 0, height = 0;  ///< Pixels, as stored.
  bool operator==(const PictureSize&) const = default;
};

/// 3 channels (grey is repeated), or 4 (see Alpha). Integers of 8 or 16 bits become 0 to 1; floats stay as they are
/// and are taken to be display-referred. Limits hold before memory is allocated. Rows are those of the file, whatever
/// its EXIF data say of how it is to be turned: COLMAP and its kin calibrate cameras on these, and what the library
/// finds in damaged EXIF data is decided by memory that nobody wrote.
///   name    for error addresses
///   errors  unsupported: not one of the formats, or no R, G, B among the channels;
///           corrupt_data: damaged, cut short, NaN or infinity, or a header that promises more than 16 MiB and 2048
///           times the file's size;  too_large: names the limit
[[nodiscard]] Result<scene::Image> decode_image(std::span<const std::byte> bytes, const std::string& name,
                                                const ImageOptions& options = {});
/// The same from a file; errors of InputFile besides.
[[nodiscard]] Result<scene::Image> read_image(const std::filesystem::path& path, const ImageOptions& options = {});

/// Size of a picture from its header alone. Errors as read_image().
[[nodiscard]] Result<PictureSize> picture_size(const std::filesystem::path& path, const ImageOptions& options = {});

/// The formats that pictures are written in.
enum class ImageFormat { png, jpeg, exr };

/// By extension: .png, .jpg, .jpeg, .exr, in any case.
///   errors  unsupported
[[nodiscard]] Result<ImageFormat> format_of(const std::filesystem::path& path);

/// How a picture is written.
struct EncodeOptions {
  int jpeg_quality = 90;  ///< 1 to 100.
  int png_bits = 8;       ///< 8 or 16 per channel.
};

/// PNG: 1, 3 or 4 channels, lossless once quantised, alpha not multiplied into the colour. JPEG: 1 or 3 channels.
/// EXR: 1, 3 or 4 channels of float, as they are (its readers take colour to be multiplied by alpha). PNG and JPEG hold
/// round(max * clamp(x, 0, 1)); NaN becomes 0. Same picture, same bytes: no dates in the metadata.
///   errors  invalid_argument: the picture is empty, or the format cannot hold its channels; a bad option
[[nodiscard]] Result<std::vector<std::byte>> encode_image(const scene::Image& image, ImageFormat format,
                                                          const EncodeOptions& options = {});
/// Encodes by extension; the file appears whole or not at all (see AtomicFile).
[[nodiscard]] Result<void> write_image(const std::filesystem::path& path, const scene::Image& image,
                                       const EncodeOptions& options = {});

/// What a renderer knows about each pixel, as one EXR file with channels R G B, A and Z.
struct RenderLayers {
  const scene::Image* color = nullptr;  ///< 3 channels; display-referred floats, written as they are. May be absent.
  const scene::Image* alpha = nullptr;  ///< 1 channel; may be absent.
  const scene::Image* depth = nullptr;  ///< 1 channel; may be absent.
};
///   errors  invalid_argument: nothing to write, sizes or channels that do not fit
[[nodiscard]] Result<std::vector<std::byte>> encode_exr(const RenderLayers& layers);
[[nodiscard]] Result<void> write_exr(const std::filesystem::path& path, const RenderLayers& layers);

/// The filters of a change of size.
enum class ResizeFilter {
  box,      ///< Mean over the pixel's footprint when it shrinks, nearest pixel when it grows; never overshoots.
  lanczos3  ///< Sharper; may leave the range of the picture by a little at edges.
};

/// The picture scaled to width x height (each at least 1).
[[nodiscard]] Result<scene::Image> resized(const scene::Image& image, int width, int height,
                                           ResizeFilter filter = ResizeFilter::box);

}  // namespace engine::io
