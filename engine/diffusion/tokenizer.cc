#include "engine/diffusion/tokenizer.h"

#include <utf8proc.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <optional>

namespace engine::diffusion {
namespace {

constexpr std::string_view begin_mark = "<|startoftext|>", end_mark = "<|endoftext|>";

/// What a run of characters is made of; digits stand alone.
enum class Kind { space, letter, digit, other };

Kind kind_of(utf8proc_int32_t code) {
  // Unicode's White_Space; among the categories only part of it is a space.
  if ((code >= 9 && code <= 13) || code == 0x85 || code == 0x2028 || code == 0x2029) return Kind::space;
  switch (utf8proc_category(code)) {
    case UTF8PROC_CATEGORY_ZS:
      return Kind::space;
    case UTF8PROC_CATEGORY_LU:
    case UTF8PROC_CATEGORY_LL:
    case UTF8PROC_CATEGORY_LT:
    case UTF8PROC_CATEGORY_LM:
    case UTF8PROC_CATEGORY_LO:
      return Kind::letter;
    case UTF8PROC_CATEGORY_ND:
    case UTF8PROC_CATEGORY_NL:
    case UTF8PROC_CATEGORY_NO:
      return Kind::digit;
    default:
      return Kind::other;
  }
}

void append(std::string& text, utf8proc_int32_t code) {
  std::array<utf8proc_uint8_t, 4> bytes{};
  const auto size = utf8proc_encode_char(code, bytes.data());
  text.append(reinterpret_cast<const char*>(bytes.data()), std::size_t(size));
}

/// Composed and lower-cased; nothing if it is no UTF-8.
std::optional<std::string> normalised(std::string_view text) {
  utf8proc_uint8_t* composed = nullptr;
  const auto size = utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(text.data()), utf8proc_ssize_t(text.size()),
                                 &composed, utf8proc_option_t(UTF8PROC_STABLE | UTF8PROC_COMPOSE));
  const std::unique_ptr<utf8proc_uint8_t, decltype(&std::free)> owned(composed, &std::free);
  if (size < 0) return std::nullopt;
  std::string lower;
  for (utf8proc_ssize_t at = 0; at < size;) {
    utf8proc_int32_t code = 0;
    at += utf8proc_iterate(composed + at, size - at, &code);
    // The one letter whose small form is two characters: a capital I with a dot.
    if (code == 0x130)
      lower += "i\u0307";
    else
      append(lower, utf8proc_tolower(code));
  }
  return lower;
}

/// Length of the ending of an English word that stands here ("'s"), 0 if none does.
std::size_t contraction(std::string_view text) {
  for (const std::string_view ending : {"'s", "'t", "'re", "'ve", "'m", "'ll", "'d"})
    if (text.starts_with(ending)) return ending.size();
  return 0;
}

}  // namespace

Tokenizer::Tokenizer(weights::Vocabulary vocabulary) : vocabulary_(std::move(vocabulary)) {
  for (std::size_t i = 0; i < vocabulary_.merges.size(); ++i)
    ranks_.emplace(vocabulary_.merges[i].first + " " + vocabulary_.merges[i].second, i);
}

void Tokenizer::encode_word(std::string_view word, std::vector<std::int64_t>& out) const {
  std::vector<std::string> pieces;
  for (const char c : word) pieces.push_back(weights::byte_characters()[std::uint8_t(c)]);
  pieces.back() += "</w>";
  while (pieces.size() > 1) {
    std::size_t best = ranks_.size();
    for (std::size_t i = 0; i + 1 < pieces.size(); ++i)
      if (const auto found = ranks_.find(pieces[i] + " " + pieces[i + 1]); found != ranks_.end())
        best = std::min(best, found->second);
    if (best == ranks_.size()) break;
    const auto& [left, right] = vocabulary_.merges[best];
    std::vector<std::string> merged;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const bool merges = i + 1 < pieces.size() && pieces[i] == left && pieces[i + 1] == right;
      merged.push_back(merges ? left + right : pieces[i]);
      i += merges ? 1 : 0;
    }
    pieces = std::move(merged);
  }
  for (const std::string& piece : pieces) {
    const auto found = vocabulary_.numbers.find(piece);
    out.push_back(found != vocabulary_.numbers.end() ? found->second : vocabulary_.end);
  }
}

void Tokenizer::encode_text(std::string_view text, std::vector<std::int64_t>& out) const {
  struct Character {
    Kind kind;
    std::size_t size;
  };
  const auto first = [](std::string_view rest) {
    utf8proc_int32_t code = 0;
    const auto size =
        utf8proc_iterate(reinterpret_cast<const utf8proc_uint8_t*>(rest.data()), utf8proc_ssize_t(rest.size()), &code);
    return Character{kind_of(code), std::size_t(size)};
  };
  while (!text.empty()) {
    std::size_t size = contraction(text);
    if (size == 0) {
      const Character character = first(text);
      size = character.size;
      while (character.kind != Kind::digit && size < text.size()) {
        const Character next = first(text.substr(size));
        if (next.kind != character.kind) break;
        size += next.size;
      }
      if (character.kind == Kind::space) {
        text.remove_prefix(size);
        continue;
      }
    }
    encode_word(text.substr(0, size), out);
    text.remove_prefix(size);
  }
}

Result<std::vector<std::int64_t>> Tokenizer::encode(std::string_view prompt, std::size_t positions) const {
  if (prompt.size() > max_prompt_bytes)
    return fail(ErrorCode::too_large, "a prompt has at most " + std::to_string(max_prompt_bytes) + " bytes", "prompt");
  std::vector<std::int64_t> numbers{vocabulary_.begin};
  while (!prompt.empty()) {
    const std::size_t mark = std::min({prompt.find(begin_mark), prompt.find(end_mark), prompt.size()});
    const auto text = normalised(prompt.substr(0, mark));
    if (!text) return fail(ErrorCode::invalid_argument, "the prompt is no UTF-8", "prompt");
    encode_text(*text, numbers);
    prompt.remove_prefix(mark);
    if (prompt.empty()) break;
    const bool begins = prompt.starts_with(begin_mark);
    numbers.push_back(begins ? vocabulary_.begin : vocabulary_.end);
    prompt.remove_prefix(begins ? begin_mark.size() : end_mark.size());
  }
  numbers.resize(std::min(numbers.size(), positions - 1));
  numbers.push_back(vocabulary_.end);
  numbers.resize(positions, vocabulary_.filler);
  return numbers;
}

}  // namespace engine::diffusion
