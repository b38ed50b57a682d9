// A tokenizer's files: vocab.json, merges.txt and special_tokens_map.json, in this order with a zero byte between. The
// last may be missing.
#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "engine/weights/vocabulary.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace engine::weights;

constexpr int pieces = 520;

VocabularyFiles split(std::span<const std::byte> bytes) {
  std::array<std::optional<std::vector<std::byte>>, 3> parts;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    // What follows the third zero is of the last file: none has one, but a stranger's may.
    const auto end = k + 1 < parts.size() ? std::ranges::find(bytes, std::byte{}) : bytes.end();
    parts[k].emplace(bytes.begin(), end);
    if (end == bytes.end()) break;
    bytes = bytes.subspan(std::size_t(end - bytes.begin()) + 1);
  }
  return {parts[0].value_or(std::vector<std::byte>()), parts[1].value_or(std::vector<std::byte>()), parts[2]};
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  const VocabularyFiles files = split(bytes);
  for (const bool open_clip : {false, true}) {
    const auto vocabulary = parse_vocabulary(files, open_clip, pieces);
    if (!vocabulary) {
      demand(!vocabulary.error().where.empty() && !vocabulary.error().message.empty(), "an error says where and what");
      continue;
    }
    for (const auto& [piece, number] : vocabulary->numbers)
      demand(number >= 0 && number < pieces, "a number is one of a piece");
    for (const int number : {vocabulary->begin, vocabulary->end, vocabulary->filler})
      demand(number >= 0 && number < pieces, "a mark is a piece");
  }
}

std::vector<std::string> fuzz::seeds() {
  const std::string marks = R"("<|startoftext|>":3,"<|endoftext|>":4})";
  const auto joined = [](const std::string& vocab, const std::string& merges, const std::string& special) {
    return vocab + '\0' + merges + '\0' + special;
  };
  return {joined(R"({"a":0,"b</w>":1,"ab</w>":2,)" + marks, "#version: 0.2\na b</w>\n", R"({"pad_token":"a"})"),
          joined(R"({"a":0,)" + marks, "a b\r\n", R"({"pad_token":{"content":"<|endoftext|>"}})"),
          "{" + marks + '\0' + "a b\n"};
}
