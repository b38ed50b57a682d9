#include "server/service/page_text.h"

#include <gtest/gtest.h>

#include "server/service/embedded_files.h"

namespace server::service {
namespace {

TEST(PageText, LosesCommentsAndIndentationAndNoLine) {
  EXPECT_EQ(page_text("a.js",
                      "// What it is.\n"
                      "import a from \"./b.js\"; // why\n"
                      "\n"
                      "/** Sums.\n"
                      " *    x  a number */\n"
                      "export const f = (x) => {\n"
                      "  // A trap.\n"
                      "  return x + 1 // 2;\n"
                      "};\n"),
            "\n"
            "import a from \"./b.js\"; // why\n"
            "\n"
            "\n"
            "\n"
            "export const f = (x) => {\n"
            "\n"
            "return x + 1 // 2;\n"
            "};\n");
  EXPECT_EQ(page_text("a.css", "/* One,\n   two. */\n  a { color: red; }\n/* b */ b { }\n//c {}"),
            "\n\na { color: red; }\n b { }\n//c {}");
  for (const char* whole : {"", "/*", "/**/", "x", "\n\n"})
    EXPECT_LE(page_text("a.js", whole).size(), std::string_view(whole).size()) << whole;
  EXPECT_EQ(page_text("index.html", "  <p>\n  // no comment\n"), "  <p>\n  // no comment\n");
}

TEST(PageText, OfThePageIsLessThanAQuarterOfAMegabyte) {
  std::size_t bytes = 0;
  for (const EmbeddedFile& file : page_files()) bytes += page_text(file.name, file.bytes).size();
  EXPECT_GT(bytes, 100'000u) << "is that the page?";
  EXPECT_LT(bytes, 250'000u);
}

}  // namespace
}  // namespace server::service
