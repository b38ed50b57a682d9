#include "server/edits/stages.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/data.h"

namespace server::edits {
namespace {

TEST(Stages, TheContractAndThePageNameAllOfThemAndNoOthers) {
  std::string wanted = "enum: [";
  for (const std::string_view name : stage_names())
    wanted += std::string(wanted.ends_with('[') ? "" : ", ") + std::string(name);
  const std::string contract = support::read_file(support::source_dir() / "proto/openapi.yaml");
  EXPECT_NE(contract.find(wanted + "]\n"), std::string::npos) << wanted;

  const std::string page = support::read_file(support::source_dir() / "web/edits.js");
  const std::size_t begin = page.find("const STAGES = {"), end = page.find("};", begin);
  ASSERT_NE(begin, std::string::npos);
  std::string stages = page.substr(begin, end - begin);
  std::size_t lines = 0;
  for (const char c : stages) lines += c == '\n';
  EXPECT_EQ(lines, stage_names().size() + 1);
  for (const std::string_view name : stage_names())
    EXPECT_NE(stages.find("\n  " + std::string(name) + ": "), std::string::npos) << name;
}

}  // namespace
}  // namespace server::edits
