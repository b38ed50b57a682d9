#include "engine/params/listing.h"

#include <gtest/gtest.h>

#include "engine/params/params.h"

namespace engine::params {
namespace {

bool holds(const std::string& text, std::string_view part) { return text.find(part) != std::string::npos; }

TEST(Listing, SaysOfEveryParameterWhatItMeans) {
  const std::string text = listing();
  for_each_parameter([&](const auto& parameter) {
    EXPECT_EQ(holds(text, "\n  " + std::string(parameter.name) + ": "), parameter.on_wire) << parameter.name;
    EXPECT_EQ(holds(text, parameter.meaning), parameter.on_wire) << parameter.name;
  });
}

TEST(Listing, NamesValuesUnitAndDefaults) {
  const std::string text = listing();
  EXPECT_TRUE(holds(text, "  max_image_side: whole number, 16 to 16384 pixels\n")) << text;
  EXPECT_TRUE(holds(text, "Default: 512; draft: 384\n")) << text;
  EXPECT_TRUE(holds(text, "  corrector: none | scene | sd\n")) << text;
  EXPECT_TRUE(holds(text, "Default: scene; preview: none\n")) << text;
  EXPECT_TRUE(holds(text, "Default: from the drag; paper: 5\n")) << text;
  EXPECT_TRUE(holds(text, "Default: 0.5\n")) << text;
}

}  // namespace
}  // namespace engine::params
