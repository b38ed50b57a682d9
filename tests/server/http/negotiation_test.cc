#include "server/http/negotiation.h"

#include <gtest/gtest.h>

#include <initializer_list>

namespace server::http {
namespace {

/// A header's value, what is looked for, and whether the header lets it through.
struct Case {
  const char* header;
  const char* sought;
  bool expected;
};

TEST(Accepts, LetsTheMostSpecificElementDecide) {
  for (const auto& [header, type, expected] : std::initializer_list<Case>{
           {"", "image/png", true},
           {"*/*", "image/png", true},
           {"image/*", "image/png", true},
           {"text/html, IMAGE/PNG;q=0.1", "image/png", true},
           {"text/html", "image/png", false},
           {"image/png;q=0", "image/png", false},
           {"*/*, image/png; q=0.000", "image/png", false},
           {"*/*;q=0, image/png", "image/png", true},
           {"im*/*", "image/png", false},
           {";;,", "image/png", false},
       })
    EXPECT_EQ(accepts(header, type), expected) << header;
}

TEST(NamesEtag, ComparesWeakly) {
  for (const auto& [header, etag, expected] : std::initializer_list<Case>{
           {"\"a\"", "a", true},
           {"W/\"a\"", "a", true},
           {"\"b\" , \"a\"", "a", true},
           {"*", "a", true},
           {"\"x,y\"", "x,y", true},
           {"a", "a", false},
           {"\"ab\"", "a", false},
           {"", "a", false},
       })
    EXPECT_EQ(names_etag(header, etag), expected) << header;
}

TEST(EtagOf, DiffersWithTheBytes) {
  EXPECT_EQ(etag_of("abc"), etag_of("abc"));
  EXPECT_NE(etag_of("abc"), etag_of("abd"));
  EXPECT_NE(etag_of(""), etag_of(std::string(1, '\0')));
}

TEST(ChooseRange, FollowsTheStandard) {
  const auto part = [](const char* range, std::uint64_t size) {
    const auto choice = choose_range(range, size);
    return choice.kind == RangeKind::part ? std::to_string(choice.range.first) + "-" + std::to_string(choice.range.last)
           : choice.kind == RangeKind::whole ? "whole"
                                             : "unsatisfiable";
  };
  EXPECT_EQ(part("bytes=0-0", 10), "0-0");
  EXPECT_EQ(part("bytes=5-", 10), "5-9");
  EXPECT_EQ(part("bytes=-3", 10), "7-9");
  EXPECT_EQ(part("bytes=-30", 10), "0-9");
  EXPECT_EQ(part("bytes=3-30", 10), "3-9");
  EXPECT_EQ(part("bytes=10-", 10), "unsatisfiable");
  EXPECT_EQ(part("bytes=-0", 10), "unsatisfiable");
  EXPECT_EQ(part("bytes=0-", 0), "unsatisfiable");
  for (const char* odd : {"", "bytes", "bytes=", "bytes=-", "bytes=5-3", "bytes=a-b", "bytes=1-2,4-5", "items=1-2",
                          "bytes=1-18446744073709551616", "bytes=+1-2"})
    EXPECT_EQ(part(odd, 10), "whole") << odd;
  EXPECT_EQ(part("bytes=1-18446744073709551615", 10), "1-9");
}

TEST(BoundaryOf, TakesOnlyWhatIsOne) {
  EXPECT_EQ(boundary_of("multipart/form-data; boundary=abc"), "abc");
  EXPECT_EQ(boundary_of("multipart/form-data; a=b; Boundary=\"a;b\""), std::nullopt);
  EXPECT_EQ(boundary_of("multipart/form-data; boundary=\"a:b\""), "a:b");
  EXPECT_EQ(boundary_of("multipart/form-data; boundary=" + std::string(71, 'a')), std::nullopt);
  EXPECT_EQ(boundary_of("multipart/form-data; boundary="), std::nullopt);
  EXPECT_EQ(boundary_of("multipart/form-data"), std::nullopt);
}

TEST(BaseName, IsFitForAFolder) {
  EXPECT_EQ(base_name("a/b\\c.ply"), "c.ply");
  EXPECT_EQ(base_name("../../etc/passwd"), "passwd");
  EXPECT_EQ(base_name(".."), "");
  EXPECT_EQ(base_name("a\r\nb"), "ab");
  EXPECT_EQ(base_name("caf\xc3\xa9"), "caf\xc3\xa9");
  EXPECT_EQ(base_name("caf\xe9"), "caf_");
  std::string accents;
  for (int i = 0; i < 200; ++i) accents += "\xc3\xa9";
  EXPECT_EQ(base_name(accents).size(), 254u);
}

}  // namespace
}  // namespace server::http
