// Prompts into numbers of pieces of words, exactly as CLIP was trained with them.
// Source: Radford et al. 2021, "Learning transferable visual models from natural language supervision", section 2.4;
// Sennrich et al. 2016, "Neural machine translation of rare words with subword units" (the merging).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "engine/core/result.h"
#include "engine/weights/vocabulary.h"

namespace engine::diffusion {

constexpr std::size_t max_prompt_bytes =
    4096;  // of which 75 pieces are used; merging takes the square of a word's length

/// Safe to use from any thread.
class Tokenizer {
 public:
  explicit Tokenizer(weights::Vocabulary vocabulary);

  /// The pieces of a prompt between the two marks, filled up or cut to `positions` numbers.
  ///   prompt  UTF-8; normalised (NFC) and lower-cased. "<|startoftext|>" and "<|endoftext|>" in it are the marks
  ///   errors  invalid_argument: it is no UTF-8; too_large: more than max_prompt_bytes. `where` is "prompt"
  [[nodiscard]] Result<std::vector<std::int64_t>> encode(std::string_view prompt, std::size_t positions = 77) const;

 private:
  void encode_text(std::string_view text, std::vector<std::int64_t>& out) const;
  void encode_word(std::string_view word, std::vector<std::int64_t>& out) const;

  weights::Vocabulary vocabulary_;
  std::unordered_map<std::string, std::size_t> ranks_;  ///< Of "LEFT RIGHT".
};

}  // namespace engine::diffusion
