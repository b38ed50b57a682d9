// Prompts into numbers of pieces of words, exactly as CLIP was trained with them.
// Source: Radford et al. 2021, "Learning transferable visual models from natural language supervision", section 2.4;
// Sennrich et al. 2016, "Neural machine translation of rare words with subword units" (the merging).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "engine/core/result.h"
#include "engine/weights/vocabulary.h"

namespace engine::diffusion {

constexpr std::size_t max_prompt_bytes = 4096;  // of which 75 pieces are used

/// Safe to use from any thread.
class Tokenizer {
 public:
  explicit Tokenizer(weights::Vocabulary vocabulary);

  /// The pieces of a prompt between the two marks, filled up or cut to `positions` numbers. Takes n log n of its length
  /// n.
  ///   prompt     UTF-8; normalised (NFC) and lower-cased. "<|startoftext|>" and "<|endoftext|>" in it are the marks
  ///   positions  1 or more
  ///   errors  invalid_argument: it is no UTF-8; too_large: more than max_prompt_bytes. `where` is "prompt"
  [[nodiscard]] Result<std::vector<std::int64_t>> encode(std::string_view prompt, std::size_t positions = 77) const;

 private:
  /// Two pieces that merge.
  struct Merge {
    std::uint32_t rank;  ///< The least is done first.
    std::uint32_t piece;
  };
  void encode_text(std::string_view text, std::size_t most, std::vector<std::int64_t>& out) const;
  void encode_word(std::string_view word, std::vector<std::int64_t>& out) const;
  [[nodiscard]] const Merge* merge_of(std::uint32_t left, std::uint32_t right) const;

  // Pieces are counted as they are met: those of bytes, the same at the end of a word, those of merges.
  std::vector<std::int64_t> numbers_;  ///< Of each piece, the vocabulary's.
  std::vector<std::uint32_t> of_byte_, of_last_byte_;
  std::unordered_map<std::uint64_t, Merge> merges_;  ///< By both pieces, the left one in the upper half.
  std::int64_t begin_, end_, filler_;
};

}  // namespace engine::diffusion
