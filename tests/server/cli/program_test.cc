#include "server/cli/program.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "engine/params/params.h"
#include "server/models/models.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

struct Finished {
  int status = 0;
  std::string out, err;
};

Finished splatdrag(std::vector<std::string> arguments) {
  std::ostringstream out, err;
  Terminal terminal{out, err};
  arguments.insert(arguments.begin(), "splatdrag");
  std::vector<const char*> argv;
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  const int status = run_program(int(argv.size()), argv.data(), terminal);
  return {status, out.str(), err.str()};
}

void expect_error(const std::vector<std::string>& arguments, int status, const std::string& part) {
  const Finished run = splatdrag(arguments);
  EXPECT_EQ(run.status, status) << run.err;
  EXPECT_TRUE(run.err.starts_with("error: ")) << run.err;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_NE(run.err.find(part), std::string::npos) << run.err;
}

TEST(Program, ListsExactlyTheSubcommandsThereAre) {
  const Finished run = splatdrag({"--help"});
  EXPECT_EQ(run.status, 0);
  std::size_t listed = 0;
  for (const char* name :
       {"serve", "edit", "select", "fit", "render", "info", "models", "convert", "demo-scene", "admin", "bench-edit"}) {
    EXPECT_NE(run.out.find("\n  " + std::string(name) + " "), std::string::npos) << name;
    ++listed;
  }
  const std::string commands = run.out.substr(run.out.find("Subcommands:\n"));
  const auto lines = commands.substr(0, commands.find("\n\n"));
  EXPECT_EQ(std::size_t(std::count(lines.begin(), lines.end(), '\n')), listed) << lines;
  EXPECT_NE(run.out.find("Exit status"), std::string::npos);
}

TEST(Program, HelpShowsDefaultsUnitsAndVariables) {
  const Finished run = splatdrag({"render", "--help"});
  EXPECT_EQ(run.status, 0);
  for (const char* part : {"=800x600", "degrees", "=50", "SPLATDRAG_MAX_SIDE", "=color"})
    EXPECT_NE(run.out.find(part), std::string::npos) << part << "\n" << run.out;
}

TEST(Program, HelpListsTheParametersOfARequest) {
  const Finished edit = splatdrag({"edit", "--help"}), bench = splatdrag({"bench-edit", "--help"});
  engine::params::for_each_parameter([&](const auto& parameter) {
    EXPECT_EQ(edit.out.find("\n  " + std::string(parameter.name) + ": ") != std::string::npos, parameter.on_wire)
        << parameter.name;
    std::string option = "\n  --" + std::string(parameter.name);
    std::ranges::replace(option, '_', '-');
    EXPECT_EQ(bench.out.find(option) != std::string::npos, parameter.on_wire) << parameter.name;
  });
}

TEST(Program, SaysItsVersion) {
  const Finished run = splatdrag({"--version"});
  EXPECT_EQ(run.status, 0);
  EXPECT_NE(run.out.find('.'), std::string::npos);
}

TEST(Program, RefusesAWrongCommandLineInOneLine) {
  expect_error(
      {}, 2, "a subcommand is required: serve edit select fit render info models convert demo-scene admin bench-edit");
  expect_error({"bake"}, 2, "\"bake\" is no subcommand");
  expect_error({"serve"}, 2, "--data-dir is required");
  expect_error({"edit"}, 2, "--scene is required");
  expect_error({"select", "a.ply"}, 2, "--selection is required");
  expect_error({"info", "--scene", "a.ply", "--frob"}, 2, "--frob");
  expect_error({"edit", "--threads", "-1"}, 2, "--threads");
  expect_error({"--config", "/nonexistent.toml", "info", "--scene", "a.ply"}, 2, "/nonexistent.toml");
}

TEST(Program, RefusesContradictingRenderOptions) {
  const std::vector<std::string> base = {"render", "--scene", "a.ply"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), base.begin(), base.end());
    return more;
  };
  expect_error(base, 2, "--out");
  expect_error(with({"--out", "o"}), 2, "--view");
  expect_error(with({"--out", "o", "--all"}), 2, "--dataset");
  expect_error(with({"--out", "o", "--all", "--view", "v", "--dataset", "d"}), 2, "choose one");
  expect_error(with({"--out", "o", "--eye", "0,0,0"}), 2, "--target");
  expect_error(with({"--out", "o", "--eye", "1,1,1", "--target", "1,1,1"}), 2, "--eye");
  expect_error(with({"--out", "o", "--eye", "0,0,0", "--target", "0,1,0", "--up", "0,0,0"}), 2, "--up");
  expect_error(with({"--out", "o", "--eye", "0,0,0", "--target", "0,0,1", "--size", "big"}), 2, "--size");
  expect_error(with({"--compare", "--eye", "0,0,0", "--target", "0,0,1"}), 2, "--compare");
}

TEST(Program, EachKindOfFailureHasItsStatus) {
  const support::TempDir folder;
  const auto file = [&](const std::string& name, const std::string& bytes) {
    support::write_file(folder.path() / name, bytes);
    return (folder.path() / name).string();
  };
  expect_error({"info", "--scene", "/nonexistent.ply"}, 3, "nonexistent.ply");
  expect_error({"info", "--scene", file("cut.ply", "ply\nformat binary_little_endian 1.0\n")}, 4, "cut.ply");
  expect_error({"info", "--scene", file("note.txt", "hello")}, 5, "note.txt");
  expect_error({"convert", "--in", "a.ply", "--out", "a.obj"}, 5, ".obj");
  expect_error({"edit", "--scene", "a.ply", "--out", "o", "--request", file("r.json", "{\"handles\": 3}")}, 2,
               "r.json:handles");
  expect_error({"edit", "--scene", "a.ply", "--out", "o", "--request",
                file("sd.json", R"({"handles": [{"source": [0, 0, 0], "radius": 1}], "params": {"corrector": "sd"}})")},
               5, "sd.json:params.corrector");
  expect_error({"demo-scene", "--out", folder.path().string(), "--gaussians", "7"}, 2, "gaussians");
}

TEST(Program, DamagedNetworksThatJudgeAreNamedBesideTheDiffusionModel) {
  if (models::Models().no_sd().find("libtorch-dev") != std::string::npos) GTEST_SKIP() << "this build has no libtorch";
  const support::TempDir folder;
  const auto refused = [&](const std::string& part) {
    expect_error({"bench-edit", "--out", (folder.path() / "out").string(), "--case", "slide", "--corrector", "sd",
                  "--model-dir", folder.path().string()},
                 5, part);
  };
  refused("Stable Diffusion");  // LPIPS may be missing
  std::filesystem::create_directories(folder.path() / "lpips");
  for (const char* name : {"vgg16.safetensors", "vgg_v0.1.safetensors"})
    support::write_file(folder.path() / "lpips" / name, "damaged");
  refused("lpips");
  std::filesystem::remove(folder.path() / "lpips" / "vgg16.safetensors");
  refused("VGG16 of torchvision");  // half of it is there: that is a mistake, too
}

TEST(Program, RefusesWrongOptionsOfCaptures) {
  const support::TempDir folder;
  const std::string out = (folder.path() / "out").string(), file = (folder.path() / "file").string();
  support::write_file(file, "not a folder");
  const auto refused = [&](std::vector<std::string> more, int status, const std::string& part) {
    const std::vector<std::string> base{"bench-edit", "--out", out};
    more.insert(more.begin(), base.begin(), base.end());
    expect_error(more, status, part);
  };
  refused({"--page", "page.md"}, 2, "--captures");
  refused({"--cache", out}, 2, "--captures");
  refused({"--fit-iterations", "9"}, 2, "--captures");
  refused({"--captures", "--small"}, 2, "--small");
  refused({"--captures", "--scene", "a.ply", "--dataset", "d", "--request", "r.json"}, 2, "--captures");
  refused({"--by", "clicks"}, 2, "--captures");
  refused({"--captures", "--by", "hands"}, 2, "--by");
  refused({"--captures", "--fit-iterations", "0"}, 2, "--fit-iterations");
  refused({"--captures", "--fit-iterations", "nan"}, 2, "--fit-iterations");
  refused({"--captures", "--cache", out, "--case", "slide"}, 3, "no captured case \"slide\"");
  refused({"--case", "mug"}, 3, "no case \"mug\"");
  refused({"--photos", "d", "--view", "a.jpg", "--at", "0.5,0.5", "--to", "0.6,0.5"}, 2, "--captures");
  refused({"--captures", "--photos", "d", "--at", "0.5,0.5", "--to", "0.6,0.5"}, 2, "--view");
  const std::vector<std::string> drawn{"--captures", "--cache", out,    "--photos", (folder.path() / "none").string(),
                                       "--view",     "a.jpg",   "--at", "0.5,0.5",  "--to",
                                       "0.6,0.5"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), drawn.begin(), drawn.end());
    return more;
  };
  refused(with({}), 2, "--case");
  refused(with({"--case", "can"}), 3, "none");
  refused(with({"--case", "can", "--take", "2"}), 2, "--take");
  refused(with({"--case", "can", "--page", "page.md"}), 2, "--page");
  refused({"--captures", "--photos", "d", "--view", "a.jpg", "--at", "0.5,1.5", "--to", "0.6,0.5"}, 2, "--at");
  refused(with({"--case", "can", "--size", "0"}), 2, "--size");
  refused({"--case", "slide", "--corrector", "sd"}, 2, "--model-dir");
  refused({"--captures", "--cache", file}, 2, "file");
  refused({"--captures", "--cache", file + "/below"}, 2, "file");
  refused({"--captures", "--cache", out, "--page", (folder.path() / "none" / "page.md").string()}, 3, "none");
}

}  // namespace
}  // namespace server::cli
