#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "proto/edit_request.h"
#include "tests/proto/examples.h"

namespace proto {
namespace {

using engine::ErrorCode;
using nlohmann::json;

json sample() { return json::parse(example("released_config.json")); }

void expect_refused(const json& config, const std::string& where) {
  const auto request = parse_released_config(config.dump());
  ASSERT_FALSE(request) << config;
  EXPECT_EQ(request.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(request.error().where, where) << request.error().message;
}

TEST(ReleasedConfig, BecomesAnEditRequest) {
  const auto request = parse_released_config(example("released_config.json"));
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->mode, Mode::move);
  ASSERT_EQ(request->handles.size(), 3u);
  EXPECT_EQ(request->handles[0].source, (Point{-1.22, -0.26, -0.42}));
  EXPECT_EQ(request->handles[0].target, (Point{-1.22 + -0.1, -0.26 + -0.2, -0.42 + 0.05}));
  for (const Handle& handle : request->handles) EXPECT_EQ(handle.radius, 0.12);
  EXPECT_EQ(request->handles[1].group, 0);
  EXPECT_EQ(request->handles[2].group, 1);
  EXPECT_EQ(request->region, (Region{{-0.6, -0.2, -0.5}, {2.0, 1.0, 1.0}}));
  EXPECT_EQ(request->params, Params{});
}

TEST(ReleasedConfig, TurnsADirectionOfZeroIntoAnAnchor) {
  const auto request = parse_released_config(example("released_config.json"));
  ASSERT_TRUE(request);
  EXPECT_TRUE(request->handles[0].target);
  EXPECT_FALSE(request->handles[1].target);
}

TEST(ReleasedConfig, NeedsNeitherClusterNorMaskNorMode) {
  json config = sample();
  for (const char* name : {"cluster", "local_mask", "mode"}) config.erase(name);
  const auto request = parse_released_config(config.dump());
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->mode, Mode::move);
  EXPECT_EQ(request->region, std::nullopt);
  EXPECT_EQ(request->handles[2].group, 0);
}

TEST(ReleasedConfig, NamesWhatIsMissing) {
  for (const char* name : {"start", "direction", "voxel_size"}) {
    json config = sample();
    config.erase(name);
    expect_refused(config, name);
  }
  json config = sample();
  config["local_mask"].erase("xyz");
  expect_refused(config, "local_mask.xyz");
}

TEST(ReleasedConfig, NamesWhatIsWrong) {
  const auto with = [](const std::string& pointer, json value) {
    json config = sample();
    config[json::json_pointer(pointer)] = std::move(value);
    return config;
  };
  expect_refused(with("/start", json::array()), "start");
  expect_refused(with("/start/1", {1, 2}), "start[1]");
  expect_refused(with("/start/1/0", "1"), "start[1][0]");
  expect_refused(with("/direction", {{0, 0, 1}}), "direction");
  expect_refused(with("/direction/2/1", nullptr), "direction[2][1]");
  expect_refused(with("/voxel_size", 0), "voxel_size");
  expect_refused(with("/cluster", {0, 0}), "cluster");
  expect_refused(with("/cluster/1", -1), "cluster[1]");
  expect_refused(with("/local_mask/xyz/0", 0), "local_mask.xyz[0]");
  expect_refused(with("/local_mask/size", {1, 1, 1}), "local_mask.size");
  expect_refused(with("/mode", "copy"), "mode");
  expect_refused(with("/radius", 1), "radius");
}

TEST(ReleasedConfig, SaysHowManyDirectionsItExpects) {
  json config = sample();
  config["direction"].erase(0);
  const auto request = parse_released_config(config.dump());
  ASSERT_FALSE(request);
  EXPECT_NE(request.error().message.find("3 directions"), std::string::npos) << request.error().message;
}

}  // namespace
}  // namespace proto
