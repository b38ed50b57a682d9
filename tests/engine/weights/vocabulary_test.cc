#include "engine/weights/vocabulary.h"

#include <gtest/gtest.h>

#include "tests/support/data.h"

namespace engine::weights {
namespace {

Result<Vocabulary> read(const std::string& vocab, const std::string& merges, const std::string& special = "",
                        bool open_clip = false) {
  const support::TempDir folder;
  support::write_file(folder.path() / "vocab.json", vocab);
  support::write_file(folder.path() / "merges.txt", merges);
  if (!special.empty()) support::write_file(folder.path() / "special_tokens_map.json", special);
  return read_vocabulary(folder.path(), open_clip, 6);
}

const std::string pieces = R"({"!":0,"a":1,"b</w>":2,"ab</w>":3,"<|startoftext|>":4,"<|endoftext|>":5})";

TEST(Vocabulary, ClipsOwnBeginsWithPrintableBytes) {
  const Vocabulary clip = clip_vocabulary({{"a", "b</w>"}});
  EXPECT_EQ(clip.numbers.at("!"), 0);
  EXPECT_EQ(clip.numbers.at("a"), 64);
  EXPECT_EQ(clip.numbers.at("!</w>"), 256);
  EXPECT_EQ(clip.numbers.at("\u0100"), 188) << "byte 0 comes after all printable ones";
  EXPECT_EQ(clip.numbers.at("ab</w>"), 512);
  EXPECT_EQ(clip.begin, 513);
  EXPECT_EQ(clip.end, 514);
}

TEST(Vocabulary, IsReadFromItsFiles) {
  const auto read_back = read(pieces, "#version: 0.2\na b</w>\r\n\n");
  ASSERT_TRUE(read_back) << read_back.error().message;
  ASSERT_EQ(read_back->merges.size(), 1u);
  EXPECT_EQ(read_back->merges[0], std::pair(std::string("a"), std::string("b</w>")));
  EXPECT_EQ(read_back->begin, 4);
  EXPECT_EQ(read_back->end, 5);
}

TEST(Vocabulary, PromptsAreFilledUpAsItsFilesSay) {
  EXPECT_EQ(read(pieces, "a b</w>\n")->filler, 5);
  EXPECT_EQ(read(pieces, "a b</w>\n", "", true)->filler, 0) << "2.x without a file that says so";
  EXPECT_EQ(read(pieces, "a b</w>\n", R"({"pad_token":"!"})")->filler, 0);
  EXPECT_EQ(read(pieces, "a b</w>\n", R"({"pad_token":{"content":"<|endoftext|>"}})", true)->filler, 5);
  EXPECT_EQ(read(pieces, "a b</w>\n", R"({"pad_token":"?"})").error().where, "special_tokens_map.json:pad_token");
}

TEST(Vocabulary, WhatIsWrongIsNamed) {
  EXPECT_EQ(read(R"({"a":0,"<|startoftext|>":1})", "").error().where, "vocab.json:<|endoftext|>");
  EXPECT_EQ(read(R"({"a":-1})", "").error().where, "vocab.json:a");
  EXPECT_EQ(read("[]", "").error().where, "vocab.json");
  EXPECT_EQ(read(pieces, "#version\na b</w>\nab\n").error().where, "merges.txt:3");
  EXPECT_EQ(read_vocabulary("/nowhere", false, 6).error().code, ErrorCode::not_found);
}

TEST(Vocabulary, NumbersThatAreNoneOfAPieceAreNamed) {
  const auto where = [](const std::string& number) {
    const auto found = read("{\"a\":" + number + R"(,"<|startoftext|>":1,"<|endoftext|>":2})", "");
    return found ? "accepted" : found.error().where;
  };
  EXPECT_EQ(where("5"), "accepted");
  for (const char* number :
       {"6", "4294967296", "18446744073709551616", "1.5", "1e3", "\"1\"", "null", "[0]", "{}", "true"})
    EXPECT_EQ(where(number), "vocab.json:a") << number;
}

TEST(Vocabulary, CutShortItIsRefusedOrHasFewerMerges) {
  for (std::size_t size = 0; size < pieces.size(); ++size) {
    const auto cut = read(pieces.substr(0, size), "a b</w>\n");
    ASSERT_FALSE(cut) << size;
    EXPECT_TRUE(cut.error().where.starts_with("vocab.json")) << cut.error().where;
  }
  const std::string merges = "#version: 0.2\na b</w>\nab b</w>\n";
  for (std::size_t size = 0; size < merges.size(); ++size)
    if (const auto cut = read(pieces, merges.substr(0, size)); !cut) {
      EXPECT_TRUE(cut.error().where.starts_with("merges.txt:")) << size << ": " << cut.error().where;
    }
  const std::string special = R"({"pad_token":{"content":"!"}})";
  for (std::size_t size = 1; size < special.size(); ++size)
    EXPECT_FALSE(read(pieces, "", special.substr(0, size))) << size;
}

TEST(Vocabulary, WhatIsNoTextOrNestedWithoutEndIsRefused) {
  EXPECT_EQ(read(std::string("\0\xff\xfe", 3), "").error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(read("{\"a\":" + std::string(100'000, '['), "").error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(read("{\"\xff\":0}", "").error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(read(pieces, std::string(3, '\0')).error().where, "merges.txt:1");
  EXPECT_TRUE(read(pieces, "\xff \xfe\n")) << "pieces are bytes: one that no word has is of no use, and no harm";
}

TEST(Vocabulary, ItsDigestIsOfAllItsFiles) {
  const std::string usual = read(pieces, "a b</w>\n")->digest;
  EXPECT_EQ(read(pieces, "a b</w>\n")->digest, usual);
  EXPECT_NE(read(pieces, "a b</w>\n\n")->digest, usual);
  EXPECT_NE(read(pieces + " ", "a b</w>\n")->digest, usual);
  EXPECT_NE(read(pieces, "a b</w>\n", R"({"pad_token":"!"})")->digest, usual);
}

}  // namespace
}  // namespace engine::weights
