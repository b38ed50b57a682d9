#include "engine/diffusion/tokenizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "engine/core/rng.h"

namespace engine::diffusion {
namespace {

/// "hat" and "hats" are pieces; other letters stand alone.
Tokenizer tokenizer() { return Tokenizer(weights::clip_vocabulary({{"a", "t</w>"}, {"h", "at</w>"}, {"a", "t"}})); }

std::vector<std::int64_t> pieces_of(std::string_view prompt) {
  auto numbers = tokenizer().encode(prompt);
  EXPECT_TRUE(numbers);
  const weights::Vocabulary clip = weights::clip_vocabulary({{"a", "t</w>"}, {"h", "at</w>"}, {"a", "t"}});
  EXPECT_EQ(numbers->size(), 77u);
  EXPECT_EQ(numbers->front(), clip.begin);
  EXPECT_EQ(numbers->back(), clip.end);
  while (numbers->size() > 1 && numbers->back() == clip.end) numbers->pop_back();
  return {numbers->begin() + 1, numbers->end()};
}

constexpr std::int64_t at_end = 512, hat_end = 513, at_within = 514;

TEST(Tokenizer, MergesWhatWasMergedFirstAndNothingAcrossWords) {
  EXPECT_EQ(pieces_of("hat"), (std::vector<std::int64_t>{hat_end}));
  EXPECT_EQ(pieces_of("HAT at"), (std::vector<std::int64_t>{hat_end, at_end}));
  EXPECT_EQ(pieces_of("h at").size(), 2u);
  EXPECT_EQ(pieces_of("hats")[1], at_within) << "no piece ends before the end of its word";
}

TEST(Tokenizer, CutsAPromptThatIsTooLong) {
  std::string prompt;
  for (int i = 0; i < 100; ++i) prompt += "at ";
  EXPECT_EQ(pieces_of(prompt), std::vector<std::int64_t>(75, at_end));
}

/// Sennrich et al.'s algorithm as it stands there: in each round the first merge of the list that the word has,
/// everywhere.
std::vector<std::int64_t> merged_slowly(const weights::Vocabulary& clip, const std::string& word) {
  std::vector<std::string> pieces;
  for (const char c : word) pieces.emplace_back(1, c);
  pieces.back() += "</w>";
  for (bool again = true; again;) {
    again = false;
    for (const auto& [left, right] : clip.merges) {
      std::vector<std::string> merged;
      for (std::size_t i = 0; i < pieces.size(); ++i) {
        const bool merges = i + 1 < pieces.size() && pieces[i] == left && pieces[i + 1] == right;
        merged.push_back(merges ? left + right : pieces[i]);
        if (merges) ++i;
      }
      again = merged.size() < pieces.size();
      pieces = std::move(merged);
      if (again) break;
    }
  }
  std::vector<std::int64_t> numbers;
  for (const std::string& piece : pieces) numbers.push_back(clip.numbers.at(piece));
  return numbers;
}

TEST(Tokenizer, MergesAnyWordByAnyListAsTheAlgorithmStands) {
  Rng rng(3);
  for (int list = 0; list < 20; ++list) {
    // Merges of three letters and of what has merged before, in no order that a training would give them.
    std::vector<std::string> pieces = {"a", "b", "c", "a</w>", "b</w>", "c</w>"};
    std::vector<std::pair<std::string, std::string>> merges;
    std::set<std::string> made;
    const auto any = [&] {
      return pieces[std::min(pieces.size() - 1, std::size_t(rng.uniform() * float(pieces.size())))];
    };
    while (merges.size() < 30) {
      const std::string left = any(), right = any();
      if (left.ends_with("</w>") || !made.insert(left + right).second) continue;
      merges.emplace_back(left, right);
      pieces.push_back(left + right);
    }
    for (std::size_t i = merges.size() - 1; i > 0; --i)
      std::swap(merges[i], merges[std::min(i, std::size_t(rng.uniform() * float(i + 1)))]);
    const weights::Vocabulary clip = weights::clip_vocabulary(merges);
    const Tokenizer fast(clip);
    for (int sample = 0; sample < 20; ++sample) {
      std::string word;
      for (int i = 0; i < 40; ++i) word += char('a' + std::min(2, int(rng.uniform() * 3)));
      const auto numbers = fast.encode(word);
      ASSERT_TRUE(numbers);
      const auto expected = merged_slowly(clip, word);
      ASSERT_EQ(std::vector(numbers->begin() + 1, numbers->begin() + 1 + std::ptrdiff_t(expected.size())), expected);
      EXPECT_EQ((*numbers)[expected.size() + 1], clip.end);
    }
  }
}

TEST(Tokenizer, IsCutToAnyNumberOfPositions) {
  const weights::Vocabulary clip = weights::clip_vocabulary({});
  EXPECT_EQ(Tokenizer(clip).encode("a b", 1).value(), (std::vector<std::int64_t>{clip.end}));
  EXPECT_EQ(Tokenizer(clip).encode("a b", 2).value(), (std::vector<std::int64_t>{clip.begin, clip.end}));
  EXPECT_EQ(Tokenizer(clip).encode("a b", 3).value()[1], clip.numbers.at("a</w>"));
  EXPECT_FALSE(Tokenizer(clip).encode("a b \xff", 2)) << "what is cut off is read all the same";
}

TEST(Tokenizer, RefusesWhatIsNoUtf8AndWhatIsEndless) {
  const auto crooked = tokenizer().encode("caf\xe9");
  ASSERT_FALSE(crooked);
  EXPECT_EQ(crooked.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(crooked.error().where, "prompt");
  EXPECT_EQ(tokenizer().encode(std::string(max_prompt_bytes + 1, 'a')).error().code, ErrorCode::too_large);
  EXPECT_TRUE(tokenizer().encode(std::string(max_prompt_bytes, 'a')));
}

}  // namespace
}  // namespace engine::diffusion
