#include "engine/weights/safetensors.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "engine/core/byte_writer.h"
#include "engine/core/file_descriptor.h"
#include "engine/core/finite.h"

namespace engine::weights {
namespace {

/// What the header says of a tensor.
struct Entry {
  std::string dtype;
  Shape shape;
  std::vector<std::uint64_t> offsets;
  bool has_dtype = false, has_shape = false, has_offsets = false;
};

/// Reads the header as it comes, without a tree of it: {"NAME": {"dtype": "F32", "shape": [2, 3], "data_offsets":
/// [0, 24]}, "__metadata__": {"KEY": "TEXT"}}. Whatever else it holds ends the reading at once.
class HeaderReader final : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit HeaderReader(std::string file) : file_(std::move(file)) {}

  std::map<std::string, Entry> entries;
  std::map<std::string, std::string> metadata;
  std::optional<Error> error;

  bool start_object(std::size_t) override {
    if (depth_ == 1) return ++depth_, true;
    if (depth_ != 0) return unexpected("an object");
    return ++depth_, true;
  }
  bool end_object() override { return --depth_, true; }
  bool key(std::string& text) override {
    if (depth_ == 1) {
      name_ = text;
      if (name_ == "__metadata__") return true;
      if (entries.size() == max_tensors)
        return stop(ErrorCode::too_large, "more than " + std::to_string(max_tensors) + " tensors");
      if (!entries.emplace(name_, Entry{}).second) return stop(ErrorCode::corrupt_data, "this tensor is listed twice");
      return true;
    }
    field_ = text;
    if (name_ != "__metadata__") return begin_field(entries[name_]);
    if (metadata.size() == max_metadata)
      return stop(ErrorCode::too_large, "more than " + std::to_string(max_metadata) + " texts");
    return true;
  }
  bool string(std::string& text) override {
    if (depth_ != 2) return unexpected("a string");
    if (name_ == "__metadata__") return metadata[field_] = text, true;
    if (field_ != "dtype") return unexpected("a string");
    entries[name_].dtype = text;
    return true;
  }
  bool start_array(std::size_t) override {
    if (depth_ != 2 || name_ == "__metadata__" || (field_ != "shape" && field_ != "data_offsets"))
      return unexpected("an array");
    return ++depth_, true;
  }
  bool end_array() override { return --depth_, true; }
  bool number_unsigned(std::uint64_t value) override {
    if (depth_ != 3) return unexpected("a number");
    Entry& entry = entries[name_];
    if (field_ == "data_offsets") {
      if (entry.offsets.size() == 2) return unexpected("a third offset");
      return entry.offsets.push_back(value), true;
    }
    if (entry.shape.size() == max_dimensions) return unexpected("a ninth dimension");
    if (value > std::uint64_t(std::numeric_limits<std::int64_t>::max())) return unexpected("a size beyond all bounds");
    return entry.shape.push_back(std::int64_t(value)), true;
  }
  bool number_integer(std::int64_t) override { return unexpected("a negative number"); }
  bool number_float(double, const std::string&) override { return unexpected("a fraction"); }
  bool null() override { return unexpected("null"); }
  bool boolean(bool) override { return unexpected("true or false"); }
  bool binary(nlohmann::json::binary_t&) override { return unexpected("binary data"); }
  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception&) override {
    name_.clear();
    return stop(ErrorCode::corrupt_data, "not valid JSON: it goes wrong at byte " + std::to_string(position));
  }

 private:
  /// Each field once: the arrays of two would become one.
  bool begin_field(Entry& entry) {
    bool* const has = field_ == "dtype"          ? &entry.has_dtype
                      : field_ == "shape"        ? &entry.has_shape
                      : field_ == "data_offsets" ? &entry.has_offsets
                                                 : nullptr;
    if (has == nullptr) return unexpected("another field");
    if (std::exchange(*has, true)) return stop(ErrorCode::corrupt_data, "its " + field_ + " stands there twice");
    return true;
  }
  bool stop(ErrorCode code, std::string message) {
    error = Error{code, std::move(message), file_ + ":" + (name_.empty() ? "header" : name_)};
    return false;
  }
  bool unexpected(const std::string& found) {
    return stop(ErrorCode::corrupt_data, "the header has " + found + " where none belongs");
  }

  std::string file_, name_, field_;
  int depth_ = 0;
};

/// Bytes of one number; 0 for a type that is not known, of which nobody reads anything.
std::uint64_t bytes_of(std::string_view dtype) {
  if (dtype == "F64" || dtype == "I64" || dtype == "U64") return 8;
  if (dtype == "F32" || dtype == "I32" || dtype == "U32") return 4;
  if (dtype == "F16" || dtype == "BF16" || dtype == "I16" || dtype == "U16") return 2;
  if (dtype == "I8" || dtype == "U8" || dtype == "BOOL" || dtype.starts_with("F8_")) return 1;
  return 0;
}

/// Bytes that type and shape ask for, of an unknown type those of one byte's; nothing if that is more than can be
/// counted.
std::optional<std::uint64_t> expected_bytes(const Entry& entry) {
  std::uint64_t bytes = std::max<std::uint64_t>(1, bytes_of(entry.dtype));
  for (const std::int64_t size : entry.shape)
    if (__builtin_mul_overflow(bytes, std::uint64_t(size), &bytes)) return std::nullopt;
  return bytes;
}

Result<void> check_entry(const Entry& entry, std::uint64_t data_bytes, const std::string& where) {
  if (entry.dtype.empty() || !entry.has_shape || entry.offsets.size() != 2)
    return fail(ErrorCode::corrupt_data, "expected dtype, shape and two data_offsets", where);
  const std::uint64_t begin = entry.offsets[0], end = entry.offsets[1];
  if (end < begin) return fail(ErrorCode::corrupt_data, "its bytes end before they begin", where);
  if (end > data_bytes)
    return fail(ErrorCode::corrupt_data,
                "its bytes end at " + std::to_string(end) + " of " + std::to_string(data_bytes) +
                    ": the file is incomplete, copy or download it again",
                where);
  const auto expected = expected_bytes(entry);
  if (!expected || (bytes_of(entry.dtype) != 0 && *expected != end - begin))
    return fail(
        ErrorCode::corrupt_data,
        entry.dtype + " of shape " + text_of(entry.shape) + " does not have " + std::to_string(end - begin) + " bytes",
        where);
  return {};
}

/// Do the tensors fill the bytes after the header, each byte in one of them?
Result<void> check_cover(const std::map<std::string, Entry>& entries, std::uint64_t data_bytes,
                         const std::string& file) {
  using Item = std::pair<const std::string, Entry>;
  std::vector<const Item*> in_order;
  for (const Item& entry : entries) in_order.push_back(&entry);
  std::ranges::sort(in_order, {},
                    [](const Item* item) { return std::pair(item->second.offsets[0], item->second.offsets[1]); });
  std::uint64_t covered = 0;
  for (const Item* item : in_order) {
    const std::uint64_t begin = item->second.offsets[0];
    if (begin < covered)
      return fail(ErrorCode::corrupt_data, "it overlaps the tensor before it", file + ":" + item->first);
    if (begin > covered)
      return fail(ErrorCode::corrupt_data, std::to_string(begin - covered) + " bytes before it belong to no tensor",
                  file + ":" + item->first);
    covered = item->second.offsets[1];
  }
  if (covered != data_bytes)
    return fail(ErrorCode::corrupt_data,
                "the last " + std::to_string(data_bytes - covered) + " bytes belong to no tensor", file + ":header");
  return {};
}

/// A pickle by its name or by its first bytes: a zip archive (torch.save since 1.6) or a pickle of protocols 2 to 5.
bool is_pickle(std::string_view name, std::span<const std::byte> bytes) {
  for (const char* ending : {".ckpt", ".pt", ".pth", ".bin", ".pkl"})
    if (name.ends_with(ending)) return true;
  const auto begins_with = [&](std::string_view magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  if (begins_with("PK\x03\x04")) return true;
  // 0x80 0x02 may also begin the length of a header that is not too long. What follows in a pickle makes a longer one
  // of it.
  std::uint64_t header_bytes = 0;
  if (bytes.size() < sizeof header_bytes) return false;
  std::memcpy(&header_bytes, bytes.data(), sizeof header_bytes);
  return begins_with("\x80") && bytes[1] >= std::byte{2} && bytes[1] <= std::byte{5} && header_bytes > max_header_bytes;
}

class Mapping {
 public:
  Mapping(void* address, std::size_t size) : address_(address), size_(size) {}
  ~Mapping() { ::munmap(address_, size_); }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;

 private:
  void* address_;
  std::size_t size_;
};

float from_half(std::uint16_t half) {
  const std::uint32_t sign = std::uint32_t(half & 0x8000u) << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1fu, mantissa = half & 0x3ffu;
  if (exponent == 0) {  // zero, or below the least normal number: mantissa * 2^-24
    const float magnitude = float(mantissa) * 0x1p-24f;
    return sign != 0 ? -magnitude : magnitude;
  }
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000u | (mantissa << 13));
  return std::bit_cast<float>(sign | ((exponent + 112) << 23) | (mantissa << 13));
}

float from_bfloat(std::uint16_t bits) { return std::bit_cast<float>(std::uint32_t(bits) << 16); }

void widen(std::span<const std::byte> bytes, std::span<float> into, float (*widened)(std::uint16_t)) {
  for (std::size_t i = 0; i < into.size(); ++i) {
    std::uint16_t value = 0;  // tensors of 2 bytes need not lie at even addresses
    std::memcpy(&value, bytes.data() + 2 * i, sizeof value);
    into[i] = widened(value);
  }
}

Result<void> check_finite(std::span<const float> values, const std::string& where) {
  if (const auto at = first_not_finite(values))
    return fail(ErrorCode::corrupt_data, "not a finite number", where + "[" + std::to_string(*at) + "]");
  return {};
}

}  // namespace

std::string text_of(const Shape& shape) {
  std::string text;
  for (const std::int64_t size : shape) text += (text.empty() ? "" : ", ") + std::to_string(size);
  return "[" + text + "]";
}

std::uint64_t StoredTensor::elements() const {
  std::uint64_t count = 1;
  for (const std::int64_t size : shape) count *= std::uint64_t(size);
  return count;
}

bool StoredTensor::has_floats() const { return dtype == "F32" || dtype == "F16" || dtype == "BF16"; }

Result<TensorFile> TensorFile::read(std::span<const std::byte> bytes, std::string name,
                                    std::shared_ptr<const void> owner) {
  const std::string header_at = name + ":header";
  if (is_pickle(name, bytes))
    return fail(ErrorCode::unsupported,
                name + " is a pickle, which can run any program when it is opened; convert it to .safetensors", name);
  std::uint64_t header_bytes = 0;
  if (bytes.size() < sizeof header_bytes)
    return fail(ErrorCode::corrupt_data, "the file ends before its header's length", header_at);
  std::memcpy(&header_bytes, bytes.data(), sizeof header_bytes);
  if (header_bytes > max_header_bytes)
    return fail(ErrorCode::too_large,
                "a header of " + std::to_string(header_bytes) + " bytes, of which at most " +
                    std::to_string(max_header_bytes) + " are read: no .safetensors file, or a damaged one",
                header_at);
  if (header_bytes > bytes.size() - sizeof header_bytes)
    return fail(ErrorCode::corrupt_data, "the file ends within its header", header_at);
  const auto text = bytes.subspan(sizeof header_bytes, std::size_t(header_bytes));
  const auto data = bytes.subspan(sizeof header_bytes + text.size());

  HeaderReader header(name);
  const auto* begin = reinterpret_cast<const char*>(text.data());
  if (!nlohmann::json::sax_parse(begin, begin + text.size(), &header)) {
    if (header.error) return tl::make_unexpected(std::move(*header.error));
    return fail(ErrorCode::corrupt_data, "not valid JSON", header_at);
  }
  for (const auto& [tensor, entry] : header.entries)
    if (const auto checked = check_entry(entry, data.size(), name + ":" + tensor); !checked) return propagate(checked);
  if (const auto checked = check_cover(header.entries, data.size(), name); !checked) return propagate(checked);

  TensorFile file;
  for (auto& [tensor, entry] : header.entries) {
    const auto at = data.subspan(std::size_t(entry.offsets[0]), std::size_t(entry.offsets[1] - entry.offsets[0]));
    file.tensors_.emplace(tensor, StoredTensor{std::move(entry.dtype), std::move(entry.shape), at});
  }
  file.metadata_ = std::move(header.metadata);
  file.name_ = std::move(name);
  file.owner_ = std::move(owner);
  return file;
}

Result<TensorFile> TensorFile::open(const std::filesystem::path& path) {
  const FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));  // a pipe must not make us wait
  struct stat info {};
  if (fd.get() < 0 || ::fstat(fd.get(), &info) != 0) return tl::make_unexpected(file_error(errno, "read", path));
  if (!S_ISREG(info.st_mode))
    return fail(ErrorCode::invalid_argument, path.string() + " is not a regular file", path.string());
  const auto size = std::size_t(info.st_size);
  if (size == 0) return read({}, path.filename().string(), nullptr);
  void* const address = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd.get(), 0);
  if (address == MAP_FAILED) return tl::make_unexpected(file_error(errno, "map", path));
  auto owner = std::make_shared<const Mapping>(address, size);
  return read({static_cast<const std::byte*>(address), size}, path.filename().string(), std::move(owner));
}

Result<TensorFile> TensorFile::parse(std::vector<std::byte> bytes, std::string name) {
  auto owner = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  const std::span<const std::byte> all(*owner);
  return read(all, std::move(name), std::move(owner));
}

const StoredTensor* TensorFile::find(std::string_view tensor) const {
  const auto found = tensors_.find(tensor);
  return found == tensors_.end() ? nullptr : &found->second;
}

Result<std::span<const float>> floats_in_place(const StoredTensor& tensor, const std::string& where) {
  const auto address = reinterpret_cast<std::uintptr_t>(tensor.bytes.data());
  if (tensor.dtype != "F32" || address % alignof(float) != 0) return std::span<const float>();
  const std::span<const float> values(reinterpret_cast<const float*>(tensor.bytes.data()), tensor.elements());
  if (const auto checked = check_finite(values, where); !checked) return propagate(checked);
  return values;
}

Result<void> read_floats(const StoredTensor& tensor, const std::string& where, std::span<float> into) {
  assert(into.size() == tensor.elements());
  if (!tensor.has_floats())
    return fail(ErrorCode::unsupported, "its numbers are " + tensor.dtype + "; F16, BF16 and F32 are read", where);
  // Read from a file they agree; whoever makes a tensor otherwise must not read beyond its bytes.
  if (tensor.bytes.size() != into.size() * bytes_of(tensor.dtype))
    return fail(ErrorCode::corrupt_data, "its shape does not have as many bytes", where);
  if (into.empty()) return {};
  if (tensor.dtype == "F32")
    std::memcpy(into.data(), tensor.bytes.data(), tensor.bytes.size());
  else if (tensor.dtype == "F16")
    widen(tensor.bytes, into, from_half);
  else
    widen(tensor.bytes, into, from_bfloat);
  return check_finite(into, where);
}

std::string encode_tensors(const std::map<std::string, FloatTensor>& tensors,
                           const std::map<std::string, std::string>& metadata) {
  nlohmann::json header = nlohmann::json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  std::uint64_t offset = 0;
  for (const auto& [name, tensor] : tensors) {
    const std::uint64_t end = offset + sizeof(float) * tensor.values.size();
    header[name] = {{"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {offset, end}}};
    offset = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');  // so that the numbers lie where a processor reads them best
  ByteWriter out;
  out.write(std::uint64_t(text.size()));
  out.write_all(std::span<const char>(text));
  for (const auto& [name, tensor] : tensors) out.write_all(std::span<const float>(tensor.values));
  return std::move(out).take();
}

}  // namespace engine::weights
