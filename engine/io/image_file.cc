#include "engine/io/image_file.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cctype>
#include <cmath>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string_view>

#include "engine/core/atomic_file.h"
#include "engine/core/finite.h"
#include "engine/io/input_file.h"
#include "engine/io/read_bytes.h"

namespace engine::io {
namespace {

using scene::Image;
namespace Filesystem = OIIO::Filesystem;

/// A format that is read: what people call it, and OpenImageIO.
struct Format {
  const char* name;
  const char* reader;
};

/// The format that these first bytes announce. We ask for that one reader by name: left to itself, the library tries
/// dozens of formats on what a stranger has sent. BMP is not among them: the library's reader of it puts memory that it
/// has not written into its messages.
std::optional<Format> sniff(std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 12));
  using namespace std::string_view_literals;
  if (text.starts_with("\x89PNG\r\n\x1a\n")) return Format{"PNG", "png"};
  if (text.starts_with("\xff\xd8\xff")) return Format{"JPEG", "jpeg"};
  if (text.starts_with("\x76\x2f\x31\x01")) return Format{"EXR", "openexr"};
  if (text.starts_with("II*\0"sv) || text.starts_with("MM\0*"sv)) return Format{"TIFF", "tiff"};
  if (text.starts_with("RIFF") && text.substr(std::min<std::size_t>(text.size(), 8)) == "WEBP")
    return Format{"WebP", "webp"};
  return std::nullopt;
}

std::size_t big_endian(std::span<const std::byte> bytes, std::size_t at, std::size_t size) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value = value << 8 | std::to_integer<std::size_t>(bytes[at + i]);
  return value;
}

/// Does the stream run to its end-of-image marker? libjpeg fills what is missing with grey and only warns.
bool jpeg_is_complete(std::span<const std::byte> bytes) {
  std::size_t at = 2;  // behind the start-of-image marker
  while (at + 2 <= bytes.size()) {
    const std::size_t marker = big_endian(bytes, at, 2);
    if (marker == 0xffd9) return true;
    const bool in_scan = marker < 0xff01 || marker == 0xffff || (marker >= 0xffd0 && marker <= 0xffd7);
    if (in_scan) {
      ++at;  // entropy-coded data, a stuffed or fill byte, a restart marker: on to the next 0xff
      const auto rest = bytes.subspan(at);
      const auto* next = static_cast<const std::byte*>(std::memchr(rest.data(), 0xff, rest.size()));
      at = next == nullptr ? bytes.size() : std::size_t(next - bytes.data());
    } else {
      if (at + 4 > bytes.size()) return false;
      at += 2 + big_endian(bytes, at + 2, 2);
    }
  }
  return false;
}

/// A JPEG without what stands in it beside the picture, EXIF data and comments: of damaged ones the library reads what
/// lies behind them in memory. The segments of JFIF and Adobe stay, which say what the channels are. Behind the start
/// of the first scan, where the library looks for none, all is as it was.
std::vector<std::byte> without_metadata(std::span<const std::byte> jpeg) {
  constexpr std::size_t jfif = 0xffe0, adobe = 0xffee, last_application = 0xffef, comment = 0xfffe, scan = 0xffda;
  std::vector<std::byte> out(jpeg.begin(), jpeg.begin() + 2);  // the start-of-image marker
  std::size_t at = 2;
  while (at + 4 <= jpeg.size()) {
    const std::size_t marker = big_endian(jpeg, at, 2);
    if (marker == 0xffff) {  // a fill byte
      ++at;
      continue;
    }
    const std::size_t end = at + 2 + big_endian(jpeg, at + 2, 2);
    if (marker < 0xffc0 || marker == scan || end > jpeg.size()) break;
    const bool is_metadata = marker == comment || (marker > jfif && marker <= last_application && marker != adobe);
    if (!is_metadata) out.insert(out.end(), jpeg.begin() + std::ptrdiff_t(at), jpeg.begin() + std::ptrdiff_t(end));
    at = end;
  }
  out.insert(out.end(), jpeg.begin() + std::ptrdiff_t(at), jpeg.end());
  return out;
}

/// Do the chunks run to IEND? Without it the last rows may still decode.
bool png_is_complete(std::span<const std::byte> bytes) {
  std::size_t at = 8;  // behind the signature
  while (bytes.size() >= 12 && at <= bytes.size() - 12) {
    const bool is_last = std::memcmp(bytes.data() + at + 4, "IEND", 4) == 0;
    at += 12 + big_endian(bytes, at, 4);
    if (is_last) return at <= bytes.size();
  }
  return false;
}

bool is_jpeg(const Format& format) { return std::string_view(format.name) == "JPEG"; }

bool is_complete(const Format& format, std::span<const std::byte> bytes) {
  return std::string_view(format.name) == "PNG" ? png_is_complete(bytes) : !is_jpeg(format) || jpeg_is_complete(bytes);
}

/// What a library says of a damaged file is written for its programmers, and what of the file or of memory stands in it
/// nobody has checked: it goes no further. Asked for all the same, or the library prints it.
template <class Speaker>
void drop_message_of(Speaker& speaker) {
  (void)speaker.geterror();
}

tl::unexpected<Error> damaged(const Format& format, const char* part, const std::string& name) {
  return fail(ErrorCode::corrupt_data,
              std::string("this ") + format.name + " picture is damaged: its " + part +
                  " cannot be decoded; copy or download it again, or save it anew",
              name);
}

/// The same where nobody knows how far the library came before it threw.
tl::unexpected<Error> undecodable(const std::string& name) {
  return fail(ErrorCode::corrupt_data, "the picture cannot be decoded: copy or download it again, or save it anew",
              name);
}

/// Bytes that a file may unpack to: what deflate makes of zeros, 1030 times its size, twice over, and some for small
/// pictures of one colour. Headers are believed that far and no further: 16 KB of EXR may ask for seconds of filling
/// gigabytes with nothing.
std::uint64_t believable_bytes(std::uint64_t file_bytes) { return (std::uint64_t{16} << 20) + 2048 * file_bytes; }

/// Bytes of the pixels as the file holds them. Tiles are decoded whole, however little of them is in the picture.
std::uint64_t unpacked_bytes(const OIIO::ImageSpec& spec) {
  const auto covered = [](int side, int tile) {
    const auto whole = std::uint64_t(side), step = std::uint64_t(std::max(tile, 1));
    return (whole + step - 1) / step * step;
  };
  std::uint64_t channel_bytes = spec.format.size();
  for (const auto& format : spec.channelformats) channel_bytes = std::max<std::uint64_t>(channel_bytes, format.size());
  const std::uint64_t columns = covered(spec.width, spec.tile_width), rows = covered(spec.height, spec.tile_height);
  constexpr auto all = std::numeric_limits<std::uint64_t>::max();
  const std::uint64_t pixels = columns > all / rows ? all : columns * rows;
  const std::uint64_t pixel_bytes = std::uint64_t(spec.nchannels) * channel_bytes;
  return pixels > all / pixel_bytes ? all : pixels * pixel_bytes;
}

/// A reader that is open on `source`; its size is within the limits.
Result<std::unique_ptr<OIIO::ImageInput>> open_reader(std::span<const std::byte> first_bytes,
                                                      Filesystem::IOProxy& source, const std::string& name,
                                                      const ImageOptions& options) {
  const auto format = sniff(first_bytes);
  if (!format)
    return fail(ErrorCode::unsupported, name + " is not a PNG, JPEG, EXR, TIFF or WebP picture: save it as one", name);
  auto reader = OIIO::ImageInput::create(format->reader);
  if (!reader)
    return fail(ErrorCode::unsupported, std::string("this build cannot read ") + format->name + " pictures", name);
  reader->threads(1);
  OIIO::ImageSpec spec, hints;
  hints.attribute("oiio:UnassociatedAlpha", 1);  // or integer colours come multiplied by alpha, and rounded
  if (!reader->set_ioproxy(&source) || !reader->open(name, spec, hints)) {
    drop_message_of(*reader);
    return damaged(*format, "header", name);
  }
  if (spec.width < 1 || spec.height < 1 || spec.depth > 1 || spec.nchannels < 1 || spec.deep)
    return fail(ErrorCode::corrupt_data, "the picture's header describes no flat picture", name);
  const std::string found = "the picture has " + std::to_string(spec.width) + "x" + std::to_string(spec.height) +
                            " pixels and " + std::to_string(spec.nchannels) + " channels; ";
  if (spec.width > options.max_side || spec.height > options.max_side)
    return fail(ErrorCode::too_large, found + "the limit is " + std::to_string(options.max_side) + " pixels a side",
                name);
  const std::uint64_t pixels = std::uint64_t(spec.width) * std::uint64_t(spec.height);
  if (pixels > options.max_pixels || pixels * std::uint64_t(spec.nchannels) > 4 * options.max_pixels)
    return fail(ErrorCode::too_large,
                found + "the limit is " + std::to_string(options.max_pixels) + " pixels of 4 channels", name);
  if (unpacked_bytes(spec) > believable_bytes(source.size()))
    return fail(ErrorCode::corrupt_data,
                found + "a file of " + std::to_string(source.size()) +
                    " bytes cannot hold them: it is incomplete, copy or download it again, or save it anew",
                name);
  return reader;
}

/// Where a picture's colour is among its channels.
struct ChannelLayout {
  std::array<int, 3> color{};
  int alpha = -1;  ///< -1: none
};

std::optional<ChannelLayout> find_channels(const OIIO::ImageSpec& spec) {
  const int r = spec.channelindex("R"), g = spec.channelindex("G"), b = spec.channelindex("B");
  if (r >= 0 && g >= 0 && b >= 0) return ChannelLayout{{r, g, b}, spec.alpha_channel};
  const int y = std::max(spec.channelindex("Y"), spec.channelindex("I"));
  if (y >= 0) return ChannelLayout{{y, y, y}, spec.alpha_channel};
  if (spec.nchannels == 1 && spec.z_channel < 0) return ChannelLayout{{0, 0, 0}, -1};
  return std::nullopt;
}

Result<Image> decode(std::span<const std::byte> bytes, const std::string& name, const ImageOptions& options) {
  // Asked before the library sees a byte: at the end of a PNG it leaks memory, of a JPEG it sees nothing wrong.
  const auto format = sniff(bytes);
  if (format && !is_complete(*format, bytes))
    return fail(ErrorCode::corrupt_data, "the picture ends before its last row: copy or download it again", name);
  std::vector<std::byte> plain;
  if (format && is_jpeg(*format)) plain = without_metadata(bytes), bytes = plain;
  Filesystem::IOMemReader source(const_cast<std::byte*>(bytes.data()), bytes.size());  // reads; takes a void*
  auto opened = open_reader(bytes, source, name, options);
  if (!opened) return propagate(opened);
  OIIO::ImageInput& reader = **opened;
  const OIIO::ImageSpec spec = reader.spec();
  const auto layout = find_channels(spec);
  if (!layout) return fail(ErrorCode::unsupported, "the picture has no channels R, G, B and none called Y", name);

  const auto channels = std::size_t(spec.nchannels);
  const std::size_t pixels = std::size_t(spec.width) * std::size_t(spec.height);
  std::vector<float> interleaved(pixels * channels);
  if (!reader.read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, interleaved.data())) {
    drop_message_of(reader);
    return damaged(*format, "pixels", name);
  }

  const bool with_alpha = layout->alpha >= 0;
  const bool multiply =
      with_alpha && options.alpha == Alpha::on_black && spec.get_int_attribute("oiio:UnassociatedAlpha") != 0;
  Image image(spec.width, spec.height, with_alpha && options.alpha == Alpha::keep ? 4 : 3);
  for (int c = 0; c < image.channels; ++c) {
    const auto from = std::size_t(c < 3 ? layout->color[std::size_t(c)] : layout->alpha);
    const auto plane = image.plane(c);
    for (std::size_t i = 0; i < pixels; ++i) {
      plane[i] = interleaved[i * channels + from];
      if (multiply) plane[i] *= interleaved[i * channels + std::size_t(layout->alpha)];
    }
  }
  if (const auto bad = first_not_finite(image.data))
    return fail(ErrorCode::corrupt_data, "a pixel is NaN or infinite",
                name + ":pixel[" + std::to_string(*bad % pixels % std::size_t(image.width)) + "," +
                    std::to_string(*bad % pixels / std::size_t(image.width)) + "]");
  return image;
}

tl::unexpected<Error> refused(std::string message) { return fail(ErrorCode::invalid_argument, std::move(message)); }

/// round(max * clamp(value, 0, 1)), halves upwards; 0 of NaN, of which no comparison is true. Without a call or a
/// branch: people wait for JPEGs, and so compilers take vectors of values, as this file is told to trap nothing
/// (CMakeLists.txt).
template <class T>
T nearest(float value) {
  constexpr float top = std::numeric_limits<T>::max();
  const float positive = value > 0.0f ? value : 0.0f;
  const float scaled = top * (positive < 1.0f ? positive : 1.0f);
  const int below = int(scaled);
  const float rest = scaled - float(below);  // exact, and so is twice of it
  return T(below + int(rest + rest));
}

/// Interleaved values of T's full range, as PNG and JPEG hold them, of a picture with so many channels.
template <class T, std::size_t kChannels>
std::vector<T> interleaved_steps(const Image& image) {
  const std::size_t pixels = image.pixels();
  std::vector<T> out(kChannels * pixels);
  // Rounded plane by plane, some pixels at a time, which vectors can do, and then dealt out.
  T steps[kChannels][256];
  for (std::size_t first = 0; first < pixels; first += std::size(steps[0])) {
    const std::size_t count = std::min(std::size(steps[0]), pixels - first);
    for (std::size_t c = 0; c < kChannels; ++c) {
      const float* const values = image.plane(int(c)).data() + first;
      for (std::size_t i = 0; i < count; ++i) steps[c][i] = nearest<T>(values[i]);
    }
    T* to = out.data() + kChannels * first;
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t c = 0; c < kChannels; ++c) *to++ = steps[c][i];
  }
  return out;
}

///   image  of 1, 3 or 4 channels
template <class T>
std::vector<T> quantised(const Image& image) {
  assert(image.channels == 1 || image.channels == 3 || image.channels == 4);
  return image.channels == 1   ? interleaved_steps<T, 1>(image)
         : image.channels == 3 ? interleaved_steps<T, 3>(image)
                               : interleaved_steps<T, 4>(image);
}

/// `pixels` holds interleaved values of spec.format.
Result<std::vector<std::byte>> encode(const char* format, OIIO::ImageSpec spec, const void* pixels) {
  // Without a DateTime the EXR writer stamps the time of day.
  if (std::string_view(format) == "openexr") spec.attribute("DateTime", "");
  std::vector<unsigned char> bytes;
  Filesystem::IOVecOutput target(bytes);
  auto writer = OIIO::ImageOutput::create(format);
  if (!writer) return fail(ErrorCode::unsupported, std::string("this build cannot write ") + format + " pictures");
  writer->threads(1);
  if (!writer->set_ioproxy(&target) || !writer->open(format, spec) || !writer->write_image(spec.format, pixels) ||
      !writer->close()) {
    drop_message_of(*writer);
    return fail(ErrorCode::internal, std::string("the picture could not be encoded as ") + format);
  }
  const auto* first = reinterpret_cast<const std::byte*>(bytes.data());
  return std::vector<std::byte>(first, first + bytes.size());
}

struct NamedPlane {
  const char* name;
  std::span<const float> values;
};

Result<std::vector<std::byte>> encode_planes(int width, int height, std::span<const NamedPlane> planes) {
  OIIO::ImageSpec spec(width, height, int(planes.size()), OIIO::TypeDesc::FLOAT);
  std::vector<float> interleaved(std::size_t(width) * std::size_t(height) * planes.size());
  for (std::size_t c = 0; c < planes.size(); ++c) {
    spec.channelnames[c] = planes[c].name;
    for (std::size_t i = 0; i < planes[c].values.size(); ++i) interleaved[i * planes.size() + c] = planes[c].values[i];
  }
  spec.alpha_channel = spec.channelindex("A");
  spec.z_channel = spec.channelindex("Z");
  spec.attribute("compression", "zip");
  return encode("openexr", spec, interleaved.data());
}

bool is_consistent(const Image& image) {
  return image.width > 0 && image.height > 0 && image.channels > 0 &&
         image.data.size() == image.pixels() * std::size_t(image.channels);
}

}  // namespace

Result<Image> decode_image(std::span<const std::byte> bytes, const std::string& name, const ImageOptions& options) {
  try {
    return decode(bytes, name, options);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, name + " does not fit into the memory of this machine", name);
  } catch (const std::exception&) {
    return undecodable(name);
  }
}

Result<Image> read_image(const std::filesystem::path& path, const ImageOptions& options) {
  const auto bytes = read_bytes(path, options.max_file_bytes);
  if (!bytes) return propagate(bytes);
  return decode_image(*bytes, path.filename().string(), options);
}

Result<PictureSize> picture_size(const std::filesystem::path& path, const ImageOptions& options) {
  const auto file = InputFile::open(path);
  if (!file) return propagate(file);
  const auto first_bytes = file->read_at(0, std::min<std::uint64_t>(file->size(), 12));
  if (!first_bytes) return propagate(first_bytes);
  try {
    const auto size_by = [&](Filesystem::IOProxy& source) -> Result<PictureSize> {
      const auto reader = open_reader(*first_bytes, source, file->name(), options);
      if (!reader) return propagate(reader);
      return PictureSize{(*reader)->spec().width, (*reader)->spec().height};
    };
    if (const auto format = sniff(*first_bytes); format && is_jpeg(*format)) {
      const auto bytes = read_bytes(path, options.max_file_bytes);
      if (!bytes) return propagate(bytes);
      std::vector<std::byte> plain = without_metadata(*bytes);
      Filesystem::IOMemReader source(plain.data(), plain.size());
      return size_by(source);
    }
    Filesystem::IOFile source(path.string(), Filesystem::IOProxy::Read);
    return size_by(source);
  } catch (const std::exception&) {
    return undecodable(file->name());
  }
}

Result<ImageFormat> format_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
  if (extension == ".png") return ImageFormat::png;
  if (extension == ".jpg" || extension == ".jpeg") return ImageFormat::jpeg;
  if (extension == ".exr") return ImageFormat::exr;
  return fail(ErrorCode::unsupported, "pictures are written as .png, .jpg or .exr; found " + path.filename().string(),
              path.filename().string());
}

Result<std::vector<std::byte>> encode_image(const Image& image, ImageFormat format, const EncodeOptions& options) {
  if (!is_consistent(image)) return refused("the picture is empty");
  const bool jpeg = format == ImageFormat::jpeg;
  if (image.channels != 1 && image.channels != 3 && (image.channels != 4 || jpeg))
    return refused(std::string(jpeg ? "JPEG holds 1 or 3" : "PNG and EXR hold 1, 3 or 4") +
                   " channels; the picture has " + std::to_string(image.channels));
  if (options.jpeg_quality < 1 || options.jpeg_quality > 100) return refused("jpeg_quality: expected 1 to 100");
  if (options.png_bits != 8 && options.png_bits != 16) return refused("png_bits: expected 8 or 16");

  OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  spec.attribute("oiio:ColorSpace", "sRGB");
  switch (format) {
    case ImageFormat::png:
      if (options.png_bits == 8) return encode("png", spec, quantised<std::uint8_t>(image).data());
      spec.set_format(OIIO::TypeDesc::UINT16);
      return encode("png", spec, quantised<std::uint16_t>(image).data());
    case ImageFormat::jpeg:
      spec.attribute("CompressionQuality", options.jpeg_quality);
      return encode("jpeg", spec, quantised<std::uint8_t>(image).data());
    case ImageFormat::exr:
      break;
  }
  constexpr const char *grey[] = {"Y"}, *color[] = {"R", "G", "B", "A"};
  std::vector<NamedPlane> planes;
  planes.reserve(std::size_t(image.channels));
  for (int c = 0; c < image.channels; ++c) planes.push_back({image.channels == 1 ? grey[c] : color[c], image.plane(c)});
  return encode_planes(image.width, image.height, planes);
}

Result<std::vector<std::byte>> encode_exr(const RenderLayers& layers) {
  const Image* first = layers.color ? layers.color : layers.alpha ? layers.alpha : layers.depth;
  if (first == nullptr) return refused("expected colour, alpha or depth; found none of them");
  std::vector<NamedPlane> planes;
  const auto add = [&](const Image* layer, std::initializer_list<const char*> names) {
    if (layer == nullptr) return true;
    if (!is_consistent(*layer) || layer->channels != int(names.size()) || layer->width != first->width ||
        layer->height != first->height)
      return false;
    for (int c = 0; const char* name : names) planes.push_back({name, layer->plane(c++)});
    return true;
  };
  if (!add(layers.color, {"R", "G", "B"}) || !add(layers.alpha, {"A"}) || !add(layers.depth, {"Z"}))
    return refused("expected layers of one size: colour of 3 channels, alpha and depth of 1");
  return encode_planes(first->width, first->height, planes);
}

Result<void> write_exr(const std::filesystem::path& path, const RenderLayers& layers) {
  const auto bytes = encode_exr(layers);
  if (!bytes) return propagate(bytes);
  return write_file(path, *bytes);
}

Result<void> write_image(const std::filesystem::path& path, const Image& image, const EncodeOptions& options) {
  const auto format = format_of(path);
  if (!format) return propagate(format);
  const auto bytes = encode_image(image, *format, options);
  if (!bytes) return propagate(bytes);
  return write_file(path, *bytes);
}

Result<Image> resized(const Image& image, int width, int height, ResizeFilter filter) {
  if (!is_consistent(image)) return refused("the picture is empty");
  if (width < 1 || height < 1) return refused("expected a size of at least 1x1 pixels");
  if (width == image.width && height == image.height) return image;
  Image out(width, height, image.channels);
  for (int c = 0; c < image.channels; ++c) {
    const OIIO::ImageSpec from_spec(image.width, image.height, 1, OIIO::TypeDesc::FLOAT);
    const OIIO::ImageSpec to_spec(width, height, 1, OIIO::TypeDesc::FLOAT);
    const OIIO::ImageBuf from(from_spec, const_cast<float*>(image.plane(c).data()));  // only read; takes a void*
    OIIO::ImageBuf to(to_spec, out.plane(c).data());
    const char* name = filter == ResizeFilter::box ? "box" : "lanczos3";
    if (!OIIO::ImageBufAlgo::resize(to, from, name, 0.0f, {}, /*nthreads=*/1)) {
      drop_message_of(to);
      return fail(ErrorCode::internal, "the picture could not be brought to another size");
    }
  }
  return out;
}

}  // namespace engine::io
