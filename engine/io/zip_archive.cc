#include "engine/io/zip_archive.h"

#include <zip.h>

#include <algorithm>
#include <cctype>
#include <initializer_list>

#include "engine/io/zip_directory.h"

namespace engine::io {
namespace {

constexpr std::uint64_t max_name_bytes = 200;  // of a name in the directory, on average; those known have 20

/// A name as it may stand in an address: one line of ASCII, not long.
std::string printable(const std::string& text) {
  std::string out = text.substr(0, 100);
  for (char& c : out)
    if (std::isprint(static_cast<unsigned char>(c)) == 0) c = '?';
  return out;
}

/// libzip's own words are for programmers, and hold what the file made it say.
tl::unexpected<Error> failed(int zip_error, const std::string& where) {
  switch (zip_error) {
    case ZIP_ER_COMPNOTSUPP:
    case ZIP_ER_ENCRNOTSUPP:
    case ZIP_ER_NOPASSWD:
    case ZIP_ER_WRONGPASSWD:
      return fail(ErrorCode::unsupported, "it is encrypted, or compressed in a way that is not supported; deflate is",
                  where);
    case ZIP_ER_MEMORY:
      return fail(ErrorCode::too_large, "the zip file needs more memory than there is", where);
    default:
      return fail(ErrorCode::corrupt_data,
                  "the zip file is damaged or its end is missing: copy or download it again, or make it anew", where);
  }
}

struct CloseEntry {
  void operator()(zip_file_t* entry) const { zip_fclose(entry); }
};
struct FreeSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};
using Source = std::unique_ptr<zip_source_t, FreeSource>;

}  // namespace

bool looks_like_zip(std::span<const std::byte> bytes) {
  // A local file's mark, or the end record of an archive without files.
  for (const auto mark : {std::initializer_list<int>{'P', 'K', 3, 4}, {'P', 'K', 5, 6}})
    if (bytes.size() >= mark.size() &&
        std::equal(mark.begin(), mark.end(), bytes.begin(), [](int a, std::byte b) { return std::byte(a) == b; }))
      return true;
  return false;
}

void ZipArchive::Discard::operator()(zip* archive) const { zip_discard(archive); }

Result<ZipArchive> ZipArchive::open(std::span<const std::byte> bytes, const std::string& file,
                                    std::uint64_t max_entries) {
  // libzip loads the directory whole, some 300 bytes of memory for each entry: how large it is is asked before.
  const ZipDirectory directory = largest_directory(bytes);
  if (directory.entries > max_entries || directory.bytes > max_entries * (46 + max_name_bytes))
    return fail(ErrorCode::too_large,
                "the zip file holds " + std::to_string(directory.entries) + " files in a directory of " +
                    std::to_string(directory.bytes) + " bytes; at most " + std::to_string(max_entries) +
                    " are read as a scene",
                file);
  zip_error_t error;
  zip_error_init(&error);
  Source source(zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error));
  ZipArchive archive;
  archive.file_ = file;
  if (source) archive.archive_.reset(zip_open_from_source(source.get(), ZIP_RDONLY, &error));
  const int code = zip_error_code_zip(&error);
  zip_error_fini(&error);
  if (!archive.archive_) return failed(code, file);
  [[maybe_unused]] const auto* const given = source.release();  // the archive's now
  const zip_int64_t count = zip_get_num_entries(archive.archive_.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i)
    if (const char* name = zip_get_name(archive.archive_.get(), zip_uint64_t(i), 0)) {
      if (!archive.names_.emplace(name, std::uint64_t(i)).second)
        return fail(ErrorCode::corrupt_data, "the zip file has two files of this name", file + ":" + printable(name));
    }
  return archive;
}

Result<UnpackedFile> ZipArchive::read(const std::string& name, std::uint64_t most, MemoryBudget* budget) const {
  const std::string where = file_ + ":" + printable(name);
  const auto found = names_.find(name);
  if (found == names_.end()) return fail(ErrorCode::not_found, "the zip file has no file of this name", where);
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat_index(archive_.get(), found->second, 0, &stat) != 0 || (stat.valid & ZIP_STAT_SIZE) == 0)
    return failed(ZIP_ER_INCONS, where);
  if (stat.size > most)
    return fail(ErrorCode::too_large,
                "the file unpacks to " + std::to_string(stat.size) + " bytes; at most " + std::to_string(most) +
                    " make sense here",
                where);
  auto lent = take_from(budget, stat.size, where);
  if (!lent) return propagate(lent);
  UnpackedFile file{std::vector<std::byte>(std::size_t(stat.size)), std::move(*lent)};
  const std::unique_ptr<zip_file_t, CloseEntry> entry(zip_fopen_index(archive_.get(), found->second, 0));
  if (!entry) return failed(zip_error_code_zip(zip_get_error(archive_.get())), where);
  for (std::size_t done = 0; done < file.bytes.size();) {
    const zip_int64_t got = zip_fread(entry.get(), file.bytes.data() + done, file.bytes.size() - done);
    if (got <= 0) return failed(ZIP_ER_INCONS, where);
    done += std::size_t(got);
  }
  // The checksum is asked for where the end is seen; more than the directory said is damage, too.
  char surplus = 0;
  if (zip_fread(entry.get(), &surplus, 1) != 0) return failed(ZIP_ER_CRC, where);
  return file;
}

Result<std::vector<std::byte>> make_zip(std::span<const NamedFile> files) {
  const auto broken = [] { return fail(ErrorCode::internal, "the zip file could not be made"); };
  if (files.empty()) return fail(ErrorCode::invalid_argument, "a zip file without files is no file");  // to libzip
  zip_error_t error;
  zip_error_init(&error);
  Source sink(zip_source_buffer_create(nullptr, 0, 0, &error));
  if (!sink) return broken();
  zip_source_keep(sink.get());  // for us to read from once the archive has written into it
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive(
      zip_open_from_source(sink.get(), ZIP_CREATE | ZIP_TRUNCATE, &error), &zip_discard);
  zip_error_fini(&error);
  if (!archive) return broken();
  for (const NamedFile& file : files) {
    zip_source_t* const source = zip_source_buffer(archive.get(), file.bytes.data(), file.bytes.size(), 0);
    if (source == nullptr) return broken();
    const zip_int64_t index = zip_file_add(archive.get(), file.name.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      return broken();
    }
    constexpr zip_uint16_t first_of_january_1980 = 0x21, midnight = 0;
    if (zip_set_file_compression(archive.get(), zip_uint64_t(index), ZIP_CM_STORE, 0) != 0 ||
        zip_file_set_dostime(archive.get(), zip_uint64_t(index), midnight, first_of_january_1980, 0) != 0)
      return broken();
  }
  if (zip_close(archive.get()) != 0) return broken();
  [[maybe_unused]] const auto* const closed = archive.release();
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_source_stat(sink.get(), &stat) != 0 || (stat.valid & ZIP_STAT_SIZE) == 0 || zip_source_open(sink.get()) != 0)
    return broken();
  std::vector<std::byte> bytes(std::size_t(stat.size));
  const auto got = zip_source_read(sink.get(), bytes.data(), bytes.size());
  zip_source_close(sink.get());
  if (got != zip_int64_t(bytes.size())) return broken();
  return bytes;
}

}  // namespace engine::io
