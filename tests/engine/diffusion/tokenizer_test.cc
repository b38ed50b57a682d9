#include "engine/diffusion/tokenizer.h"

#include <gtest/gtest.h>

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
