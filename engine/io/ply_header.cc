#include "engine/io/ply_header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <unordered_set>

namespace engine::io {
namespace {

struct TypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array type_names = {
    TypeName{"char", PlyType::int8},       TypeName{"int8", PlyType::int8},       TypeName{"uchar", PlyType::uint8},
    TypeName{"uint8", PlyType::uint8},     TypeName{"short", PlyType::int16},     TypeName{"int16", PlyType::int16},
    TypeName{"ushort", PlyType::uint16},   TypeName{"uint16", PlyType::uint16},   TypeName{"int", PlyType::int32},
    TypeName{"int32", PlyType::int32},     TypeName{"uint", PlyType::uint32},     TypeName{"uint32", PlyType::uint32},
    TypeName{"float", PlyType::float32},   TypeName{"float32", PlyType::float32}, TypeName{"double", PlyType::float64},
    TypeName{"float64", PlyType::float64},
};

std::optional<PlyType> type_named(std::string_view name) {
  for (const auto& entry : type_names)
    if (entry.name == name) return entry.type;
  return std::nullopt;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr std::string_view blanks = " \t\r";
  for (std::size_t begin = line.find_first_not_of(blanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(blanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(blanks, end);
  }
  return words;
}

/// At most 40 printable characters of what the file says, for a message.
std::string quoted(std::string_view text) {
  std::string quote = "'";
  for (const char c : text.substr(0, 40)) quote += c >= ' ' && c <= '~' ? c : '?';
  return quote + (text.size() > 40 ? "...'" : "'");
}

/// Takes the header line by line.
class HeaderParser {
 public:
  HeaderParser(std::string_view bytes, const std::string& file) : bytes_(bytes), file_(file) {}

  Result<PlyHeader> parse() {
    if (!starts_like_ply(bytes_)) return error(ErrorCode::unsupported, "a .ply file begins with a line 'ply'");
    if (bytes_.size() > max_ply_header_bytes) bytes_ = bytes_.substr(0, max_ply_header_bytes);
    while (next_line()) {
      const auto words = words_of(line_);
      if (words.empty() || line_number_ == 1 || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") return finish();
      if (auto taken = take(words); !taken) return propagate(taken);
    }
    if (bytes_.size() == max_ply_header_bytes)
      return fail(ErrorCode::too_large,
                  "no 'end_header' within the first " + std::to_string(max_ply_header_bytes) + " bytes", where());
    return fail(ErrorCode::corrupt_data, "the file ends before 'end_header': it is incomplete", where());
  }

 private:
  bool next_line() {
    const std::size_t end = bytes_.find('\n', position_);
    if (end == std::string_view::npos) return false;
    line_ = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    ++line_number_;
    return true;
  }

  Result<void> take(const std::vector<std::string_view>& words) {
    if (words[0] == "format") return take_format(words);
    if (words[0] == "element") return take_element(words);
    if (words[0] == "property") return take_property(words);
    return error(ErrorCode::corrupt_data, "unknown keyword " + quoted(words[0]));
  }

  Result<void> take_format(const std::vector<std::string_view>& words) {
    if (words.size() != 3 || has_format_) return error(ErrorCode::corrupt_data, "expected one 'format KIND 1.0'");
    has_format_ = true;
    if (words[1] == "ascii") {
      header_.format = PlyFormat::ascii;
    } else if (words[1] == "binary_little_endian") {
      header_.format = PlyFormat::binary_little_endian;
    } else if (words[1] == "binary_big_endian") {
      header_.format = PlyFormat::binary_big_endian;
    } else {
      return error(ErrorCode::corrupt_data, "unknown format " + quoted(words[1]));
    }
    return {};
  }

  Result<void> take_element(const std::vector<std::string_view>& words) {
    if (words.size() != 3) return error(ErrorCode::corrupt_data, "expected 'element NAME COUNT'");
    PlyElement element;
    element.name = words[1];
    if (!element_names_.insert(element.name).second)
      return error(ErrorCode::corrupt_data, "a second element " + quoted(words[1]));
    const char* end = words[2].data() + words[2].size();
    const auto parsed = std::from_chars(words[2].data(), end, element.count);
    if (parsed.ec != std::errc{} || parsed.ptr != end)
      return error(ErrorCode::corrupt_data,
                   "expected a whole number of " + quoted(words[1]) + " rows below 2^64, found " + quoted(words[2]));
    element.count_begin = std::size_t(words[2].data() - bytes_.data());
    element.count_size = words[2].size();
    header_.elements.push_back(std::move(element));
    // A new one: clear(), and "= {}" as well, go over all the buckets that the widest element before needed.
    property_names_ = std::unordered_set<std::string>();
    return {};
  }

  Result<void> take_property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) return error(ErrorCode::corrupt_data, "a property before the first element");
    PlyElement& element = header_.elements.back();
    PlyProperty property;
    property.is_list = words.size() == 5 && words[1] == "list";
    if (!property.is_list && words.size() != 3) return error(ErrorCode::corrupt_data, "expected 'property TYPE NAME'");
    for (std::size_t i = property.is_list ? 2 : 1; i + 1 < words.size(); ++i) {
      const auto type = type_named(words[i]);
      if (!type) return error(ErrorCode::corrupt_data, "unknown type " + quoted(words[i]));
      property.type = *type;
    }
    property.name = words.back();
    if (!property_names_.insert(property.name).second)
      return error(ErrorCode::corrupt_data, "a second property " + quoted(words.back()));
    property.offset = element.stride;
    element.stride += size_of(property.type);
    element.properties.push_back(std::move(property));
    return {};
  }

  Result<PlyHeader> finish() {
    if (!has_format_) return error(ErrorCode::corrupt_data, "the header has no 'format' line");
    header_.text = bytes_.substr(0, position_);
    return std::move(header_);
  }

  [[nodiscard]] std::string where() const { return file_ + ":header"; }
  [[nodiscard]] tl::unexpected<Error> error(ErrorCode code, const std::string& message) const {
    return fail(code, "line " + std::to_string(line_number_) + " of the header: " + message, where());
  }

  std::string_view bytes_, line_;
  std::string file_;
  std::size_t position_ = 0;
  int line_number_ = 0;
  bool has_format_ = false;
  // A megabyte of header has room for 60,000 names: each is looked up once, not held against all before it.
  std::unordered_set<std::string> element_names_;
  std::unordered_set<std::string> property_names_;  ///< Of the current element's properties.
  PlyHeader header_;
};

/// "1 face", for a message.
std::string rows_of(const PlyElement& element) { return std::to_string(element.count) + " " + element.name + " rows"; }

}  // namespace

std::size_t size_of(PlyType type) noexcept {
  switch (type) {
    case PlyType::int8:
    case PlyType::uint8:
      return 1;
    case PlyType::int16:
    case PlyType::uint16:
      return 2;
    case PlyType::float64:
      return 8;
    default:
      return 4;
  }
}

const PlyProperty* PlyElement::find(std::string_view property) const {
  const auto found = std::ranges::find(properties, property, &PlyProperty::name);
  return found == properties.end() ? nullptr : &*found;
}

bool PlyElement::has_list() const { return std::ranges::any_of(properties, &PlyProperty::is_list); }

const PlyElement* PlyHeader::find(std::string_view element) const {
  const auto found = std::ranges::find(elements, element, &PlyElement::name);
  return found == elements.end() ? nullptr : &*found;
}

bool starts_like_ply(std::string_view bytes) { return bytes.starts_with("ply\n") || bytes.starts_with("ply\r\n"); }

Result<PlyHeader> parse_ply_header(std::string_view bytes, const std::string& file) {
  return HeaderParser(bytes, file).parse();
}

Result<PlyHeader> read_ply_header(const InputFile& file) {
  const auto bytes = file.read_at(0, std::min<std::uint64_t>(file.size(), max_ply_header_bytes));
  if (!bytes) return propagate(bytes);
  return parse_ply_header({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, file.name());
}

Result<std::vector<std::uint64_t>> element_offsets(const PlyHeader& header, const InputFile& file) {
  const std::string where = file.name() + ":header";
  if (header.format == PlyFormat::ascii)
    return fail(ErrorCode::unsupported,
                "this is an ASCII .ply file; save it as binary_little_endian, which every 3DGS tool can", where);
  if (header.format == PlyFormat::binary_big_endian)
    return fail(ErrorCode::unsupported, "this is a big-endian .ply file; save it as binary_little_endian", where);

  std::vector<std::uint64_t> offsets = {header.text.size()};
  for (const PlyElement& element : header.elements) {
    if (element.count == 0) {  // no bytes, whatever its properties: some writers always announce faces
      offsets.push_back(offsets.back());
      continue;
    }
    if (element.has_list())
      return fail(ErrorCode::unsupported,
                  "element '" + element.name +
                      "' has a list property, as a mesh has; remove that element, or export "
                      "the Gaussians alone",
                  where);
    const std::uint64_t begin = offsets.back();
    const std::uint64_t available = file.size() - std::min(begin, file.size());
    if (element.stride > 0 && element.count > available / element.stride)
      return fail(ErrorCode::corrupt_data,
                  "the header announces " + rows_of(element) + " of " + std::to_string(element.stride) +
                      " bytes each; only " + std::to_string(available) +
                      " bytes are left in the file: it is incomplete, copy or download it again",
                  file.name() + ":" + element.name);
    offsets.push_back(begin + element.count * element.stride);
  }
  if (offsets.back() != file.size())
    return fail(ErrorCode::corrupt_data,
                "the elements of the header end at byte " + std::to_string(offsets.back()) + ", the file at byte " +
                    std::to_string(file.size()) + ": the row counts in the header are wrong or something was appended",
                where);
  return offsets;
}

}  // namespace engine::io
