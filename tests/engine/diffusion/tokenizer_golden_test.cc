#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/diffusion/tokenizer.h"
#include "engine/io/gzip.h"
#include "tests/support/data.h"

namespace engine::diffusion {
namespace {

using Numbers = std::vector<std::int64_t>;

TEST(TokenizerGolden, TinyVocabulary) {
  REQUIRE_SHARED(support::golden_dir() / "tokenizer.json");
  auto vocabulary = weights::read_vocabulary(support::golden_dir() / "tiny_sd/tokenizer", false, 765);
  ASSERT_TRUE(vocabulary) << vocabulary.error().message;
  const Tokenizer tokenizer(std::move(*vocabulary));
  const auto cases = nlohmann::json::parse(support::read_file(support::golden_dir() / "tokenizer.json"))["cases"];
  ASSERT_EQ(cases.size(), 19u);
  for (const auto& example : cases) {
    const auto prompt = example["prompt"].get<std::string>();
    const auto numbers = tokenizer.encode(prompt);
    ASSERT_TRUE(numbers) << prompt;
    // Where the two tokenizers of the reference differ, ours is the fast one.
    const auto& expected =
        example["slow_equals_fast"].get<bool>() ? example["input_ids"] : example["input_ids_fast_semantics"];
    EXPECT_EQ(*numbers, expected.get<Numbers>()) << prompt;
  }
}

/// CLIP's own merges: the lines after the first, as many as its vocabulary has.
weights::Vocabulary real_vocabulary() {
  const std::string packed = support::read_file(support::golden_dir() / "real_clip_bpe/bpe_simple_vocab_16e6.txt.gz");
  io::GzipReader reader(std::as_bytes(std::span(packed)));
  std::string text(std::size_t{4} << 20, '\0');
  text.resize(reader.read_some(std::as_writable_bytes(std::span(text))));
  std::vector<std::pair<std::string, std::string>> merges;
  std::size_t line = text.find('\n') + 1;
  while (merges.size() < 48894) {
    const std::size_t end = text.find('\n', line), space = text.find(' ', line);
    merges.emplace_back(text.substr(line, space - line), text.substr(space + 1, end - space - 1));
    line = end + 1;
  }
  return weights::clip_vocabulary(std::move(merges));
}

TEST(TokenizerGolden, RealVocabulary) {
  REQUIRE_SHARED(support::golden_dir() / "real_clip_bpe");
  const weights::Vocabulary vocabulary = real_vocabulary();
  EXPECT_EQ(vocabulary.numbers.size(), 49408u);
  EXPECT_EQ(vocabulary.begin, 49406);
  EXPECT_EQ(vocabulary.end, 49407);
  const Tokenizer tokenizer(vocabulary);
  const auto cases =
      nlohmann::json::parse(support::read_file(support::golden_dir() / "tokenizer_real_vocab.json"))["cases"];
  ASSERT_EQ(cases.size(), 19u);
  for (const auto& example : cases) {
    auto prompt = example["prompt"].get<std::string>();
    // The reference's slow tokenizer, of which these are, parts ideographs; the fast one and CLIP's own do not.
    if (prompt == "山水画 painting") prompt = "山 水 画 painting";
    auto expected = example["input_ids_unpadded"].get<Numbers>();
    expected.resize(77, 49407);
    const auto numbers = tokenizer.encode(prompt);
    ASSERT_TRUE(numbers) << prompt;
    EXPECT_EQ(*numbers, expected) << prompt;
  }
}

}  // namespace
}  // namespace engine::diffusion
