#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/house/house_rules.h"

namespace house {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

/// Contents, by path from the project's root, of the files in these folders; node_modules holds others' sources.
std::map<std::string, std::string> files_in(const std::vector<std::string>& tops) {
  const fs::path root = SPLATDRAG_SOURCE_DIR;
  std::map<std::string, std::string> files;
  for (const std::string& top : tops)
    for (auto entry = fs::recursive_directory_iterator(root / top); entry != fs::recursive_directory_iterator();
         ++entry) {
      if (entry->path().filename() == "node_modules") entry.disable_recursion_pending();
      if (entry->is_regular_file()) files[fs::relative(entry->path(), root).generic_string()] = contents(entry->path());
    }
  return files;
}

const Arrows sample{
    {"engine/core", {}}, {"engine/scene", {"engine/core"}}, {"engine/io", {"engine/scene"}}, {"proto", {}}};

/// Number of complaints about a file of this content.
std::size_t complaints(const std::string& file, const std::string& source) {
  return violations(sample, file, source).size();
}

TEST(House, EverySourceKeepsTheRules) {
  const auto files = files_in({"engine", "proto", "server"});
  EXPECT_GT(files.size(), 50u) << "the sources are not where this test looks for them";
  for (const std::string& violation : violations(parse_arrows(contents(SPLATDRAG_ARROWS_FILE)), files))
    ADD_FAILURE() << violation;
}

TEST(House, EverySourceIncludesWhatItCalls) {
  const auto files = files_in({"engine", "proto", "server", "bench", "tests"});
  EXPECT_GT(files.size(), 500u) << "the sources are not where this test looks for them";
  for (const auto& [file, source] : files)
    if (file.ends_with(".cc") || file.ends_with(".h"))
      for (const std::string& lacking : lacks_includes(file, source)) ADD_FAILURE() << lacking;
}

TEST(House, ArrowsPointOneWay) {
  const Arrows arrows = parse_arrows(contents(SPLATDRAG_ARROWS_FILE));
  EXPECT_TRUE(arrows.contains("engine/core"));
  std::string circle;
  for (const std::string& room : find_circle(arrows)) circle += room + " ";
  EXPECT_EQ(circle, "");
}

TEST(House, EngineKnowsNeitherWireNorProgram) {
  for (const auto& [room, uses] : parse_arrows(contents(SPLATDRAG_ARROWS_FILE))) {
    if (!room.starts_with("engine/")) continue;
    for (const std::string& used : uses) EXPECT_TRUE(used.starts_with("engine/")) << room << " uses " << used;
  }
}

TEST(HouseRules, ReadTheArrowsThatCMakeWrites) {
  EXPECT_EQ(parse_arrows("engine/core: \nengine/scene: engine_core\nserver: splatdrag_proto engine_scene\n"),
            (Arrows{{"engine/core", {}}, {"engine/scene", {"engine/core"}}, {"server", {"proto", "engine/scene"}}}));
}

TEST(HouseRules, ReportAnArrowNobodyDeclared) {
  EXPECT_EQ(complaints("engine/io/ply.cc", "#include \"engine/scene/image.h\"\n#include \"engine/io/ply.h\"\n"), 0u);
  EXPECT_EQ(complaints("engine/io/ply.cc", "#include \"engine/core/vec.h\"\n"), 1u) << "not through another room";
  EXPECT_EQ(complaints("engine/scene/image.cc", "  #  include \"engine/io/ply.h\"\n"), 1u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include <engine/io/ply.h>\n"), 1u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include \"proto/edit_request.h\"\n"), 1u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include \"image.h\"\n"), 1u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include \"tests/support/data.h\"\n"), 1u);
  EXPECT_EQ(complaints("engine/cellar/a.cc", ""), 1u) << "a folder that is no room";
}

TEST(HouseRules, ReportALibraryInTheWrongRoom) {
  EXPECT_EQ(complaints("engine/io/image_file.cc", "#include <OpenImageIO/imageio.h>\n#include <nlohmann/json.hpp>\n"),
            0u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include <OpenImageIO/imageio.h>\n"), 1u);
  EXPECT_EQ(complaints("engine/scene/image.cc", "#include <nlohmann/json.hpp>\n"), 1u);
  EXPECT_EQ(complaints("engine/io/ply.cc", "#include <flann/flann.hpp>\n#include <torch/torch.h>\n"), 2u);
  EXPECT_EQ(complaints("engine/io/ply.cc", "#include <tbb/parallel_for.h>\n#include <httplib.h>\n"), 2u);
  EXPECT_EQ(complaints("engine/io/ply.cc", "#include <vector>\n// #include <torch/torch.h>\n"), 0u);
}

TEST(HouseRules, KeepTorchOutOfHeadersEvenInItsRoom) {
  const Arrows arrows{{"engine/diffusion", {}}};
  EXPECT_EQ(violations(arrows, "engine/diffusion/unet.cc", "#include <torch/torch.h>\n").size(), 0u);
  EXPECT_EQ(violations(arrows, "engine/diffusion/unet.h", "#pragma once\n#include <torch/torch.h>\n").size(), 1u);
}

TEST(HouseRules, ReportAHeaderThatIsNoGoodNeighbour) {
  EXPECT_EQ(complaints("engine/core/vec.h", "#pragma once\nusing engine::Vec3;\n"), 0u);
  EXPECT_EQ(complaints("engine/core/vec.h", "namespace engine {}\n"), 1u) << "no #pragma once";
  EXPECT_EQ(complaints("engine/core/vec.h", "#pragma once\n  using namespace std;\n"), 1u);
  EXPECT_EQ(complaints("engine/core/vec.cc", "using namespace std::chrono_literals;\n"), 0u);
}

TEST(HouseRules, HoldForWhateverIsIncluded) {
  const auto complaints_about = [](const std::string& part, const std::string& source) {
    return violations(sample, {{"engine/scene/sum.cc", "#include \"" + part + "\"\n"}, {part, source}});
  };
  const std::string part = "engine/scene/sum.inc";
  EXPECT_TRUE(complaints_about(part, "#include \"engine/core/vec.h\"\n").empty()) << "it needs no #pragma once";
  EXPECT_EQ(complaints_about(part, "#include \"engine/io/ply.h\"\n").size(), 1u);
  EXPECT_EQ(complaints_about(part, "#include <zstd.h>\n").size(), 1u);
  EXPECT_EQ(complaints_about(part, "using namespace std;\n").size(), 1u);
  EXPECT_EQ(complaints_about("engine/scene/sums.def", "#include <zstd.h>\n").size(), 1u) << "whatever its name";
}

TEST(HouseRules, HoldForPartsOfParts) {
  const auto found = violations(sample, {{"engine/scene/sum.cc", "#include \"engine/scene/sum.inc\"\n"},
                                         {"engine/scene/sum.inc", "\n#include \"engine/scene/lanes.inc\"\n"},
                                         {"engine/scene/lanes.inc", "#include <zstd.h>\n"}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].starts_with("engine/scene/lanes.inc:1: ")) << found[0];
}

TEST(HouseRules, ReportAPartThatNobodyIncludes) {
  const auto found = violations(sample, {{"engine/scene/sum.cc", "// engine/scene/sum.inc\n"},
                                         {"engine/scene/sum.inc", ""},
                                         {"engine/scene/notes.md", "#include <zstd.h>\n"}});
  EXPECT_EQ(found, std::vector<std::string>{"engine/scene/sum.inc: nobody includes it"}) << "and no other file matters";
}

TEST(HouseRules, KeepTorchOutOfPartsToo) {
  const Arrows arrows{{"engine/diffusion", {}}};
  EXPECT_EQ(violations(arrows, "engine/diffusion/unet.inc", "#include <torch/torch.h>\n").size(), 1u);
}

TEST(HouseRules, KnowTheRoomsBelowTheServer) {
  const Arrows arrows = parse_arrows(
      "server/http: engine_core\nserver/service: server_http engine_core\nserver: server_service\nengine/core: \n");
  EXPECT_EQ(violations(arrows, "server/service/routes/info.cc", "#include \"server/http/router.h\"\n").size(), 0u);
  EXPECT_EQ(violations(arrows, "server/http/router.cc", "#include \"server/service/routes/info.h\"\n").size(), 1u);
  EXPECT_EQ(violations(arrows, "server/main.cc", "#include \"server/service/serve.h\"\n").size(), 0u);
  EXPECT_EQ(violations(arrows, "server/main.cc", "#include \"server/http/router.h\"\n").size(), 1u);
}

TEST(HouseRules, KnowARoomWithinARoom) {
  const Arrows arrows = parse_arrows("server/scenes/disk: \nserver/scenes: server_scenes_disk\n");
  EXPECT_EQ(violations(arrows, "server/scenes/store.cc", "#include \"server/scenes/disk/disk.h\"\n").size(), 0u);
  EXPECT_EQ(violations(arrows, "server/scenes/disk/disk.cc", "#include \"server/scenes/store.h\"\n").size(), 1u);
}

TEST(HouseRules, SayWhere) {
  const auto found = violations(sample, "engine/scene/image.cc", "\n\n#include \"engine/io/ply.h\"\n");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].starts_with("engine/scene/image.cc:3: engine/scene includes engine/io")) << found[0];
}

TEST(HouseRules, SayWhatIsCalledAndNotIncluded) {
  const auto lacking = [](const std::string& source) { return lacks_includes("engine/core/sum.cc", source); };
  const auto call = [](const std::string& name) {
    return "auto a = std::" + name + "(b, c);\n";
  };  // no call of this file's
  EXPECT_EQ(lacking("#include <cmath>\n\n" + call("ranges::count_if") + call("max")),
            std::vector<std::string>{"engine/core/sum.cc:3: calls std::count_if and does not include <algorithm>"});
  EXPECT_EQ(lacking(call("min<double>")).size(), 1u);
  EXPECT_TRUE(lacking("#include <algorithm>\n" + call("max")).empty());
  EXPECT_TRUE(lacking(call("max") + "#include <algorithm>\n").empty()) << "wherever it is included";
  EXPECT_TRUE(lacking("// " + call("max") + call("maximal") + call("vector")).empty());
}

TEST(HouseRules, FindACircle) {
  EXPECT_TRUE(find_circle(sample).empty());
  EXPECT_EQ(find_circle({{"a", {"b"}}, {"b", {"c"}}, {"c", {"b"}}}), (std::vector<std::string>{"b", "c", "b"}));
}

}  // namespace
}  // namespace house
