#include "proto/scene.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace proto {
namespace {

using nlohmann::json;

Scene sample() {
  Scene scene;
  scene.id = "s000001", scene.name = "chair", scene.created = "2026-11-21T11:09:38.123Z", scene.format = "ply";
  scene.gaussians = 62000, scene.sh_degree = 3;
  scene.low = {-1, -2, -3}, scene.high = {1, 2, 3}, scene.centre = {0.5, 0, 0};
  scene.radius = 1.5;
  scene.views = 50;
  scene.versions = {{0, std::nullopt, "", "", "t0", 62000, 0}, {1, 0, "e000001", "a name", "t1", 62100, 4096}};
  return scene;
}

TEST(SceneOnTheWire, HasTheFieldsOfTheContract) {
  const json out = json::parse(to_json(sample()));
  EXPECT_EQ(out, json::parse(R"({"id":"s000001","name":"chair","created":"2026-11-21T11:09:38.123Z","format":"ply",
    "gaussians":62000,"sh_degree":3,"bounds":{"low":[-1,-2,-3],"high":[1,2,3]},"centre":[0.5,0,0],"radius":1.5,
    "up":null,"disk_bytes":0,"memory_bytes":0,"views":50,"dataset":null,"versions":[
     {"version":0,"parent":null,"edit":null,"name":null,"created":"t0","gaussians":62000,"disk_bytes":0,"links":{
      "render":"/v1/scenes/s000001/versions/0/render","pick":"/v1/scenes/s000001/versions/0/pick",
      "file":"/v1/scenes/s000001/versions/0/file?format=ply"}},
     {"version":1,"parent":0,"edit":"e000001","name":"a name","created":"t1","gaussians":62100,"disk_bytes":4096,"links":{
      "render":"/v1/scenes/s000001/versions/1/render","pick":"/v1/scenes/s000001/versions/1/pick",
      "file":"/v1/scenes/s000001/versions/1/file?format=ply"}}],
    "links":{"self":"/v1/scenes/s000001","views":"/v1/scenes/s000001/views","dataset":"/v1/scenes/s000001/dataset"}})"));
}

TEST(SceneOnTheWire, TellsHowWellTheDatasetFits) {
  Scene scene = sample();
  scene.dataset = SceneDataset{"colmap", 50, 49, 35.25, 29.5, "0115.jpg", {"far off"}};
  EXPECT_EQ(json::parse(to_json(scene))["dataset"], json::parse(R"({"kind":"colmap","views":50,"photos":49,
    "psnr_mean_db":35.25,"psnr_worst_db":29.5,"psnr_worst_view":"0115.jpg","warnings":["far off"]})"));
  scene.dataset = SceneDataset{"colmap", 50, 0, std::nullopt, std::nullopt, "", {}};
  EXPECT_TRUE(json::parse(to_json(scene))["dataset"]["psnr_worst_view"].is_null());
}

TEST(SceneOnTheWire, ListsViewsAsCamerasThatCanBeSentBack) {
  const PinholeCamera camera{64, 48, 50, 51, 32, 24, {{{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}}}};
  const json out = json::parse(to_json({View{"a.png", camera, true}}, "dataset"));
  EXPECT_EQ(out["kind"], "dataset");
  EXPECT_EQ(out["views"][0], json::parse(R"({"name":"a.png","width":64,"height":48,"fx":50,"fy":51,"cx":32,"cy":24,
    "cam_from_world":[[1,0,0,1],[0,1,0,2],[0,0,1,3]],"photo":true})"));
}

std::string source_refused_at(const std::string& text) {
  const auto source = parse_scene_source(text);
  return source ? "accepted" : source.error().where;
}

TEST(SceneSource, IsAPathAndPerhapsAName) {
  EXPECT_EQ(parse_scene_source(R"({"path":"chair.ply","name":"chair"})").value(), (PathSource{"chair.ply", "chair"}));
  EXPECT_EQ(source_refused_at(R"({"path":"chair.ply"})"), "accepted");
  EXPECT_EQ(source_refused_at("{}"), "path");
  EXPECT_EQ(source_refused_at(R"({"path":""})"), "path");
  EXPECT_EQ(source_refused_at(R"({"path":1})"), "path");
  EXPECT_EQ(source_refused_at(R"({"path":"a","name":""})"), "name");
  EXPECT_EQ(source_refused_at(R"({"path":"a","name":")" + std::string(201, 'x') + "\"}"), "name");
  EXPECT_EQ(source_refused_at(R"({"path":"a","url":"b"})"), "url");
  EXPECT_EQ(parse_dataset_source(R"({"path":"a","name":"b"})").error().where, "name");
}

TEST(ScenePatch, TellsForgettingFromLeavingAlone) {
  EXPECT_EQ(parse_scene_patch("{}").value(), ScenePatch{});
  const auto forgets = parse_scene_patch(R"({"up":null})").value(),
             sets = parse_scene_patch(R"({"up":[0,0,1]})").value();
  ASSERT_TRUE(forgets.up && sets.up);
  EXPECT_FALSE(forgets.up->has_value());
  EXPECT_EQ(sets.up->value(), (Point{0, 0, 1}));
  EXPECT_EQ(parse_scene_patch(R"({"up":[0,0,0]})").error().where, "up");
  EXPECT_EQ(parse_scene_patch(R"({"up":[0,0]})").error().where, "up");
  EXPECT_EQ(parse_scene_patch(R"({"name":null})").error().where, "name");
  EXPECT_EQ(parse_scene_patch(R"({"id":"s2"})").error().where, "id");
}

}  // namespace
}  // namespace proto
