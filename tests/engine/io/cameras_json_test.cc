#include "engine/io/cameras_json.h"

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "engine/core/rng.h"

namespace engine::io {
namespace {

using nlohmann::json;

Result<std::vector<Shot>> parse(const std::string& text) {
  return parse_cameras_json(std::as_bytes(std::span(text.data(), text.size())), "cameras.json");
}

json sample() {
  json view = {{"id", 0}, {"img_name", "0001"}, {"width", 359}, {"height", 640}, {"fx", 466.76}, {"fy", 466.73}};
  view["position"] = {1.0, 2.0, 3.0};
  view["rotation"] = {
      {0.0, -1.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}};  // world_from_cam: the camera's x is the world's y
  json other = view;
  other["img_name"] = "0002";
  return json::array({view, other});
}

TEST(CamerasJson, PositionIsTheCentreAndRotationTurnsCameraAxesIntoWorldAxes) {
  const auto shots = parse(sample().dump());
  ASSERT_TRUE(shots) << shots.error().message;
  ASSERT_EQ(shots->size(), 2u);
  const Shot& shot = (*shots)[0];
  EXPECT_EQ(shot.name, "0001");
  EXPECT_EQ(shot.where, "cameras.json:[0]");
  EXPECT_LT(glm::length(shot.rotation * DVec3(1, 2, 3) + shot.translation), 1e-12);
  EXPECT_LT(glm::length(shot.rotation * DVec3(1, 7, 3) + shot.translation - DVec3(5, 0, 0)), 1e-12);
  EXPECT_EQ(shot.lens.fx, 466.76);
  EXPECT_EQ(shot.lens.fy, 466.73);
  EXPECT_EQ(shot.lens.cx, 179.5);
  EXPECT_EQ(shot.lens.cy, 320);
  EXPECT_TRUE(shot.lens.is_pinhole());
}

TEST(CamerasJson, NamesWhatIsMissingOrWrong) {
  const auto where = [](const std::function<void(json&)>& change) {
    json file = sample();
    change(file[1]);
    const auto parsed = parse(file.dump());
    return parsed ? std::string("no error") : parsed.error().where;
  };
  EXPECT_EQ(where([](json&) {}), "no error");
  for (const char* key : {"img_name", "width", "height", "position", "rotation", "fx", "fy"}) {
    EXPECT_EQ(where([&](json& view) { view.erase(key); }), std::string("cameras.json:[1].") + key);
    for (const json& wrong : {json(nullptr), json(true), json::object(), json::array({1, 2}), json::array()})
      EXPECT_EQ(where([&](json& view) { view[key] = wrong; }), std::string("cameras.json:[1].") + key) << wrong;
  }
  EXPECT_EQ(where([](json& view) { view["position"][1] = "2"; }), "cameras.json:[1].position[1]");
  EXPECT_EQ(where([](json& view) { view["rotation"][2][0] = nullptr; }), "cameras.json:[1].rotation[2][0]");
  EXPECT_EQ(where([](json& view) { view["rotation"][2] = {0.0, 0.0, -1.0}; }), "cameras.json:[1].rotation");
  EXPECT_EQ(where([](json& view) { view["rotation"][2] = {0.0, 0.0, 2.0}; }), "cameras.json:[1].rotation");
  EXPECT_EQ(where([](json& view) { view["width"] = 0; }), "cameras.json:[1].width");
  EXPECT_EQ(parse("{}").error().where, "cameras.json:");
}

TEST(CamerasJson, SurvivesCutsAndThousandsOfCorruptedFiles) {
  const std::string whole = sample().dump();
  for (std::size_t size = 0; size < whole.size(); ++size) EXPECT_FALSE(parse(whole.substr(0, size))) << size;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    Rng rng(seed);
    std::string text = whole;
    text[rng.below(std::uint32_t(text.size()))] =
        rng.below(2) ? "0123456789-.e[]{},:\""[rng.below(20)] : char(rng.below(256));
    const auto parsed = parse(text);
    SCOPED_TRACE(seed);
    if (!parsed) {
      EXPECT_FALSE(parsed.error().where.empty());
      continue;
    }
    for (const Shot& shot : *parsed) EXPECT_NEAR(glm::determinant(shot.rotation), 1, 1e-9);
  }
}

}  // namespace
}  // namespace engine::io
