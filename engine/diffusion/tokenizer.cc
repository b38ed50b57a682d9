#include "engine/diffusion/tokenizer.h"

#include <utf8proc.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <queue>
#include <utility>

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

std::uint64_t pair_of(std::uint32_t left, std::uint32_t right) { return std::uint64_t{left} << 32 | right; }

/// Length of the ending of an English word that stands here ("'s"), 0 if none does.
std::size_t contraction(std::string_view text) {
  for (const std::string_view ending : {"'s", "'t", "'re", "'ve", "'m", "'ll", "'d"})
    if (text.starts_with(ending)) return ending.size();
  return 0;
}

}  // namespace

Tokenizer::Tokenizer(weights::Vocabulary vocabulary)
    : begin_(vocabulary.begin), end_(vocabulary.end), filler_(vocabulary.filler) {
  std::unordered_map<std::string, std::uint32_t> pieces;
  const auto piece_of = [&](const std::string& text) {
    const auto [found, is_new] = pieces.emplace(text, std::uint32_t(pieces.size()));
    if (is_new) {
      const auto number = vocabulary.numbers.find(text);
      numbers_.push_back(number != vocabulary.numbers.end() ? number->second : vocabulary.end);
    }
    return found->second;
  };
  for (const std::string& character : weights::byte_characters()) {
    of_byte_.push_back(piece_of(character));
    of_last_byte_.push_back(piece_of(character + "</w>"));
  }
  std::uint32_t rank = 0;
  for (const auto& [left, right] : vocabulary.merges)  // a pair that is listed twice is of its first rank
    merges_.emplace(pair_of(piece_of(left), piece_of(right)), Merge{rank++, piece_of(left + right)});
}

const Tokenizer::Merge* Tokenizer::merge_of(std::uint32_t left, std::uint32_t right) const {
  const auto found = merges_.find(pair_of(left, right));
  return found == merges_.end() ? nullptr : &found->second;
}

/// Round by round the merge of least rank, wherever it stands, from left to right. Places that may merge wait in a
/// heap: a long word takes n log n, where looking through all of it in each round would take the square.
void Tokenizer::encode_word(std::string_view word, std::vector<std::int64_t>& out) const {
  constexpr std::size_t none = std::size_t(-1);
  struct Place {
    std::uint32_t piece;
    std::size_t before, after;  ///< Neighbours; none at the ends.
    bool merged = false;        ///< Into the place before it.
  };
  std::vector<Place> places;
  for (std::size_t i = 0; i < word.size(); ++i) {
    const bool last = i + 1 == word.size();
    places.push_back(
        {(last ? of_last_byte_ : of_byte_)[std::uint8_t(word[i])], i == 0 ? none : i - 1, last ? none : i + 1});
  }
  /// What may merge at a place, as it was when it was noted.
  struct Candidate {
    std::uint32_t rank;
    std::size_t at;
    std::uint32_t left, right, piece;
    bool operator>(const Candidate& other) const { return std::pair(rank, at) > std::pair(other.rank, other.at); }
  };
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> waiting;
  const auto note = [&](std::size_t at) {
    if (at == none || places[at].after == none) return;
    const std::uint32_t left = places[at].piece, right = places[places[at].after].piece;
    if (const Merge* const merge = merge_of(left, right)) waiting.push({merge->rank, at, left, right, merge->piece});
  };
  for (std::size_t i = 0; i < places.size(); ++i) note(i);
  std::vector<std::size_t> merged;
  while (!waiting.empty()) {
    const std::uint32_t rank = waiting.top().rank;
    merged.clear();
    for (; !waiting.empty() && waiting.top().rank == rank; waiting.pop()) {
      const Candidate next = waiting.top();
      Place& place = places[next.at];
      if (place.merged || place.piece != next.left || place.after == none || places[place.after].piece != next.right)
        continue;  // one of the two has merged otherwise since
      Place& right = places[place.after];
      place.piece = next.piece;
      right.merged = true;
      place.after = right.after;
      if (place.after != none) places[place.after].before = next.at;
      merged.push_back(next.at);
    }
    // What the merged ones may merge with counts from the next round on.
    for (const std::size_t at : merged) {
      if (places[at].merged) continue;
      note(places[at].before);
      note(at);
    }
  }
  for (const Place& place : places)
    if (!place.merged) out.push_back(numbers_[place.piece]);
}

/// Ends when `out` has `most` numbers.
void Tokenizer::encode_text(std::string_view text, std::size_t most, std::vector<std::int64_t>& out) const {
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
  while (!text.empty() && out.size() < most) {
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
  assert(positions >= 1);
  if (prompt.size() > max_prompt_bytes)
    return fail(ErrorCode::too_large, "a prompt has at most " + std::to_string(max_prompt_bytes) + " bytes", "prompt");
  std::vector<std::int64_t> numbers{begin_};
  while (!prompt.empty()) {
    const std::size_t mark = std::min({prompt.find(begin_mark), prompt.find(end_mark), prompt.size()});
    const auto text = normalised(prompt.substr(0, mark));
    if (!text) return fail(ErrorCode::invalid_argument, "the prompt is no UTF-8", "prompt");
    encode_text(*text, positions - 1, numbers);
    prompt.remove_prefix(mark);
    if (prompt.empty()) break;
    const bool begins = prompt.starts_with(begin_mark);
    numbers.push_back(begins ? begin_ : end_);
    prompt.remove_prefix(begins ? begin_mark.size() : end_mark.size());
  }
  numbers.resize(std::min(numbers.size(), positions - 1));
  numbers.push_back(end_);
  numbers.resize(positions, filler_);
  return numbers;
}

}  // namespace engine::diffusion
