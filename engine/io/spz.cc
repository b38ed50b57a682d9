#include "engine/io/spz.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <numbers>
#include <numeric>
#include <string_view>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/parallel.h"
#include "engine/io/axes.h"
#include "engine/io/checks.h"
#include "engine/io/gzip.h"
#include "engine/io/quantised.h"

namespace engine::io {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::uint32_t magic = 0x5053474e;  // "NGSP"
constexpr std::size_t rows_per_task = 4096;  // of a parallel task: a choice
constexpr std::size_t header_bytes = 16;
constexpr std::size_t max_deflate_ratio = 1032;  // of deflate: 258 bytes for every 2 bits
constexpr std::size_t max_zstd_ratio = 32768;    // of Zstandard: 128 KiB, a block's most, for 4 bytes
constexpr double farthest_fixed = 8388608;       // steps, of a position in 24 bits
constexpr std::uint8_t flag_antialiased = 1, flag_extensions = 2;
constexpr std::uint32_t v4_header_bytes = 32;
constexpr std::uint32_t axes_extension = 0xADBE0003;     // SPZ_ADOBE_coordinate_system: 4 bytes, an index as below
constexpr std::uint64_t axes_record_bytes = 12;          // with type and length
constexpr std::uint64_t max_extension_bytes = 1u << 20;  // of all records but the axes': a choice; those known take 20
constexpr int zstd_level = 9;                            // a choice: beyond it, seconds buy a percent or two
constexpr std::string_view usual_axes = "RUB";           // of a file that declares none

/// What the axes extension counts; 0 is "unspecified". The format's library has had 9 to 16 in another order for some
/// weeks before the extension was released; files hold this one.
constexpr std::array<std::string_view, 17> axes_by_number = {
    "", "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF", "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU"};

struct Header {
  std::uint32_t version = 0;
  std::uint32_t count = 0;
  int sh_degree = 0;
  int fractional_bits = 0;
  std::uint8_t flags = 0;
  std::uint8_t streams = 0;  ///< Version 4 only.

  [[nodiscard]] std::size_t position_bytes() const { return version == 1 ? 6 : 9; }
  [[nodiscard]] std::size_t rotation_bytes() const { return version <= 2 ? 3 : 4; }
  [[nodiscard]] std::size_t sh_bytes() const { return 3 * (scene::sh_coefficients(sh_degree) - 1); }
};

/// The attributes of all Gaussians, in the order of the file.
struct Attributes {
  Bytes positions, alphas, colors, scales, rotations, sh;
  MemoryBudget::Share memory = {};  ///< That they take.
};

struct AttributeRow {
  const char* name;
  Bytes Attributes::*bytes;
  std::size_t size;  ///< Bytes per Gaussian.
};

std::array<AttributeRow, 6> attribute_rows(const Header& header) {
  return {{{"positions", &Attributes::positions, header.position_bytes()},
           {"alphas", &Attributes::alphas, 1},
           {"colors", &Attributes::colors, 3},
           {"scales", &Attributes::scales, 3},
           {"rotations", &Attributes::rotations, header.rotation_bytes()},
           {"sh", &Attributes::sh, header.sh_bytes()}}};
}

std::uint64_t packed_row_bytes(const Header& header) {
  std::uint64_t sum = 0;
  for (const auto& row : attribute_rows(header)) sum += row.size;
  return sum;
}

tl::unexpected<Error> damaged(const std::string& message, const std::string& where) {
  return fail(ErrorCode::corrupt_data, message + ": the file is damaged or incomplete, copy or download it again",
              where);
}

/// The 16 bytes all versions begin with.
Result<Header> parse_header(std::span<const std::byte> bytes, std::uint32_t min_version, std::uint32_t max_version,
                            const std::string& where) {
  ByteReader in(bytes);
  const auto found_magic = in.read<std::uint32_t>();
  Header header;
  header.version = in.read<std::uint32_t>();
  header.count = in.read<std::uint32_t>();
  header.sh_degree = in.read<std::uint8_t>();
  header.fractional_bits = in.read<std::uint8_t>();
  header.flags = in.read<std::uint8_t>();
  header.streams = in.read<std::uint8_t>();
  if (!in.ok()) return damaged("an .spz header has 16 bytes; fewer are there", where);
  if (found_magic != magic)
    return fail(ErrorCode::unsupported, "a gzip file, but there is no .spz scene in it; unpack it first", where);
  if (header.version < min_version || header.version > max_version)
    return fail(ErrorCode::unsupported,
                ".spz version " + std::to_string(header.version) + " in this container is unknown; expected " +
                    std::to_string(min_version) + " to " + std::to_string(max_version),
                where);
  if (header.sh_degree > scene::max_sh_degree)
    return fail(ErrorCode::unsupported,
                "SH degree " + std::to_string(header.sh_degree) + "; 0 to 3 is supported: export with degree 3", where);
  if (header.fractional_bits > 24)
    return damaged(std::to_string(header.fractional_bits) + " fractional bits in positions of 24 bits", where);
  return header;
}

Result<void> check_limits(const Header& header, const ReadOptions& options, const std::string& file) {
  return check_limits(header.count, cloud_row_bytes(header.sh_degree) + packed_row_bytes(header), options, file);
}

/// Could a file of that size unpack to what its header announces?
bool plausible(const Header& header, std::uint64_t file_bytes) {
  const std::size_t ratio = header.version == 4 ? max_zstd_ratio : max_deflate_ratio;
  return header.count * packed_row_bytes(header) / ratio <= file_bytes;
}

Result<void> check_plausible(const Header& header, std::uint64_t file_bytes, const std::string& where) {
  if (plausible(header, file_bytes)) return {};
  return damaged("the header announces " + std::to_string(header.count) + " Gaussians, more than " +
                     std::to_string(file_bytes) + " bytes can unpack to",
                 where);
}

Result<void> lend(const Header& header, const ReadOptions& options, const std::string& file, Attributes& attributes) {
  auto share = take_from(options.memory, header.count * packed_row_bytes(header), file);
  if (!share) return propagate(share);
  attributes.memory = std::move(*share);
  return {};
}

/// Records of a type, a length and that many bytes, one after the other. The axes go to origin.axes, all else is kept.
Result<void> read_extensions(std::span<const std::byte> bytes, const std::string& where, SceneOrigin& origin) {
  const auto too_large = [&] {
    return fail(ErrorCode::too_large,
                "the extensions take more than the limit of " + std::to_string(max_extension_bytes) + " bytes", where);
  };
  if (bytes.size() > max_extension_bytes + axes_record_bytes) return too_large();
  std::uint64_t kept_bytes = 0;
  ByteReader in(bytes);
  while (in.remaining() > 0) {
    const auto type = in.read<std::uint32_t>(), size = in.read<std::uint32_t>();
    const auto payload = in.take(size);
    if (!in.ok()) return damaged("the last extension is longer than the room it has", where);
    if (type != axes_extension) {
      // A file of version 4 that is written of these has the axes besides, and must be read again.
      kept_bytes += 2 * sizeof(std::uint32_t) + size;
      if (kept_bytes > max_extension_bytes) return too_large();
      origin.spz_extensions.push_back({type, {payload.begin(), payload.end()}});
      continue;
    }
    ByteReader value(payload);
    const auto number = value.read<std::uint32_t>();
    if (!value.ok() || value.remaining() > 0)
      return damaged("the extension that declares the axes has 4 bytes, not " + std::to_string(size), where);
    if (number >= axes_by_number.size())
      return fail(ErrorCode::unsupported,
                  "the file declares its axes as number " + std::to_string(number) + "; 0 to 16 are known", where);
    origin.axes_declared = number != 0;
    origin.axes = number == 0 ? usual_axes : axes_by_number[number];
  }
  return {};
}

/// Versions 1 to 3: header, attributes and, with a flag, extensions in one gzip stream.
Result<Header> unpack_gzip(std::span<const std::byte> bytes, const std::string& file, const ReadOptions& options,
                           Attributes& attributes, SceneOrigin& origin) {
  GzipReader in(bytes);
  std::array<std::byte, header_bytes> start;
  if (!in.read(start)) return damaged("no .spz header could be unpacked", file + ":header");
  auto header = parse_header(start, 1, 3, file + ":header");
  if (!header) return header;
  if (auto checked = check_limits(*header, options, file); !checked) return propagate(checked);
  if (auto checked = check_plausible(*header, bytes.size(), file + ":header"); !checked) return propagate(checked);
  if (auto lent = lend(*header, options, file, attributes); !lent) return propagate(lent);
  for (const auto& row : attribute_rows(*header)) {
    Bytes& unpacked = attributes.*row.bytes;
    unpacked.resize(header->count * row.size);
    if (!in.read(unpacked))
      return damaged(
          std::string(row.name) + " of " + std::to_string(header->count) + " Gaussians could not be unpacked",
          file + ":" + row.name);
  }
  if (header->flags & flag_extensions) {
    Bytes records(max_extension_bytes + axes_record_bytes + 1);
    records.resize(in.read_some(records));
    if (auto read = read_extensions(records, file + ":extensions", origin); !read) return propagate(read);
  }
  if (!in.at_end()) return damaged("the file does not end after the last Gaussian", file);
  return header;
}

/// Version 4: a plain header, a table of sizes, one zstd stream per attribute that is not empty.
Result<Header> unpack_zstd(std::span<const std::byte> bytes, const std::string& file, const ReadOptions& options,
                           Attributes& attributes, SceneOrigin& origin) {
  const std::string where = file + ":header";
  ByteReader in(bytes);
  auto header = parse_header(in.take(std::min(header_bytes, bytes.size())), 4, 4, where);
  if (!header) return header;
  if (auto checked = check_limits(*header, options, file); !checked) return propagate(checked);
  if (auto checked = check_plausible(*header, bytes.size(), where); !checked) return propagate(checked);
  const auto toc_offset = in.read<std::uint32_t>();
  if (!in.ok() || toc_offset < v4_header_bytes || toc_offset > bytes.size())
    return damaged("the table of contents lies outside the file", where);
  if (const auto zone = bytes.subspan(v4_header_bytes, toc_offset - v4_header_bytes); header->flags & flag_extensions) {
    if (auto read = read_extensions(zone, file + ":extensions", origin); !read) return propagate(read);
  } else if (!zone.empty()) {
    origin.left_out.push_back(std::to_string(zone.size()) +
                              " bytes before the table of contents, which the header does not call extensions");
  }
  std::vector<AttributeRow> present;
  for (const auto& row : attribute_rows(*header))
    if (row.size > 0) present.push_back(row);
  if (header->streams != present.size())
    return damaged("expected " + std::to_string(present.size()) + " streams, found " + std::to_string(header->streams),
                   where);

  if (auto lent = lend(*header, options, file, attributes); !lent) return propagate(lent);
  ByteReader table(bytes.subspan(toc_offset));  // extensions, if any, lie before it
  constexpr std::uint64_t entry_bytes = 16;
  ByteReader streams = table;
  (void)streams.take(present.size(), entry_bytes);
  for (const auto& row : present) {
    const auto packed_size = table.read<std::uint64_t>(), size = table.read<std::uint64_t>();
    const std::uint64_t expected = header->count * row.size;
    const auto packed = streams.take(packed_size);
    if (!table.ok() || !streams.ok()) return damaged("the file ends within the streams", file + ":" + row.name);
    if (size != expected)
      return damaged(std::to_string(header->count) + " Gaussians have " + std::to_string(expected) + " bytes of " +
                         row.name + "; the table of contents says " + std::to_string(size),
                     file + ":" + row.name);
    // Some writers leave the size out of the frame; one that is there must agree before room is made for it.
    const auto stated = ZSTD_getFrameContentSize(packed.data(), packed.size());
    if (stated != ZSTD_CONTENTSIZE_UNKNOWN && stated != expected)
      return damaged(std::string(row.name) + " could not be unpacked", file + ":" + row.name);
    Bytes& unpacked = attributes.*row.bytes;
    unpacked.resize(expected);
    if (ZSTD_decompress(unpacked.data(), unpacked.size(), packed.data(), packed.size()) != expected)
      return damaged(std::string(row.name) + " could not be unpacked", file + ":" + row.name);
  }
  if (streams.remaining() != 0)
    return damaged(std::to_string(streams.remaining()) + " bytes follow the last stream", file);
  return header;
}

std::uint32_t byte_at(const Bytes& bytes, std::size_t i) { return std::to_integer<std::uint32_t>(bytes[i]); }

std::uint32_t word_at(const Bytes& bytes, std::size_t i) {
  std::uint32_t word;
  std::memcpy(&word, bytes.data() + 4 * i, sizeof word);
  return word;
}

float half_to_float(std::uint32_t half) {
  const int exponent = int(half >> 10 & 31u);
  const auto fraction = float(half & 1023u);
  const float sign = half & 0x8000u ? -1.0f : 1.0f;
  if (exponent == 31)
    return fraction == 0 ? sign * std::numeric_limits<float>::infinity() : std::numeric_limits<float>::quiet_NaN();
  if (exponent == 0) return sign * std::ldexp(fraction, -24);
  return sign * std::ldexp(1024.0f + fraction, exponent - 25);
}

Vec3 position_at(const Header& header, const Bytes& bytes, std::size_t i) {
  Vec3 position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (header.version == 1) {
      const std::size_t at = 6 * i + 2 * axis;
      position[int(axis)] = half_to_float(byte_at(bytes, at) | byte_at(bytes, at + 1) << 8);
    } else {
      const std::size_t at = 9 * i + 3 * axis;
      const std::uint32_t raw = byte_at(bytes, at) | byte_at(bytes, at + 1) << 8 | byte_at(bytes, at + 2) << 16;
      const int fixed = int(raw) - (raw & 0x800000u ? 0x1000000 : 0);
      position[int(axis)] = std::ldexp(float(fixed), -header.fractional_bits);
    }
  }
  return position;
}

/// Versions 1 and 2: x y z in a byte each, w from the unit length.
Quat rotation_first_three(const Bytes& bytes, std::size_t i) {
  std::array<double, 3> v;
  double square = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    v[c] = byte_at(bytes, 3 * i + c) / 127.5 - 1.0;
    square += v[c] * v[c];
  }
  return {float(std::sqrt(std::max(0.0, 1.0 - square))), float(v[0]), float(v[1]), float(v[2])};
}

/// Versions 3 and 4: the three smallest of (x, y, z, w) in 10 bits each, the largest from the unit length.
Quat rotation_smallest_three(std::uint32_t word) {
  const std::size_t largest = word >> 30;
  std::array<double, 4> q{};
  double square = 0;
  for (std::size_t c = 4; c-- > 0;) {  // the highest index lies in the lowest bits
    if (c == largest) continue;
    q[c] = (word & 511u) / 511.0 / std::numbers::sqrt2 * (word & 512u ? -1.0 : 1.0);
    square += q[c] * q[c];
    word >>= 10;
  }
  q[largest] = std::sqrt(std::max(0.0, 1.0 - square));
  return {float(q[3]), float(q[0]), float(q[1]), float(q[2])};
}

std::uint32_t packed_rotation_once(Quat rotation) {
  std::array<double, 4> q = {rotation.x, rotation.y, rotation.z, rotation.w};
  double square = 0;
  for (const double c : q) square += c * c;
  if (square == 0) q = {0, 0, 0, square = 1};  // no rotation to speak of: the identity
  std::size_t largest = 0;
  for (std::size_t c = 1; c < 4; ++c)
    if (std::abs(q[c]) > std::abs(q[largest])) largest = c;
  std::uint32_t word = std::uint32_t(largest);
  for (std::size_t c = 0; c < 4; ++c) {
    if (c == largest) continue;
    const double unit = std::abs(q[c]) / std::sqrt(square) * std::numbers::sqrt2;  // at most 1
    const auto magnitude = std::uint32_t(std::min(std::lround(unit * 511.0), 511L));
    const bool negative = magnitude > 0 && (q[c] < 0) != (q[largest] < 0);  // q and -q are one rotation
    word = word << 10 | std::uint32_t(negative) << 9 | magnitude;
  }
  return word;
}

std::uint32_t packed_rotation(Quat rotation) {
  return stable_rotation(rotation, packed_rotation_once, rotation_smallest_three);
}

/// One row of a cloud that is in the file's frame, as row `at` of the file.
void pack_row(const scene::GaussianCloud& cloud, std::size_t i, const Header& header, Attributes& out, std::size_t at) {
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  const Vec3 mean = cloud.mean.get(i), log_scale = cloud.log_scale.get(i);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double steps = std::round(std::ldexp(double(mean[int(axis)]), header.fractional_bits));
    // 24 bits reach one step farther down than up; a turn may put what came from there at the other end.
    const auto fixed = std::uint32_t(std::int32_t(std::clamp(steps, -farthest_fixed, farthest_fixed - 1)));
    for (std::size_t b = 0; b < 3; ++b) out.positions[9 * at + 3 * axis + b] = std::byte(fixed >> 8 * b & 255u);
    out.scales[3 * at + axis] =
        std::byte(nearest_byte((double(log_scale[int(axis)]) - spz_least_log_scale) * spz_log_scale_steps));
  }
  out.alphas[at] = std::byte(byte_of_logit(cloud.opacity_logit[i]));
  const std::uint32_t rotation = packed_rotation(cloud.rotation.get(i));
  std::memcpy(out.rotations.data() + 4 * at, &rotation, sizeof rotation);
  const auto sh = cloud.sh_row(i);
  for (std::size_t c = 0; c < 3; ++c) {
    out.colors[3 * at + c] = std::byte(nearest_byte((double(sh[c * coefficients]) * spz_colour_scale + 0.5) * 255.0));
    // All 8 bits of each coefficient: Niantic's writer keeps 4 or 5 to pack better, which costs quality.
    for (std::size_t k = 1; k < coefficients; ++k)
      out.sh[(at * (coefficients - 1) + k - 1) * 3 + c] =
          std::byte(nearest_byte(double(sh[c * coefficients + k]) * spz_sh_steps + 128.0));
  }
}

void write_header(ByteWriter& out, const Header& header) {
  out.write(magic), out.write(header.version), out.write(header.count);
  out.write(std::uint8_t(header.sh_degree)), out.write(std::uint8_t(header.fractional_bits));
  out.write(header.flags), out.write(header.streams);
}

Bytes pack_gzip(const Header& header, const Attributes& attributes, std::span<const std::byte> extensions) {
  ByteWriter out;
  write_header(out, header);
  for (const auto& row : attribute_rows(header)) out.write_all(std::span(attributes.*row.bytes));
  out.write_all(extensions);
  return gzip(out.bytes());
}

Bytes pack_zstd(Header header, const Attributes& attributes, std::span<const std::byte> extensions) {
  std::vector<Bytes> streams;
  ByteWriter table;
  for (const auto& row : attribute_rows(header)) {
    const Bytes& bytes = attributes.*row.bytes;
    if (bytes.empty()) continue;
    Bytes& packed = streams.emplace_back(ZSTD_compressBound(bytes.size()));
    const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), zstd_level);
    if (ZSTD_isError(size)) throw std::bad_alloc();  // all that can go wrong where there is room for the worst case
    packed.resize(size);
    table.write(std::uint64_t(packed.size())), table.write(std::uint64_t(bytes.size()));
  }
  header.streams = std::uint8_t(streams.size());
  ByteWriter out;
  write_header(out, header);
  out.write(std::uint32_t(v4_header_bytes + extensions.size()));
  for (int reserved = 0; reserved < 3; ++reserved) out.write(std::uint32_t{0});
  out.write_all(extensions);
  out.write_all(table.bytes());
  for (const Bytes& stream : streams) out.write_all(std::span(stream));
  const auto bytes = out.bytes();
  return {bytes.begin(), bytes.end()};
}

/// Fractional bits with which every mean fits 24 bits: 12 as everybody writes, fewer for scenes beyond +-2048.
Result<int> fractional_bits_for(const scene::GaussianCloud& cloud, const std::string& file) {
  double farthest = 0;
  for (const auto* axis : {&cloud.mean.x, &cloud.mean.y, &cloud.mean.z})
    for (const float x : *axis) farthest = std::max(farthest, std::abs(double(x)));
  for (int bits = 12; bits >= 0; --bits)
    if (std::round(std::ldexp(farthest, bits)) <= farthest_fixed) return bits;
  return fail(ErrorCode::unprocessable,
              "a Gaussian lies " + std::to_string(farthest) +
                  " units from the origin; .spz reaches 8388608: write a .ply, or move the scene to the origin",
              file);
}

}  // namespace

bool looks_like_spz(std::span<const std::byte> bytes) {
  const auto begins = [&](std::initializer_list<int> start) {
    return bytes.size() >= start.size() &&
           std::equal(start.begin(), start.end(), bytes.begin(), [](int a, std::byte b) { return std::byte(a) == b; });
  };
  return begins({0x1f, 0x8b}) || begins({'N', 'G', 'S', 'P'});
}

std::uint64_t expected_spz_bytes(std::span<const std::byte> start, std::uint64_t file_bytes) {
  std::array<std::byte, header_bytes> unpacked{};
  const bool plain = !start.empty() && start[0] == std::byte{'N'};
  if (!plain && !GzipReader(start).read(unpacked)) return file_bytes;
  const auto header = parse_header(plain ? start.first(std::min(start.size(), header_bytes)) : unpacked, 1, 4, "");
  if (!header) return file_bytes;
  if (!plausible(*header, file_bytes)) return file_bytes;
  return std::max(file_bytes, header->count * cloud_row_bytes(header->sh_degree));
}

Result<SpzCount> read_spz_header(std::span<const std::byte> bytes, const std::string& file) {
  std::array<std::byte, header_bytes> unpacked{};
  const bool plain = !bytes.empty() && bytes[0] == std::byte{'N'};
  if (!plain && !GzipReader(bytes).read(unpacked)) return damaged("no .spz header could be unpacked", file);
  const auto header = parse_header(plain ? bytes.first(std::min(bytes.size(), header_bytes)) : unpacked, 1, 4, file);
  if (!header) return propagate(header);
  if (auto checked = check_plausible(*header, bytes.size(), file); !checked) return propagate(checked);
  return SpzCount{header->count, header->sh_degree};
}

Result<DecodedScene> decode_spz(std::span<const std::byte> bytes, const std::string& file, const ReadOptions& options) {
  Attributes in;
  DecodedScene scene;
  SceneOrigin& origin = scene.origin;
  origin.format = SceneFormat::spz;
  origin.axes = usual_axes;
  const bool plain = !bytes.empty() && bytes[0] == std::byte{'N'};
  const auto header =
      plain ? unpack_zstd(bytes, file, options, in, origin) : unpack_gzip(bytes, file, options, in, origin);
  if (!header) return propagate(header);
  origin.version = int(header->version);
  origin.packing = plain ? "zstd" : "gzip";
  origin.antialiased = (header->flags & flag_antialiased) != 0;
  if (options.spz_frame == SpzFrame::as_stored) origin.axes = "RDF", origin.axes_declared = false;
  const Turn to_rdf(rdf_from(origin.axes));
  scene::GaussianCloud& cloud = scene.cloud;
  cloud.sh_degree = header->sh_degree;
  cloud.resize(header->count);
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      cloud.mean.set(i, position_at(*header, in.positions, i));
      cloud.opacity_logit[i] = logit_of_byte(std::to_integer<std::uint8_t>(in.alphas[i]));
      const auto log_scale = [&](std::size_t axis) {
        return float(byte_at(in.scales, 3 * i + axis) / spz_log_scale_steps + spz_least_log_scale);
      };
      cloud.log_scale.set(i, {log_scale(0), log_scale(1), log_scale(2)});
      cloud.rotation.set(i, header->version <= 2 ? rotation_first_three(in.rotations, i)
                                                 : rotation_smallest_three(word_at(in.rotations, i)));
      const auto sh = cloud.sh_row(i);
      for (std::size_t c = 0; c < 3; ++c) {
        sh[c * coefficients] = float((byte_at(in.colors, 3 * i + c) / 255.0 - 0.5) / spz_colour_scale);
        for (std::size_t k = 1; k < coefficients; ++k)
          sh[c * coefficients + k] =
              float((byte_at(in.sh, (i * (coefficients - 1) + k - 1) * 3 + c) - 128.0) / spz_sh_steps);
      }
      to_rdf.apply(cloud, i);
    }
  });
  if (auto finite = check_finite(cloud, file); !finite) return propagate(finite);
  return scene;
}

Result<Bytes> encode_spz(const scene::GaussianCloud& cloud, const std::string& file, const SpzOptions& options) {
  assert(options.version == 3 || options.version == 4);
  const auto number = std::ranges::find(axes_by_number, std::string_view(options.axes)) - axes_by_number.begin();
  if (std::size_t(number) >= axes_by_number.size() || number == 0)
    return fail(ErrorCode::invalid_argument, "axes '" + options.axes + "' cannot be declared in an .spz file", file);
  const auto bits = fractional_bits_for(cloud, file);
  if (!bits) return propagate(bits);
  Header header;
  header.version = std::uint32_t(options.version);
  header.count = std::uint32_t(cloud.size());
  header.sh_degree = cloud.sh_degree;
  header.fractional_bits = *bits;
  // Version 4 always says what its axes are. Older readers take older versions for RUB, and need not be told that.
  const bool declares = options.version == 4 || options.axes != usual_axes;
  header.flags = std::uint8_t((options.antialiased ? flag_antialiased : 0) |
                              (declares || !options.extensions.empty() ? flag_extensions : 0));

  Attributes out;
  for (const auto& row : attribute_rows(header)) (out.*row.bytes).resize(cloud.size() * row.size);
  const Turn from_rdf(glm::transpose(rdf_from(options.axes)));
  parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> rows(end - begin);
    std::iota(rows.begin(), rows.end(), std::uint32_t(begin));
    scene::GaussianCloud turned = scene::gather(cloud, rows);
    for (std::size_t i = 0; i < turned.size(); ++i) {
      from_rdf.apply(turned, i);
      pack_row(turned, i, header, out, begin + i);
    }
  });

  ByteWriter extensions;
  const auto write_extension = [&](std::uint32_t type, std::span<const std::byte> payload) {
    extensions.write(type), extensions.write(std::uint32_t(payload.size())), extensions.write_all(payload);
  };
  if (declares) {
    const auto value = std::uint32_t(number);
    write_extension(axes_extension, std::as_bytes(std::span(&value, 1)));
  }
  for (const SpzExtension& extension : options.extensions) write_extension(extension.type, extension.payload);
  return options.version == 4 ? pack_zstd(header, out, extensions.bytes()) : pack_gzip(header, out, extensions.bytes());
}

}  // namespace engine::io
