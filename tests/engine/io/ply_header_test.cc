#include "engine/io/ply_header.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/processor_time.h"

namespace engine::io {
namespace {

const std::string start = "ply\nformat binary_little_endian 1.0\n";

TEST(PlyHeader, KeepsTheTextAndLaysOutTheRows) {
  const std::string text =
      "ply\r\nformat binary_little_endian 1.0\r\ncomment  made by  hand\r\nobj_info x\r\nelement  vertex\t0012\r\n"
      "property float x\r\nproperty double w\r\nproperty uchar c\r\nelement face 3\r\n"
      "property list uchar int vertex_indices\r\nend_header\r\n";
  const auto header = parse_ply_header(text + "\x01\x02", "a.ply");
  ASSERT_TRUE(header) << header.error().message;
  EXPECT_EQ(header->text, text);
  EXPECT_EQ(header->format, PlyFormat::binary_little_endian);
  ASSERT_EQ(header->elements.size(), 2u);
  const PlyElement& vertex = header->elements[0];
  EXPECT_EQ(vertex.count, 12u);
  EXPECT_EQ(text.substr(vertex.count_begin, vertex.count_size), "0012");
  EXPECT_EQ(vertex.stride, 13u);
  EXPECT_EQ(vertex.find("w")->offset, 4u);
  EXPECT_EQ(vertex.find("w")->type, PlyType::float64);
  EXPECT_EQ(vertex.find("v"), nullptr);
  EXPECT_FALSE(vertex.has_list());
  EXPECT_TRUE(header->elements[1].has_list());
}

double seconds_to_parse(const std::string& text) {
  return support::processor_seconds([&] { EXPECT_TRUE(parse_ply_header(text, "a.ply")); }, 3);
}

std::string header_of(int properties, int elements) {
  std::string text = start + "element wide 1\n";
  for (int i = 0; i < properties; ++i) text += "property char p" + std::to_string(i) + "\n";
  for (int i = 0; i < elements; ++i) text += "element e" + std::to_string(i) + " 0\n";
  return text + "end_header\n";
}

// The largest header has room for 60,000 elements. Held against each other they took 9 s, and many elements after a
// wide one 8 times as long as as many lines of elements alone; in proportion it is about the same, on any machine.
TEST(PlyHeader, TakesTimeInProportionToItsLength) {
  const double of_elements = seconds_to_parse(header_of(0, 55'000));
  const double of_properties = seconds_to_parse(header_of(40'000, 10));
  const double of_both = seconds_to_parse(header_of(30'000, 25'000));
  EXPECT_LT(of_elements, 5 * of_properties);
  EXPECT_LT(of_both, 5 * of_elements);
  for (const double seconds : {of_elements, of_properties, of_both})
    EXPECT_LT(seconds, 2) << "far above what they take under a sanitizer: for what makes all of them slow alike";
  std::string text = header_of(0, 60'000);
  text.insert(text.size() - std::string("end_header\n").size(), "element e7 0\n");
  const auto twice = parse_ply_header(text, "a.ply");
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error().message, "line 60004 of the header: a second element 'e7'");
}

TEST(PlyHeader, NamesTheLineThatIsWrong) {
  const struct {
    std::string text, message;
  } cases[] = {
      {start + "element vertex -5\n", "line 3 of the header: expected a whole number of 'vertex' rows"},
      {start + "element vertex 1e9\n", "found '1e9'"},
      {start + "element vertex 18446744073709551616\n", "found '18446744073709551616'"},
      {start + "element vertex\n", "expected 'element NAME COUNT'"},
      {start + "element vertex 1\nelement vertex 2\n", "line 4 of the header: a second element 'vertex'"},
      {start + "property float x\n", "a property before the first element"},
      {start + "element vertex 1\nproperty float x\nproperty int x\n", "line 5 of the header: a second property 'x'"},
      {start + "element vertex 1\nproperty half x\n", "unknown type 'half'"},
      {start + "element vertex 1\nproperty float\n", "expected 'property TYPE NAME'"},
      {start + "element vertex 1\nproperty list uchar x\n", "expected 'property TYPE NAME'"},
      {start + "vertices 1\n", "unknown keyword 'vertices'"},
      {start + "format ascii 1.0\n", "expected one 'format KIND 1.0'"},
      {"ply\nformat binary 1.0\n", "unknown format 'binary'"},
      {"ply\nelement vertex 1\nend_header\n", "the header has no 'format' line"},
      {start + "element vertex 1\n", "the file ends before 'end_header'"},
      {start + std::string(100, '\x01') + "\n", "unknown keyword '" + std::string(40, '?') + "...'"},
      {"plx\n", "a .ply file begins with a line 'ply'"},
  };
  for (const auto& [text, message] : cases) {
    const auto header = parse_ply_header(text, "chair.ply");
    ASSERT_FALSE(header) << text;
    EXPECT_NE(header.error().message.find(message), std::string::npos) << header.error().message;
    EXPECT_EQ(header.error().where, "chair.ply:header");
  }
}

TEST(PlyHeader, GivesUpOnAHeaderOfMoreThanAMebibyte) {
  std::string text = start;
  while (text.size() <= max_ply_header_bytes) text += "comment and on it goes\n";
  const auto header = parse_ply_header(text + "end_header\n", "chair.ply");
  ASSERT_FALSE(header);
  EXPECT_EQ(header.error().code, ErrorCode::too_large);
}

}  // namespace
}  // namespace engine::io
