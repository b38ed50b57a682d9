#include "engine/weights/vocabulary.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>

#include "engine/io/json_fields.h"
#include "engine/io/read_bytes.h"
#include "engine/weights/digest.h"

namespace engine::weights {
namespace {

constexpr std::uint64_t max_vocabulary_bytes = std::uint64_t{16} << 20;  // CLIP's has 1 MB
constexpr const char* begin_mark = "<|startoftext|>";
constexpr const char* end_mark = "<|endoftext|>";

std::string utf8(unsigned code) {  // below U+0800
  if (code < 0x80) return {char(code)};
  return {char(0xc0 | (code >> 6)), char(0x80 | (code & 0x3f))};
}

/// Lines "a b" after the first, which is a comment.
Result<std::vector<std::pair<std::string, std::string>>> parse_merges(std::string_view text, const std::string& file) {
  std::vector<std::pair<std::string, std::string>> merges;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view one = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (one.ends_with('\r')) one.remove_suffix(1);
    if (one.empty() || (line == 1 && one.starts_with("#version"))) continue;
    const std::size_t space = one.find(' ');
    if (space == 0 || space == std::string_view::npos || space + 1 == one.size())
      return fail(ErrorCode::corrupt_data, "expected two pieces with a space between",
                  file + ":" + std::to_string(line));
    merges.emplace_back(one.substr(0, space), one.substr(space + 1));
  }
  return merges;
}

Result<void> parse_numbers(std::span<const std::byte> json, int pieces, Vocabulary& vocabulary) {
  const auto document = io::parse_json(json, "vocab.json");
  if (!document) return propagate(document);
  if (!document->is_object()) return fail(ErrorCode::corrupt_data, "expected an object", "vocab.json");
  for (const auto& [piece, number] : document->items()) {
    if (!number.is_number_unsigned() || number.get<std::uint64_t>() >= std::uint64_t(pieces))
      return fail(ErrorCode::corrupt_data,
                  "expected the number of a piece, of which the text encoder has " + std::to_string(pieces),
                  "vocab.json:" + piece);
    vocabulary.numbers.emplace(piece, number.get<int>());
  }
  for (const auto& [mark, number] : {std::pair(begin_mark, &vocabulary.begin), std::pair(end_mark, &vocabulary.end)}) {
    const auto found = vocabulary.numbers.find(mark);
    if (found == vocabulary.numbers.end())
      return fail(ErrorCode::corrupt_data, "this mark is missing", std::string("vocab.json:") + mark);
    *number = found->second;
  }
  return {};
}

/// "pad_token" of special_tokens_map.json: a text, or an object with one as its content.
Result<int> parse_filler(std::span<const std::byte> json, const Vocabulary& vocabulary) {
  const auto document = io::parse_json(json, "special_tokens_map.json");
  if (!document) return propagate(document);
  std::optional<Error> error;
  const io::JsonFields fields(*document, "special_tokens_map.json:", error);
  if (!fields.has_value("pad_token")) return vocabulary.end;
  const auto token = fields.at("pad_token");
  const std::string piece = token.has("content") ? token.at("content").string() : token.string();
  if (error) return tl::make_unexpected(std::move(*error));
  const auto found = vocabulary.numbers.find(piece);
  if (found == vocabulary.numbers.end())
    return fail(ErrorCode::corrupt_data, "vocab.json has no " + piece, "special_tokens_map.json:pad_token");
  return found->second;
}

}  // namespace

const std::vector<std::string>& byte_characters() {
  static const std::vector<std::string> characters = [] {
    std::vector<std::string> all;
    unsigned others = 0;
    for (unsigned byte = 0; byte < 256; ++byte) {
      const bool printable = (byte >= '!' && byte <= '~') || (byte >= 0xa1 && byte <= 0xac) || byte >= 0xae;
      all.push_back(utf8(printable ? byte : 0x100 + others++));
    }
    return all;
  }();
  return characters;
}

Vocabulary clip_vocabulary(std::vector<std::pair<std::string, std::string>> merges) {
  Vocabulary vocabulary;
  int next = 0;
  const auto add = [&](const std::string& piece) { vocabulary.numbers.emplace(piece, next++); };
  // Printable bytes come first, then the others: the order of the characters that stand for them.
  std::vector<std::string> characters;
  for (const bool printable : {true, false})
    for (unsigned byte = 0; byte < 256; ++byte)
      if ((byte_characters()[byte] == utf8(byte)) == printable) characters.push_back(byte_characters()[byte]);
  for (const std::string& character : characters) add(character);
  for (const std::string& character : characters) add(character + "</w>");
  for (const auto& [left, right] : merges) add(left + right);
  vocabulary.begin = next, add(begin_mark);
  vocabulary.end = vocabulary.filler = next, add(end_mark);
  vocabulary.merges = std::move(merges);
  return vocabulary;
}

Result<Vocabulary> read_vocabulary(const std::filesystem::path& folder, bool open_clip, int pieces) {
  VocabularyFiles files;
  for (const auto& [name, bytes] :
       {std::pair("vocab.json", &files.vocab_json), std::pair("merges.txt", &files.merges_txt)}) {
    auto read = io::read_bytes(folder / name, max_vocabulary_bytes);
    if (!read) return propagate(read);
    *bytes = std::move(*read);
  }
  const auto special = folder / "special_tokens_map.json";
  std::error_code ignored;
  if (std::filesystem::is_regular_file(special, ignored)) {
    auto read = io::read_bytes(special, max_vocabulary_bytes);
    if (!read) return propagate(read);
    files.special_tokens_map_json = std::move(*read);
  }
  return parse_vocabulary(files, open_clip, pieces);
}

Result<Vocabulary> parse_vocabulary(const VocabularyFiles& files, bool open_clip, int pieces) {
  Vocabulary vocabulary;
  Digest digest;
  digest.add(files.vocab_json);
  if (const auto parsed = parse_numbers(files.vocab_json, pieces, vocabulary); !parsed) return propagate(parsed);
  digest.add(files.merges_txt);
  auto merges =
      parse_merges({reinterpret_cast<const char*>(files.merges_txt.data()), files.merges_txt.size()}, "merges.txt");
  if (!merges) return propagate(merges);
  vocabulary.merges = std::move(*merges);
  vocabulary.filler = open_clip ? 0 : vocabulary.end;
  if (files.special_tokens_map_json) {
    digest.add(*files.special_tokens_map_json);
    const auto filler = parse_filler(*files.special_tokens_map_json, vocabulary);
    if (!filler) return propagate(filler);
    vocabulary.filler = *filler;
  }
  vocabulary.digest = digest.text();
  return vocabulary;
}

}  // namespace engine::weights
