#include "engine/io/overlay_file.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "engine/core/atomic_file.h"
#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/io/checks.h"
#include "engine/io/input_file.h"
#include "engine/scene/cloud_bytes.h"

namespace engine::io {
namespace {

constexpr std::string_view magic = "SDOVERLY";
constexpr std::uint32_t format_number = 1;  // of the layout in overlay_file.h
constexpr std::size_t checksum_bytes = sizeof(std::uint32_t);

std::uint32_t crc_of(std::span<const std::byte> bytes, uLong before = 0) {
  return std::uint32_t(crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

/// What tells one base from another: how many rows, of what shape, and where they are.
struct BaseMark {
  std::uint64_t rows = 0;
  std::int32_t sh_degree = 0;
  std::uint64_t extra_stride = 0;
  std::uint32_t means = 0;
  bool operator==(const BaseMark&) const = default;
};

BaseMark mark_of(const scene::GaussianCloud& base) {
  uLong crc = 0;
  for (const auto* column : {&base.mean.x, &base.mean.y, &base.mean.z})
    crc = crc_of(std::as_bytes(std::span(*column)), crc);
  return {base.size(), base.sh_degree, base.extra_stride, std::uint32_t(crc)};
}

void write_mark(ByteWriter& out, const BaseMark& mark) {
  out.write(mark.rows), out.write(mark.sh_degree), out.write(mark.extra_stride), out.write(mark.means);
}

BaseMark read_mark(ByteReader& in) {
  BaseMark mark;
  mark.rows = in.read<std::uint64_t>();
  mark.sh_degree = in.read<std::int32_t>();
  mark.extra_stride = in.read<std::uint64_t>();
  mark.means = in.read<std::uint32_t>();
  return mark;
}

std::vector<std::uint32_t> read_rows(ByteReader& in, std::uint64_t count) {
  if (!in.has(count, sizeof(std::uint32_t))) {
    in.fail();
    return {};
  }
  std::vector<std::uint32_t> rows(static_cast<std::size_t>(count));
  in.read_all(std::span(rows));
  return rows;
}

tl::unexpected<Error> damaged(const std::string& file, const std::string& what) {
  return fail(ErrorCode::corrupt_data, file + " is damaged: " + what, file);
}

/// The contents of a file whose magic, format number and checksum are right.
Result<std::span<const std::byte>> contents_of(std::span<const std::byte> bytes, const std::string& file) {
  ByteReader in(bytes);
  const auto found_magic = in.take(magic.size());
  if (!in.ok() || !std::ranges::equal(found_magic, std::as_bytes(std::span(magic))))
    return damaged(file, "it does not begin as a version of a scene does");
  const auto found_format = in.read<std::uint32_t>();
  (void)in.read<std::uint32_t>();  // spare
  if (!in.ok() || in.remaining() < checksum_bytes) return damaged(file, "it ends too early");
  if (found_format != format_number)
    return fail(ErrorCode::unsupported,
                file + " is of version " + std::to_string(found_format) + "; this program reads version " +
                    std::to_string(format_number),
                file);
  const auto checked = bytes.first(bytes.size() - checksum_bytes);
  if (ByteReader(bytes.subspan(checked.size())).read<std::uint32_t>() != crc_of(checked))
    return damaged(file, "its checksum does not match");
  return checked.subspan(in.offset());
}

Result<scene::Overlay> parse(std::span<const std::byte> bytes, const scene::GaussianCloud& base,
                             const ReadOptions& options, const std::string& file) {
  const auto contents = contents_of(bytes, file);
  if (!contents) return propagate(contents);
  ByteReader in(*contents);
  if (read_mark(in) != mark_of(base))
    return fail(ErrorCode::conflict, file + " was made for another base than the one it lies beside", file);
  const auto removed = in.read<std::uint64_t>(), changed = in.read<std::uint64_t>();
  scene::Overlay overlay;
  overlay.removed = read_rows(in, removed);
  overlay.changed = read_rows(in, changed);
  overlay.rows = scene::read_cloud(in);
  if (!in.ok() || in.remaining() != 0) return damaged(file, "its parts do not fit together");
  if (auto valid = scene::validate(overlay, base); !valid)
    return fail(valid.error().code, file + ": " + valid.error().message, file + ":" + valid.error().where);
  if (auto finite = check_finite(overlay.rows, file); !finite) return propagate(finite);
  const std::size_t result = base.size() - overlay.removed.size() + overlay.added();
  if (result > options.max_gaussians)
    return fail(ErrorCode::too_large,
                file + " makes a scene of " + std::to_string(result) + " Gaussians; the limit (max_gaussians) is " +
                    std::to_string(options.max_gaussians),
                file);
  return overlay;
}

}  // namespace

Result<void> write_overlay(const std::filesystem::path& path, const scene::Overlay& overlay,
                           const scene::GaussianCloud& base) {
  const std::string file = path.filename().string();
  if (auto valid = scene::validate(overlay, base); !valid)
    return fail(ErrorCode::internal, "the version was not written: " + valid.error().message,
                file + ":" + valid.error().where);
  if (const auto bad = scene::first_not_finite(overlay.rows))
    return fail(ErrorCode::internal, "the version was not written: a value is NaN or infinite", file + ":rows" + *bad);
  ByteWriter out;
  out.write_all(std::span(magic));
  out.write(format_number);
  out.write(std::uint32_t{0});
  write_mark(out, mark_of(base));
  out.write(std::uint64_t(overlay.removed.size()));
  out.write(std::uint64_t(overlay.changed.size()));
  out.write_all(std::span(overlay.removed));
  out.write_all(std::span(overlay.changed));
  scene::write_cloud(out, overlay.rows);
  out.write(crc_of(out.bytes()));
  return write_file(path, out.bytes());
}

Result<scene::Overlay> read_overlay(const std::filesystem::path& path, const scene::GaussianCloud& base,
                                    const ReadOptions& options) {
  const std::string file = path.filename().string();
  return within_memory(file, [&]() -> Result<scene::Overlay> {
    const auto input = InputFile::open(path);
    if (!input) return propagate(input);
    if (input->size() > options.max_memory_bytes)
      return fail(ErrorCode::too_large,
                  file + " has " + std::to_string(input->size()) + " bytes; the limit (max_memory_bytes) is " +
                      std::to_string(options.max_memory_bytes),
                  file);
    const auto bytes = input->read_at(0, input->size());
    if (!bytes) return propagate(bytes);
    return parse(*bytes, base, options, file);
  });
}

}  // namespace engine::io
