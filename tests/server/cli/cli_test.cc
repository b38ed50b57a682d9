// The program as its users run it: end to end, on a small demo scene.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

namespace fs = std::filesystem;
namespace io = engine::io;
using nlohmann::json;

struct Finished {
  int status = 0;
  std::string out, err;
};

class Cli : public ::testing::Test {
 protected:
  void SetUp() override {
    const Finished made =
        splatdrag("demo-scene --out " + at("demo") + " --gaussians 5000 --views 6 --size 160x120 --render");
    ASSERT_EQ(made.status, 0) << made.err;
  }

  /// Runs the program in a shell, with `environment` ("NAME=value") before it.
  Finished splatdrag(const std::string& arguments, const std::string& environment = "") {
    const std::string command =
        environment + " " + SPLATDRAG_PROGRAM + " " + arguments + " >" + at("stdout") + " 2>" + at("stderr");
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, support::read_file(at("stdout")),
            support::read_file(at("stderr"))};
  }

  [[nodiscard]] std::string at(const std::string& name) const { return (folder_.path() / name).string(); }
  [[nodiscard]] std::string demo(const std::string& name) const { return at("demo/" + name); }

  std::string request(const json& document) {
    support::write_file(at("request.json"), document.dump());
    return at("request.json");
  }

  /// A drag of the demo scene that deforms only, which is quick: "ball" or "leaf".
  std::string quick(const std::string& drag) {
    json document = json::parse(support::read_file(demo("drags/" + drag + ".json")));
    document["preset"] = "preview";
    return request(document);
  }

  [[nodiscard]] json report(const std::string& out) const {
    return json::parse(support::read_file(at(out + "/report.json")));
  }

  std::size_t files_in(const std::string& name) const {
    return std::size_t(std::distance(fs::directory_iterator(at(name)), fs::directory_iterator()));
  }

 private:
  support::TempDir folder_;
};

TEST_F(Cli, DemoSceneIsADatasetThatOurReadersRead) {
  const auto scene = io::read_scene(demo("scene.ply"));
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_NEAR(double(scene->cloud.size()), 5000, 100);
  const auto dataset = io::read_dataset(at("demo"));
  ASSERT_TRUE(dataset) << dataset.error().message;
  ASSERT_EQ(dataset->views.size(), 6u);
  EXPECT_EQ(dataset->kind, "colmap");
  EXPECT_EQ(dataset->views[0].camera.name, "view_00.png");
  EXPECT_EQ(dataset->views[0].camera.width, 160);
  EXPECT_FALSE(dataset->views[0].photo.empty());
  EXPECT_EQ(dataset->points.size(), scene->cloud.size());
  EXPECT_TRUE(fs::exists(demo("drags/ball.json")));
}

TEST_F(Cli, DemoSceneIsTheSameEveryTime) {
  ASSERT_EQ(
      splatdrag("demo-scene --out " + at("again") + " --gaussians 5000 --views 6 --size 160x120 --threads 1").status,
      0);
  for (const char* name : {"scene.ply", "sparse/0/cameras.txt", "sparse/0/images.txt", "sparse/0/points3D.txt",
                           "drags/ball.json", "drags/leaf.json"})
    EXPECT_EQ(support::read_file(at("again/" + std::string(name))), support::read_file(demo(name))) << name;
}

TEST_F(Cli, FitMakesASceneFromPhotos) {
  const Finished run = splatdrag("fit --dataset " + at("demo") + " --out " + at("fit") +
                                 " --iterations 150 --max-gaussians 6000 --hold-out 6");
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("100 %  iteration 150 of 150, "), std::string::npos) << run.err;
  const auto scene = io::read_scene(at("fit/scene.ply"));
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.sh_degree, 3);
  const json said = report("fit");
  EXPECT_EQ(said["gaussians"], scene->cloud.size());
  EXPECT_LE(said["gaussians"], 6000);
  EXPECT_EQ(said["views"], 5);
  EXPECT_GT(said["training"]["psnr_db"], said["curve"][0]["psnr_db"].get<double>() + 5) << said;
  EXPECT_GT(said["held_out"]["psnr_db"], said["curve"][0]["psnr_db"].get<double>()) << said;
  EXPECT_EQ(said["curve"].back()["iteration"], 150);
  EXPECT_EQ(files_in("fit"), 2u) << "and nothing else";
  const Finished compared =
      splatdrag("render --all --compare --scene " + at("fit/scene.ply") + " --dataset " + at("demo"));
  EXPECT_EQ(compared.status, 0) << compared.err;
}

TEST_F(Cli, FitGoesOnAfterAKillToTheSameBytes) {
  const std::string fit = "fit --dataset " + at("demo") + " --iterations 120 --max-gaussians 6000 ";
  ASSERT_EQ(splatdrag(fit + "--out " + at("undisturbed")).status, 0);
  const std::string killed = std::string(SPLATDRAG_PROGRAM) + " " + fit + "--checkpoint-every 0 --out " + at("killed") +
                             " >/dev/null 2>&1 & pid=$!; while kill -0 $pid && ! [ -e " + at("killed/fit.checkpoint") +
                             " ]; do sleep 0.01; done; kill -9 $pid; wait $pid";
  ASSERT_NE(std::system(("bash -c '" + killed + "'").c_str()), 0);
  ASSERT_FALSE(fs::exists(at("killed/scene.ply"))) << "it was too late to kill it";

  const Finished other = splatdrag(fit + "--seed 1 --out " + at("killed"));
  EXPECT_EQ(other.status, 9);
  EXPECT_NE(other.err.find("--restart"), std::string::npos) << other.err;
  const Finished again = splatdrag(fit + "--out " + at("killed"));
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_NE(again.err.find("going on after iteration "), std::string::npos) << again.err;
  EXPECT_EQ(support::read_file(at("killed/scene.ply")), support::read_file(at("undisturbed/scene.ply")));
  EXPECT_FALSE(fs::exists(at("killed/fit.checkpoint")));
}

TEST_F(Cli, FitSaysWhatIsMissing) {
  const std::string out = " --iterations 1 --out " + at("fit");
  fs::remove(at("demo/images/view_03.png"));
  const Finished one = splatdrag("fit --dataset " + at("demo") + out);
  EXPECT_EQ(one.status, 3);
  EXPECT_NE(one.err.find("view_03.png"), std::string::npos) << one.err;
  fs::remove_all(at("demo/images"));
  const Finished all = splatdrag("fit --dataset " + at("demo") + out);
  EXPECT_EQ(all.status, 3);
  EXPECT_NE(all.err.find("has no photos"), std::string::npos) << all.err;
}

TEST_F(Cli, FitSaysThatNoCameraSeesThePoints) {
  const std::string file = at("demo/sparse/0/points3D.txt");
  support::write_file(file, "1 0 0 -900 10 20 30 0.5\n2 1 0 -900 10 20 30 0.5\n3 0 1 -900 10 20 30 0.5\n");
  const std::string fit = "fit --dataset " + at("demo") + " --iterations 1 --out " + at("fit");
  const Finished lost = splatdrag(fit);
  EXPECT_EQ(lost.status, 6);
  EXPECT_NE(lost.err.find("no camera sees any of the 3 Gaussians"), std::string::npos) << lost.err;
  support::write_file(file, "1 0 0 0 10 20 30 0.5\n2 1e300 0 0 10 20 30 0.5\n");
  const Finished beyond = splatdrag(fit);
  EXPECT_EQ(beyond.status, 4);
  EXPECT_NE(beyond.err.find("points3D[1].x"), std::string::npos) << beyond.err;
}

TEST_F(Cli, FitDoesNotEndBecauseACheckpointCannotBeWritten) {
  fs::create_directories(at("fit/fit.checkpoint/in the way"));
  const Finished run =
      splatdrag("fit --restart --checkpoint-every 0 --iterations 20 --dataset " + at("demo") + " --out " + at("fit"));
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.err.find("warning: no checkpoint after iteration 1:"), run.err.rfind("warning: no checkpoint"))
      << run.err;
  EXPECT_TRUE(io::read_scene(at("fit/scene.ply")));
}

TEST_F(Cli, FitStartsFromRandomPointsWhereThereAreNone) {
  fs::remove(at("demo/sparse/0/points3D.txt"));
  const std::string fit = "fit --iterations 150 --max-gaussians 3000 --dataset " + at("demo") + " --out ";
  const Finished run = splatdrag(fit + at("fit"));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("no sparse points; starting from random ones"), std::string::npos) << run.err;
  const json said = report("fit");
  EXPECT_EQ(said["start_gaussians"], 3000);
  EXPECT_GT(said["training"]["psnr_db"], said["curve"][0]["psnr_db"].get<double>() + 5) << said;
  const Finished asked = splatdrag(fit + at("asked") + " --init random");
  ASSERT_EQ(asked.status, 0) << asked.err;
  EXPECT_EQ(asked.err.find("warning"), std::string::npos) << asked.err;
  EXPECT_EQ(support::read_file(at("asked/scene.ply")), support::read_file(at("fit/scene.ply")));
}

TEST_F(Cli, FitIsToldOneStartOnly) {
  const std::string fit = "fit --iterations 3 --dataset " + at("demo") + " --out " + at("fit") + " --init ";
  for (const std::string& start : {std::string("scene"), "random --scene " + demo("scene.ply")}) {
    const Finished run = splatdrag(fit + start);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_NE(run.err.find("--init"), std::string::npos) << run.err;
  }
}

TEST_F(Cli, FitNeedsPointsOrASceneToStartFrom) {
  fs::remove(at("demo/sparse/0/points3D.txt"));
  const std::string fit = "fit --iterations 3 --out " + at("fit") + " --dataset " + at("demo");
  const Finished without = splatdrag(fit + " --init points");
  EXPECT_EQ(without.status, 6);
  EXPECT_NE(without.err.find("--scene"), std::string::npos) << without.err;
  const Finished with = splatdrag(fit + " --scene " + demo("scene.ply"));
  ASSERT_EQ(with.status, 0) << with.err;
  EXPECT_EQ(report("fit")["start_gaussians"], io::read_scene(demo("scene.ply"))->cloud.size());
  EXPECT_EQ(splatdrag("fit --dataset " + at("demo") + " --scene " + demo("scene.ply") + " --out " + at("demo")).status,
            9)
      << "scene.ply would replace its own input";
  EXPECT_EQ(splatdrag("fit --dataset " + at("demo") + " --out " + at("demo")).status, 9)
      << "files of the dataset would be replaced";
}

TEST_F(Cli, BenchEditJudgesEditsWhoseRightResultIsKnown) {
  const std::string bench = "bench-edit --case slide --out " + at("bench");
  const Finished run = splatdrag(bench);
  ASSERT_EQ(run.status, 0) << run.err;
  const json said = json::parse(support::read_file(at("bench/bench.json")));
  ASSERT_EQ(said["cases"].size(), 1u);
  const json& found = said["cases"][0];
  // The crate arrives as it was, and where it stood there is a table, better than a smooth filling (32 dB).
  EXPECT_GT(found["result"]["arrived"]["psnr_db"], 45) << found;
  EXPECT_GT(found["result"]["outside"]["psnr_db"], 36) << found;
  EXPECT_GT(found["result"]["edited"]["psnr_db"], 33) << found;
  EXPECT_GT(found["result"]["vacated"]["psnr_db"], 29.5) << found;
  EXPECT_GT(found["seeds"], 50) << found;
  EXPECT_LT(found["result"]["miss"], 0.01) << found;
  EXPECT_NE(run.out.find("| slide | "), std::string::npos) << run.out;
  EXPECT_TRUE(io::read_image(at("bench/slide_scene_view_04.png"))) << "a held-out view";

  // What is there is not worked out again; what is damaged is.
  std::string kept;
  for (const auto& entry : fs::directory_iterator(at("bench/results"))) kept = entry.path().string();
  std::string bytes = support::read_file(kept);
  const std::size_t at_seconds = bytes.find("\"seconds\": ") + 11;
  bytes.insert(at_seconds, "77");
  support::write_file(kept, bytes);
  ASSERT_EQ(splatdrag(bench).status, 0);
  EXPECT_GT(json::parse(support::read_file(at("bench/bench.json")))["cases"][0]["seconds"], 70);
  support::write_file(kept, bytes.substr(0, bytes.size() / 2));
  ASSERT_EQ(splatdrag(bench).status, 0);
  EXPECT_LT(json::parse(support::read_file(at("bench/bench.json")))["cases"][0]["seconds"], 70);
}

TEST_F(Cli, BenchEditDrawsThingsIntoPhotos) {
  const std::string bench = "bench-edit --captures --case can --photos " + at("demo") +
                            " --at 0.4,0.75 --to 0.6,0.75 --size 0.3 --fit-iterations 100 --preset preview "
                            "--corrector none --by masks --cache " +
                            at("trained") + " --out " + at("drawn");
  const Finished run = splatdrag(bench + " --view view_01.png");
  ASSERT_EQ(run.status, 0) << run.err;
  const json said = json::parse(support::read_file(at("drawn/captures.json")));
  EXPECT_EQ(said["photos"]["view"], "view_01.png");
  ASSERT_EQ(said["captures"].size(), 1u);
  const json& found = said["captures"][0];
  EXPECT_EQ(found["case"], "can_in_demo");
  EXPECT_GT(found["deformed"]["edited"]["psnr_db"], found["untouched"]["edited"]["psnr_db"]) << found;
  EXPECT_GT(found["ceiling"]["edited"]["psnr_db"], found["untouched"]["edited"]["psnr_db"]) << found;
  EXPECT_TRUE(io::read_image(at("drawn/can_in_demo_masks_none_view_00.png.png")));
  EXPECT_EQ(std::distance(fs::directory_iterator(at("trained")), fs::directory_iterator()), 3)
      << "the photos as they are, before and after";
  const Finished wrong = splatdrag(bench + " --view view_99.png");
  EXPECT_EQ(wrong.status, 3);
  EXPECT_NE(wrong.err.find("there is no photo \"view_99.png\"; the first is \"view_00.png\" (--view)"),
            std::string::npos)
      << wrong.err;
}

TEST_F(Cli, BenchEditJudgesEditsOfScenesThatItTrains) {
  const std::string bench =
      "bench-edit --captures --case mug --fit-iterations 60 --preset preview --corrector none "
      "--by balls --cache " +
      at("trained") + " --out " + at("bench") + " --page " + at("page.md");
  const Finished run = splatdrag(bench);
  ASSERT_EQ(run.status, 0) << run.err;
  const json said = json::parse(support::read_file(at("bench/captures.json")));
  EXPECT_EQ(said["fit_iterations"], 60);
  ASSERT_EQ(said["captures"].size(), 1u);
  const json& found = said["captures"][0];
  EXPECT_EQ(found["case"], "mug");
  EXPECT_GT(found["deformed"]["edited"]["psnr_db"], found["untouched"]["edited"]["psnr_db"]) << found;
  EXPECT_GT(found["ceiling"]["edited"]["psnr_db"], found["deformed"]["edited"]["psnr_db"]) << found;
  EXPECT_EQ(found["gain_db"], 0) << "a preview is the deformation alone";
  EXPECT_GT(found["recall"], 0.5);
  EXPECT_GT(found["precision"], 0.5);
  EXPECT_NE(support::read_file(at("page.md")).find("| mug | choose | balls | none |"), std::string::npos);
  EXPECT_TRUE(io::read_image(at("bench/mug_balls_none_within_0.png")));
  EXPECT_EQ(std::distance(fs::directory_iterator(at("trained")), fs::directory_iterator()), 2) << "before and after";

  // Both ways to say what moves, and other parameters, are tried on the scenes that are there.
  const double seconds = found["fit_seconds"];
  const Finished again = splatdrag(bench + " --by clicks --interpolation smooth");
  ASSERT_EQ(again.status, 0) << again.err;
  const json both = json::parse(support::read_file(at("bench/captures.json")))["captures"];
  ASSERT_EQ(both.size(), 2u);
  for (const json& each : both) EXPECT_EQ(each["fit_seconds"], seconds);
  EXPECT_EQ(both[0]["by"], "balls");
  EXPECT_EQ(both[1]["by"], "clicks");
  EXPECT_TRUE(io::read_image(at("bench/mug_clicks_none_within_0.png")));
}

TEST_F(Cli, EditWritesSceneReportAndPictures) {
  const Finished run = splatdrag("edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --request " +
                                 quick("ball") + " --out " + at("out/deep"));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("100 %"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find(" of 4  mask"), std::string::npos) << run.err;
  const json said = report("out/deep");
  const auto before = io::read_scene(demo("scene.ply")), after = io::read_scene(at("out/deep/scene.ply"));
  ASSERT_TRUE(after) << after.error().message;
  EXPECT_EQ(said["gaussians"]["input"], before->cloud.size());
  EXPECT_EQ(said["gaussians"]["output"], after->cloud.size());
  EXPECT_GT(said["handles"][0]["gaussians"], 10);
  EXPECT_EQ(said["gaussians"]["copies"], said["handles"][0]["gaussians"]);
  EXPECT_EQ(said["request"]["handles"], json::parse(support::read_file(demo("drags/ball.json")))["handles"]);
  EXPECT_GE(said["request"]["params"]["intervals"], 1);
  EXPECT_EQ(said["request"]["preset"], "preview");
  EXPECT_EQ(said["request"]["params"]["corrector"], "none");
  EXPECT_TRUE(said["simd"].is_string());
  EXPECT_TRUE(said["warnings"].empty()) << said["warnings"];
  ASSERT_EQ(said["pictures"].size(), 3u);
  for (const json& pictures : said["pictures"])
    for (const char* which : {"before", "after", "mask"}) {
      const auto picture = io::read_image(at("out/deep/" + pictures[which].get<std::string>()));
      ASSERT_TRUE(picture) << picture.error().message;
      EXPECT_EQ(picture->width, 160);
    }
  EXPECT_EQ(files_in("out/deep"), 2u + 9u) << "and nothing else";
}

TEST_F(Cli, EditWritesTheFormatThatTheNameOfItsOutputSays) {
  const std::string edit = "edit --pictures 0 --scene " + demo("scene.ply") + " --request " + quick("ball") + " --out ";
  ASSERT_EQ(splatdrag(edit + at("folder")).status, 0);
  const auto edited = io::read_scene(at("folder/scene.ply"));
  ASSERT_TRUE(edited) << edited.error().message;
  for (const auto& [name, format] : {std::pair{"files/ball.ply", io::SceneFormat::ply},
                                     {"files/ball.compressed.ply", io::SceneFormat::compressed_ply},
                                     {"files/ball.spz", io::SceneFormat::spz},
                                     {"files/ball.sog", io::SceneFormat::sog},
                                     {"files/ball.glb", io::SceneFormat::glb},
                                     {"files/ball.SPLAT", io::SceneFormat::splat}}) {
    SCOPED_TRACE(name);
    const Finished run = splatdrag(edit + at(name));
    ASSERT_EQ(run.status, 0) << run.err;
    EXPECT_NE(run.out.find(name), std::string::npos) << run.out;
    const auto found = io::detect_format(at(name));
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_EQ(*found, format);
    const auto scene = io::read_scene(at(name));
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_EQ(scene->cloud.size(), edited->cloud.size());
    const bool rounds =
        format == io::SceneFormat::compressed_ply || format == io::SceneFormat::spz || format == io::SceneFormat::sog;
    EXPECT_EQ(run.err.find(" rounds positions") != std::string::npos, rounds) << run.err;
  }
  EXPECT_EQ(support::read_file(at("files/ball.ply")), support::read_file(at("folder/scene.ply")));
  EXPECT_EQ(report("files")["gaussians"]["output"], edited->cloud.size()) << "the report lies beside the scene";
  fs::create_directories(at("named.spz"));
  ASSERT_EQ(splatdrag(edit + at("named.spz")).status, 0);
  EXPECT_TRUE(fs::exists(at("named.spz/scene.ply"))) << "a folder stays one, however it is called";
}

TEST_F(Cli, EditComesBackInTheFormatItCameInAndNeverOverItself) {
  ASSERT_EQ(splatdrag("convert --in " + demo("scene.ply") + " --out " + at("in.spz")).status, 0);
  const std::string before = support::read_file(at("in.spz"));
  const std::string edit = "edit --pictures 0 --scene " + at("in.spz") + " --request " + quick("ball") + " --out ";
  EXPECT_EQ(splatdrag(edit + at("in.spz")).status, 9);
  EXPECT_EQ(support::read_file(at("in.spz")), before);
  const Finished run = splatdrag(edit + at("edited.spz"));
  ASSERT_EQ(run.status, 0) << run.err;
  const auto was = io::read_scene(at("in.spz")), is = io::read_scene(at("edited.spz"));
  ASSERT_TRUE(was && is);
  EXPECT_EQ(is->cloud.size(), report(".")["gaussians"]["output"]);
  EXPECT_EQ(is->cloud.sh_degree, was->cloud.sh_degree);
}

TEST_F(Cli, EditWithoutAPresetOptimisesAndCorrects) {
  json document = json::parse(support::read_file(demo("drags/ball.json")));
  ASSERT_FALSE(document.contains("preset"));
  document["params"] = {{"iterations", 20}, {"max_image_side", 96}};
  const Finished run = splatdrag("edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --request " +
                                 request(document) + " --out " + at("out"));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("correct"), std::string::npos) << run.err;
  const json said = report("out");
  EXPECT_EQ(said["request"]["preset"], "standard");
  EXPECT_EQ(said["request"]["params"]["corrector"], "scene");
  EXPECT_EQ(said["request"]["params"]["iterations"], 20);
  for (const char* filled_in : {"annealing_steps", "strength_initial", "strength_final", "annealing"})
    EXPECT_TRUE(said["request"]["params"].contains(filled_in)) << filled_in;
  EXPECT_TRUE(said["warnings"].empty()) << said["warnings"];
  ASSERT_EQ(splatdrag("edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --pictures 0 --request " +
                      request(said["request"]) + " --out " + at("again"))
                .status,
            0);
  EXPECT_TRUE(support::read_file(at("again/scene.ply")) == support::read_file(at("out/scene.ply")))
      << "the report's request is the whole request";
}

TEST_F(Cli, EditKeepsTheBytesOfRowsItDoesNotTouch) {
  ASSERT_EQ(splatdrag("edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --request " + quick("ball") +
                      " --out " + at("out") + " --pictures 0")
                .status,
            0);
  const json said = report("out");
  const std::size_t survivors =
      said["gaussians"]["input"].get<std::size_t>() - said["gaussians"]["removed"].get<std::size_t>();
  const auto rows = [](const std::string& file, std::size_t count) {
    const std::string bytes = support::read_file(file);
    const std::size_t begin = bytes.find("end_header\n") + 11, stride = (bytes.size() - begin) / count;
    std::vector<std::string> list;
    for (std::size_t i = 0; i < count; ++i) list.push_back(bytes.substr(begin + i * stride, stride));
    return list;
  };
  const auto before = rows(demo("scene.ply"), said["gaussians"]["input"]),
             after = rows(at("out/scene.ply"), said["gaussians"]["output"]);
  std::size_t next = 0;  // survivors are a subsequence of the input
  for (std::size_t i = 0; i < survivors; ++i) {
    while (next < before.size() && before[next] != after[i]) ++next;
    ASSERT_LT(next, before.size()) << "row " << i << " of the output is none of the input's";
    ++next;
  }
}

TEST_F(Cli, ADragOfNothingGivesTheSameBytes) {
  const Finished run = splatdrag(
      "edit --scene " + demo("scene.ply") + " --out " + at("out") + " --request " +
      request(
          {{"handles", {{{"source", {-0.28, -0.21, -0.62}}, {"target", {-0.28, -0.21, -0.62}}, {"radius", 0.25}}}}}));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_TRUE(support::read_file(at("out/scene.ply")) == support::read_file(demo("scene.ply")));
  EXPECT_NE(run.err.find("warning: nothing moves"), std::string::npos) << run.err;
}

TEST_F(Cli, EditGivesTheSameBytesForAnyNumberOfThreads) {
  for (const char* threads : {"1", "3"})
    ASSERT_EQ(splatdrag("edit --scene " + demo("scene.ply") + " --request " + quick("leaf") + " --out " +
                        at(std::string("out") + threads) + " --threads " + threads)
                  .status,
              0);
  EXPECT_TRUE(support::read_file(at("out1/scene.ply")) == support::read_file(at("out3/scene.ply")));
  EXPECT_EQ(report("out1")["threads"], 1);
  EXPECT_EQ(report("out3")["threads"], 3);
}

TEST_F(Cli, ACorrectedEditGivesTheSameBytesForAnyNumberOfThreads) {
  json document = json::parse(support::read_file(demo("drags/ball.json")));
  document["params"] = {{"corrector", "scene"}, {"intervals", 2}, {"annealing_steps", 2}, {"iterations", 10}};
  for (const char* threads : {"1", "3"})
    ASSERT_EQ(
        splatdrag("edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --request " + request(document) +
                  " --out " + at(std::string("out") + threads) + " --pictures 0 --threads " + threads)
            .status,
        0);
  EXPECT_TRUE(support::read_file(at("out1/scene.ply")) == support::read_file(at("out3/scene.ply")));
}

TEST_F(Cli, EditTakesReleasedConfigurationsAndNamedRequests) {
  const json released = {{"start", {{-0.28, -0.21, -0.62}}}, {"direction", {{0.3, 0.0, 0.0}}}, {"voxel_size", 0.22}};
  // Such a configuration has no word for a preset, so this optimises: through six small views, which is quick enough.
  const std::string edit = "edit --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --pictures 0 --out ";
  ASSERT_EQ(splatdrag(edit + at("released") + " --request " + request(released)).status, 0);
  ASSERT_EQ(splatdrag(edit + at("named") + " --name b --request " +
                      request({{"comment", "two"}, {"a", released}, {"b", released}}))
                .status,
            0);
  EXPECT_EQ(report("released")["request"]["preset"], "standard");
  EXPECT_TRUE(support::read_file(at("released/scene.ply")) == support::read_file(at("named/scene.ply")));
}

TEST_F(Cli, EditWarnsOfFieldsWithoutEffect) {
  json document = json::parse(support::read_file(demo("drags/ball.json")));
  document["preset"] = "preview";
  document["params"]["strength_initial"] = 0.5;
  const Finished run = splatdrag("edit --scene " + demo("scene.ply") + " --pictures 0 --out " + at("out") +
                                 " --request " + request(document));
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.err.find("warning: without effect on this edit: params.strength_initial"), std::string::npos)
      << run.err;
  EXPECT_NE(report("out")["warnings"].dump().find("params.strength_initial"), std::string::npos);
  EXPECT_EQ(report("out")["request"]["params"]["strength_initial"], 0.5);
}

TEST_F(Cli, EditNamesTheHandleThatHoldsNothing) {
  const Finished run = splatdrag("edit --scene " + demo("scene.ply") + " --out " + at("out") + " --request " +
                                 request({{"handles",
                                           {{{"source", {-0.28, -0.21, -0.62}}, {"radius", 0.25}},
                                            {{"source", {9, 9, 9}}, {"target", {9, 9, 8}}, {"radius", 0.25}}}}}));
  EXPECT_EQ(run.status, 6);
  EXPECT_NE(run.err.find("error: "), std::string::npos);
  EXPECT_NE(run.err.find("(request.json:handles[1]"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(at("out/scene.ply")));
}

TEST_F(Cli, EditNeverReplacesItsInput) {
  const std::string before = support::read_file(demo("scene.ply"));
  const Finished run =
      splatdrag("edit --scene " + demo("scene.ply") + " --out " + at("demo") + " --request " + quick("ball"));
  EXPECT_EQ(run.status, 9) << run.err;
  EXPECT_TRUE(support::read_file(demo("scene.ply")) == before);
}

TEST_F(Cli, RenderNeverReplacesAPhoto) {
  const std::string before = support::read_file(demo("images/view_03.png"));
  const Finished run = splatdrag("render --scene " + demo("scene.ply") + " --dataset " + at("demo") +
                                 " --view view_03.png --background 1,0,0 --compare --out " + demo("images"));
  EXPECT_EQ(run.status, 9) << run.err;
  EXPECT_TRUE(support::read_file(demo("images/view_03.png")) == before);
}

TEST_F(Cli, ConvertNeverReplacesItsInput) {
  ASSERT_EQ(splatdrag("convert --in " + demo("scene.ply") + " --out " + at("a.spz")).status, 0);
  const std::string before = support::read_file(at("a.spz"));
  fs::create_symlink(at("a.spz"), at("b.spz"));
  for (const char* out : {"a.spz", "b.spz"}) {
    const Finished run = splatdrag("convert --in " + at("a.spz") + " --out " + at(out));
    EXPECT_EQ(run.status, 9) << run.err;
  }
  EXPECT_TRUE(support::read_file(at("a.spz")) == before);
}

TEST_F(Cli, RenderNamesPicturesAfterTheirViews) {
  ASSERT_EQ(splatdrag("render --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --all --out " + at("all"))
                .status,
            0);
  EXPECT_EQ(files_in("all"), 6u);
  EXPECT_TRUE(support::read_file(at("all/view_02.png")) == support::read_file(demo("images/view_02.png")));
  ASSERT_EQ(splatdrag("render --scene " + demo("scene.ply") + " --dataset " + at("demo") +
                      " --view view_02.png --view view_04.png --max-side 80 --format jpg --out " + at("two"))
                .status,
            0);
  EXPECT_EQ(files_in("two"), 2u);
  EXPECT_EQ(io::read_image(at("two/view_04.jpg"))->width, 80);
}

TEST_F(Cli, RenderComparesWithPhotos) {
  const Finished run =
      splatdrag("render --scene " + demo("scene.ply") + " --dataset " + at("demo") + " --all --compare");
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(std::count(run.out.begin(), run.out.end(), '\n'), 7) << run.out;
  // The photos are these renderings, rounded to 8 bits: an error of at most half a step, about 59 dB if uniform.
  const std::size_t mean = run.out.find("mean  ");
  ASSERT_NE(mean, std::string::npos) << run.out;
  EXPECT_GT(std::stod(run.out.substr(mean + 6)), 54.1) << run.out;
}

TEST_F(Cli, RenderRefusesPicturesInFormatsThatItDoesNotWrite) {
  const std::string camera =
      "render --scene " + demo("scene.ply") + " --eye 0,-1,-4.5 --target 0,-0.5,0 --size 96x64 --out ";
  for (const char* name : {"q.GIF", "q.mp4", "q.jp2", "q.pfm"}) {
    const Finished run = splatdrag(camera + at(name));
    EXPECT_NE(run.status, 0) << name;
    EXPECT_NE(run.err.find(".png, .jpg or .exr"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("--out"), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(at(name)));
  }
  fs::create_directory(at("there.old"));
  for (const char* name : {"v1.2", "there.old", "new.old/"}) {
    EXPECT_EQ(splatdrag(camera + at(name)).status, 0) << name;
    EXPECT_TRUE(fs::exists(at(name) + "/render.png")) << name;
  }
}

TEST_F(Cli, RenderWritesDepthAndAlpha) {
  const std::string camera =
      "render --scene " + demo("scene.ply") + " --eye 0,-1,-4.5 --target 0,-0.5,0 --size 96x64 --out ";
  ASSERT_EQ(splatdrag(camera + at("c.exr")).status, 0);
  ASSERT_EQ(splatdrag(camera + at("d.png") + " --what depth").status, 0);
  ASSERT_EQ(splatdrag(camera + at("a.png") + " --what alpha --background 1,1,1").status, 0);
  const auto exr = io::read_image(at("c.exr"), {.alpha = io::Alpha::keep}), shades = io::read_image(at("d.png")),
             alpha = io::read_image(at("a.png"));
  ASSERT_TRUE(exr) << exr.error().message;
  EXPECT_EQ(exr->width, 96);
  EXPECT_EQ(exr->channels, 4);
  ASSERT_TRUE(shades);
  ASSERT_TRUE(alpha);
  EXPECT_NEAR(alpha->at(48, 32), exr->at(48, 32, 3), 1.0 / 255);
  EXPECT_GT(alpha->at(48, 32), 0.9f);
  EXPECT_GT(shades->at(48, 42), shades->at(48, 5)) << "the table is nearer than the wall";
}

TEST_F(Cli, InfoSaysWhatThereIs) {
  const Finished run = splatdrag("info --json --scene " + demo("scene.ply") + " --dataset " + at("demo"));
  ASSERT_EQ(run.status, 0) << run.err;
  const json info = json::parse(run.out);
  EXPECT_EQ(info["scene"]["format"], "ply");
  EXPECT_EQ(info["scene"]["sh_degree"], 1);
  EXPECT_EQ(info["scene"]["extra_properties"], (json{"nx", "ny", "nz"}));
  EXPECT_EQ(info["scene"]["opacity"].size(), info["scene"]["quantiles"].size());
  EXPECT_LE(info["scene"]["opacity"][0], info["scene"]["opacity"][6]);
  EXPECT_EQ(info["dataset"]["views"].size(), 6u);
  ASSERT_EQ(splatdrag("convert --in " + demo("scene.ply") + " --out " + at("bare.spz")).status, 0);
  const json bare = json::parse(splatdrag("info --json --scene " + at("bare.spz")).out);
  EXPECT_EQ(bare["scene"]["extra_properties"], json::array()) << "it has no room for any";
  const Finished text = splatdrag("info --scene " + demo("scene.ply"));
  EXPECT_NE(text.out.find("SH degree    1"), std::string::npos) << text.out;
}

TEST_F(Cli, ConvertSaysWhatIsLost) {
  const Finished same = splatdrag("convert --in " + demo("scene.ply") + " --out " + at("same.ply"));
  ASSERT_EQ(same.status, 0) << same.err;
  EXPECT_EQ(same.err, "");
  EXPECT_TRUE(support::read_file(at("same.ply")) == support::read_file(demo("scene.ply")));
  const Finished splat = splatdrag("convert --in " + demo("scene.ply") + " --out " + at("a.splat"));
  ASSERT_EQ(splat.status, 0) << splat.err;
  EXPECT_NE(splat.err.find("warning: .splat holds no view-dependent colour"), std::string::npos) << splat.err;
  ASSERT_EQ(splatdrag("convert --in " + at("a.splat") + " --out " + at("a.spz")).status, 0);
  EXPECT_EQ(json::parse(splatdrag("info --json --scene " + at("a.splat")).out)["scene"]["format"], "splat");
  EXPECT_EQ(json::parse(splatdrag("info --json --scene " + at("a.spz")).out)["scene"]["format"], "spz");
}

TEST_F(Cli, ConvertSaysInNumbersWhatItRounds) {
  for (const char* name : {"n.spz", "n.sog", "n.compressed.ply"}) {
    const Finished run = splatdrag("convert --in " + demo("scene.ply") + " --out " + at(name));
    ASSERT_EQ(run.status, 0) << run.err;
    const std::size_t line = run.err.find(" rounds rotations: ");
    ASSERT_NE(line, std::string::npos) << run.err;
    const double degrees = std::stod(run.err.substr(line + 19));
    EXPECT_GT(degrees, 0.001) << name;
    EXPECT_LT(degrees, 2.5) << name;
    EXPECT_NE(run.err.find(" at most, ", line), std::string::npos);
    EXPECT_NE(run.err.find("rounds positions: "), std::string::npos) << run.err;
  }
  const Finished glb = splatdrag("convert --in " + demo("scene.ply") + " --out " + at("n.glb"));
  ASSERT_EQ(glb.status, 0) << glb.err;
  EXPECT_EQ(glb.err.find("rounds positions"), std::string::npos) << glb.err;
}

TEST_F(Cli, InfoNamesAxesAndCompression) {
  const auto scene = [&](const std::string& file) {
    return json::parse(splatdrag("info --json --scene " + file).out)["scene"];
  };
  EXPECT_EQ(scene(demo("scene.ply"))["axes"]["stored"], "RDF");
  EXPECT_EQ(scene(demo("scene.ply"))["compression"], "none");
  for (const auto& [name, axes, declared, compression] : {std::tuple("i.spz", "RUB", true, "zstd"),
                                                          {"i.sog", "RDF", false, "WebP, palettes"},
                                                          {"i.glb", "LUF", false, "none"}}) {
    ASSERT_EQ(splatdrag("convert --in " + demo("scene.ply") + " --out " + at(name)).status, 0);
    EXPECT_EQ(scene(at(name))["axes"]["stored"], axes) << name;
    EXPECT_EQ(scene(at(name))["axes"]["declared"], declared) << name;
    EXPECT_EQ(scene(at(name))["compression"], compression) << name;
  }
  const Finished text = splatdrag("info --scene " + at("i.spz"));
  EXPECT_NE(text.out.find("axes         RUB, as the file declares; read as RDF"), std::string::npos) << text.out;
}

TEST_F(Cli, SettingsComeFromFlagThenEnvironmentThenFile) {
  support::write_file(at("settings.toml"),
                      "[render]\nview = ['view_01.png']\nmax-side = 40\ndataset = '" + at("demo") + "'\n");
  const auto width = [&](const std::string& more, const std::string& environment) {
    const Finished run = splatdrag("render --config " + at("settings.toml") + " --scene " + demo("scene.ply") +
                                       " --out " + at("p.png") + " " + more,
                                   environment);
    EXPECT_EQ(run.status, 0) << run.err;
    return io::read_image(at("p.png"))->width;
  };
  EXPECT_EQ(width("", ""), 40);
  EXPECT_EQ(width("", "SPLATDRAG_MAX_SIDE=50"), 50);
  EXPECT_EQ(width("--max-side 60", "SPLATDRAG_MAX_SIDE=50"), 60);
  const Finished run = splatdrag("render --scene " + demo("scene.ply") + " --out " + at("q.png"),
                                 "SPLATDRAG_CONFIG=" + at("settings.toml"));
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(io::read_image(at("q.png"))->width, 40);
  const Finished lost = splatdrag("info --scene " + demo("scene.ply"), "SPLATDRAG_CONFIG=" + at("none.toml"));
  EXPECT_EQ(lost.status, 2) << "a settings file that was asked for and is not there";
}

TEST_F(Cli, AnOutputFolderThatCannotBeIsAnError) {
  support::write_file(at("file"), "");
  const Finished run =
      splatdrag("edit --scene " + demo("scene.ply") + " --request " + quick("ball") + " --out " + at("file/out"));
  EXPECT_EQ(run.status, 2) << run.err;
  EXPECT_NE(run.err.find("file"), std::string::npos);
}

}  // namespace
}  // namespace server::cli
