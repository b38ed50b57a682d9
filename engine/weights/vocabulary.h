// The vocabulary of a text encoder: pieces of words, their numbers, and how letters merge into pieces.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/core/result.h"

namespace engine::weights {

/// Pieces are written as CLIP writes them: bytes as printable characters, "</w>" at the end of a word.
struct Vocabulary {
  std::unordered_map<std::string, int> numbers;
  std::vector<std::pair<std::string, std::string>> merges;  ///< The first are done first.
  int begin = 0, end = 0;                                   ///< Of "<|startoftext|>" and "<|endoftext|>".
  int filler = 0;                                           ///< What prompts are filled up with.
  std::string digest = {};                                  ///< Of the files that it was read from.
};

/// CLIP's own: 256 characters for bytes, the same at the end of a word, one piece for each merge, and the two marks.
/// Prompts are filled up with the end mark.
[[nodiscard]] Vocabulary clip_vocabulary(std::vector<std::pair<std::string, std::string>> merges);

/// The characters for bytes 0 to 255: Unicode's printable ones for themselves, others from U+0100 on; in UTF-8.
[[nodiscard]] const std::vector<std::string>& byte_characters();

/// Reads vocab.json, merges.txt and, for what prompts are filled up with, special_tokens_map.json, if there is one.
///   open_clip  without that file, prompts are filled up as 2.x does: by piece 0
///   pieces     of the text encoder that is given the numbers
///   errors     not_found: a file is missing; corrupt_data: not as such files are, a mark is missing, or a number is
///              none of a piece; `where` is "FILE:PLACE"
[[nodiscard]] Result<Vocabulary> read_vocabulary(const std::filesystem::path& folder, bool open_clip, int pieces);

/// The bytes of those files.
struct VocabularyFiles {
  std::vector<std::byte> vocab_json, merges_txt;
  std::optional<std::vector<std::byte>> special_tokens_map_json;  ///< Null: there is none.
};
/// The same of files in memory.
[[nodiscard]] Result<Vocabulary> parse_vocabulary(const VocabularyFiles& files, bool open_clip, int pieces);

}  // namespace engine::weights
