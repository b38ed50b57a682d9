#include "engine/io/transforms_json.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/core/rng.h"
#include "engine/scene/camera.h"

namespace engine::io {
namespace {

using nlohmann::json;

Result<PictureSize> no_photo(const std::string& file_path) {
  return fail(ErrorCode::not_found, "the photo " + file_path + " is missing");
}
Result<PictureSize> photo_800x600(const std::string&) { return PictureSize{800, 600}; }

Result<std::vector<Shot>> parse(const std::string& text, TransformsWorld world = TransformsWorld::as_in_file,
                                const std::function<Result<PictureSize>(const std::string&)>& size_of = no_photo) {
  return parse_transforms_json(std::as_bytes(std::span(text.data(), text.size())), "transforms.json", world, size_of);
}

json identity_rows() {
  return {{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
}

/// A file in nerfstudio's form, with two frames and every field that is read.
json sample() {
  json file = {{"camera_model", "OPENCV"},
               {"fl_x", 500.0},
               {"fl_y", 510.0},
               {"cx", 321.0},
               {"cy", 239.0},
               {"w", 640},
               {"h", 480},
               {"k1", 0.01},
               {"k2", -0.02},
               {"k3", 0.0},
               {"k4", 0.0},
               {"p1", 0.001},
               {"p2", 0.002},
               {"is_fisheye", false}};
  file["applied_transform"] = {{1.0, 0.0, 0.0, 0.5}, {0.0, 0.0, 1.0, -1.0}, {0.0, -1.0, 0.0, 2.0}};
  file["applied_scale"] = 0.25;
  json matrix = identity_rows();
  matrix[0][3] = 1.0, matrix[1][3] = 2.0, matrix[2][3] = 3.0;
  file["frames"] = {
      {{"file_path", "images/b.jpg"}, {"transform_matrix", matrix}},
      {{"file_path", "images/a.jpg"}, {"transform_matrix", identity_rows()}, {"fl_x", 777.0}, {"w", 320}}};
  return file;
}

TEST(TransformsJson, TurnsOpenGlAxesIntoOpenCv) {
  const auto shots = parse(sample().dump());
  ASSERT_TRUE(shots) << shots.error().message;
  ASSERT_EQ(shots->size(), 2u);
  const Shot& shot = (*shots)[0];
  // The camera stands at (1, 2, 3) and looks along the world's -z, with the world's y up.
  EXPECT_EQ(shot.rotation * DVec3(1, 2, 3) + shot.translation, DVec3(0));
  EXPECT_EQ(shot.rotation * DVec3(1, 2, -7) + shot.translation, DVec3(0, 0, 10));
  EXPECT_EQ(shot.rotation * DVec3(1, 4, 3) + shot.translation, DVec3(0, -2, 0));
  EXPECT_EQ(shot.rotation * DVec3(6, 2, 3) + shot.translation, DVec3(5, 0, 0));
  EXPECT_EQ(shot.name, "images/b.jpg");
  EXPECT_EQ(shot.where, "transforms.json:frames[0]");
  EXPECT_EQ(shot.lens.k, (std::array<double, 4>{0.01, -0.02, 0, 0}));
  EXPECT_EQ(shot.lens.p, (std::array<double, 2>{0.001, 0.002}));
}

TEST(TransformsJson, AFramesOwnIntrinsicsWin) {
  const auto shots = parse(sample().dump());
  ASSERT_TRUE(shots);
  EXPECT_EQ((*shots)[0].lens.fx, 500);
  EXPECT_EQ((*shots)[1].lens.fx, 777);
  EXPECT_EQ((*shots)[1].lens.fy, 510);
  EXPECT_EQ((*shots)[1].lens.width, 320);
  EXPECT_EQ((*shots)[1].lens.height, 480);
  json file = sample();
  file["frames"][0]["camera_angle_x"] = 1.0;  // beats the fl_x of the file
  EXPECT_NEAR((*parse(file.dump()))[0].lens.fx, 320 / std::tan(0.5), 1e-9);
}

TEST(TransformsJson, ReadsTheOriginalNerfSyntheticForm) {
  const json file = {
      {"camera_angle_x", 0.6911112},
      {"frames", {{{"file_path", "./train/r_0"}, {"rotation", 0.0125}, {"transform_matrix", identity_rows()}}}}};
  const auto shots = parse(file.dump(), TransformsWorld::as_in_file, photo_800x600);
  ASSERT_TRUE(shots) << shots.error().message;
  const Lens& lens = (*shots)[0].lens;
  EXPECT_NEAR(lens.fx, 400 / std::tan(0.6911112 / 2), 1e-9);
  EXPECT_EQ(lens.fy, lens.fx);
  EXPECT_EQ(lens.cx, 400);
  EXPECT_EQ(lens.cy, 300);
  EXPECT_TRUE(lens.is_pinhole());
  EXPECT_EQ(parse(file.dump()).error().code, ErrorCode::not_found);  // its size is known to the photo alone
}

TEST(TransformsJson, UndoesTheAppliedTransformWhenAsked) {
  // A pose in the world of the reconstruction, then the file's world = 0.25 (A x + b).
  const DMat3 turn = glm::mat3_cast(glm::normalize(DQuat(0.3, -0.5, 0.7, 0.2)));
  const DVec3 centre(4, -5, 6), offset(0.5, -1, 2);
  const DMat3 a(DVec3(1, 0, 0), DVec3(0, 0, -1), DVec3(0, 1, 0));  // columns of the sample's matrix
  const DMat3 in_file = a * turn;
  const DVec3 centre_in_file = 0.25 * (a * centre + offset);
  json file = sample();
  json matrix = identity_rows();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) matrix[std::size_t(row)][std::size_t(column)] = in_file[column][row];
    matrix[std::size_t(row)][3] = centre_in_file[row];
  }
  file["frames"][0]["transform_matrix"] = matrix;

  const auto undone = parse(file.dump(), TransformsWorld::before_applied);
  ASSERT_TRUE(undone) << undone.error().message;
  const Shot& shot = (*undone)[0];
  EXPECT_LT(glm::length(shot.rotation * centre + shot.translation), 1e-12);
  const DVec3 ahead = centre - turn[2];  // OpenGL looks along its -z
  EXPECT_LT(glm::length(shot.rotation * ahead + shot.translation - DVec3(0, 0, 1)), 1e-12);

  const Shot as_is = (*parse(file.dump()))[0];
  EXPECT_LT(glm::length(as_is.rotation * centre_in_file + as_is.translation), 1e-12);
}

TEST(TransformsJson, KnowsFisheyesAndRefusesOtherModelsByName) {
  json file = sample();
  file["camera_model"] = "OPENCV_FISHEYE";
  EXPECT_EQ((*parse(file.dump()))[0].lens.model, LensModel::fisheye);
  file = sample();
  file["is_fisheye"] = true;
  EXPECT_EQ((*parse(file.dump()))[0].lens.model, LensModel::fisheye);
  file["is_fisheye"] = false;
  file["frames"][1]["camera_model"] = "EQUIRECTANGULAR";
  auto refused = parse(file.dump());
  EXPECT_EQ(refused.error().code, ErrorCode::unsupported);
  EXPECT_EQ(refused.error().where, "transforms.json:frames[1].camera_model");
  EXPECT_NE(refused.error().message.find("EQUIRECTANGULAR"), std::string::npos);
  file = sample();
  file["k4"] = 0.1;
  refused = parse(file.dump());
  EXPECT_EQ(refused.error().code, ErrorCode::unsupported);
  EXPECT_EQ(refused.error().where, "transforms.json:k4");
}

TEST(TransformsJson, NamesWhatIsMissingOrWrong) {
  const auto where = [](const std::function<void(json&)>& change) {
    json file = sample();
    change(file);
    const auto parsed = parse(file.dump(), TransformsWorld::before_applied);
    return parsed ? std::string("no error") : parsed.error().where;
  };
  EXPECT_EQ(where([](json&) {}), "no error");
  EXPECT_EQ(where([](json& f) { f.erase("frames"); }), "transforms.json:frames");
  EXPECT_EQ(where([](json& f) { f["frames"][1].erase("file_path"); }), "transforms.json:frames[1].file_path");
  EXPECT_EQ(where([](json& f) { f["frames"][1]["transform_matrix"][1][2] = "0"; }),
            "transforms.json:frames[1].transform_matrix[1][2]");
  EXPECT_EQ(where([](json& f) { f["frames"][0]["transform_matrix"][3][3] = 2.0; }),
            "transforms.json:frames[0].transform_matrix[3]");
  EXPECT_EQ(where([](json& f) { f["frames"][0]["transform_matrix"].erase(3); }),
            "transforms.json:frames[0].transform_matrix");
  EXPECT_EQ(where([](json& f) { f["frames"][0]["transform_matrix"][0][0] = -1.0; }),  // mirrored
            "transforms.json:frames[0].transform_matrix");
  EXPECT_EQ(where([](json& f) { f["frames"][0]["transform_matrix"][0][0] = 0.0; }),  // flattened
            "transforms.json:frames[0].transform_matrix");
  EXPECT_EQ(where([](json& f) { f.erase("fl_x"), f.erase("fl_y"), f["frames"][1].erase("fl_x"); }),
            "transforms.json:frames[0]");
  EXPECT_EQ(where([](json& f) { f["applied_scale"] = 0; }), "transforms.json:applied_scale");
  EXPECT_EQ(where([](json& f) { f["applied_transform"][2] = {1.0, 2.0}; }), "transforms.json:applied_transform[2]");
  EXPECT_EQ(where([](json& f) { f["w"] = 640.5; }), "transforms.json:w");
  EXPECT_EQ(where([](json& f) { f["h"] = -1; }), "transforms.json:h");
  EXPECT_EQ(where([](json& f) { f["w"] = 1e300; }), "transforms.json:w");
}

TEST(TransformsJson, AFieldOfAnyOtherTypeIsAnErrorThatNamesIt) {
  const json wrong_values[] = {nullptr, "text", json::array(), json::object(), json::array({1, "two"})};
  const json whole = sample();
  for (const auto& [key, value] : whole.items()) {
    for (const json& wrong : wrong_values) {
      json file = whole;
      file[key] = wrong;
      if (key == "camera_model" && wrong.is_string()) continue;  // an unknown model, another test's business
      const auto parsed = parse(file.dump(), TransformsWorld::before_applied);
      if (parsed) {  // no frames at all is for the reader of the dataset to refuse
        EXPECT_TRUE(key == "frames" && wrong.is_array() && wrong.empty()) << key << " = " << wrong;
        continue;
      }
      EXPECT_EQ(parsed.error().where.substr(0, 16 + key.size()), "transforms.json:" + key) << key << " = " << wrong;
    }
  }
  for (const char* key : {"file_path", "transform_matrix"})
    for (const json& wrong : {json(nullptr), json(3), json::object(), json(true)}) {
      json file = whole;
      file["frames"][1][key] = wrong;
      const auto parsed = parse(file.dump());
      ASSERT_FALSE(parsed) << key << " = " << wrong;
      EXPECT_EQ(parsed.error().where, std::string("transforms.json:frames[1].") + key);
    }
}

TEST(TransformsJson, RefusesWhatIsNotJson) {
  for (const char* text : {"", "{", "[1, 2", "{\"frames\": NaN}", "{\"frames\": 1e999}", "\xff\xfe", "{} {}"}) {
    const auto parsed = parse(text);
    ASSERT_FALSE(parsed) << text;
    EXPECT_EQ(parsed.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(parsed.error().where, "transforms.json");
    EXPECT_EQ(parsed.error().message.find("json.exception"), std::string::npos) << "the library's words, not ours";
  }
  EXPECT_FALSE(parse("[]"));
  EXPECT_FALSE(parse("17"));
  EXPECT_FALSE(parse(std::string(100000, '[')));
}

TEST(TransformsJson, SurvivesCutsAndThousandsOfCorruptedFiles) {
  const std::string whole = sample().dump();
  for (std::size_t size = 0; size < whole.size(); ++size) EXPECT_FALSE(parse(whole.substr(0, size))) << size;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    Rng rng(seed);
    std::string text = whole;
    for (auto changes = 1 + rng.below(3); changes > 0; --changes)
      text[rng.below(std::uint32_t(text.size()))] =
          rng.below(2) ? "0123456789-.e[]{},:\""[rng.below(20)] : char(rng.below(256));
    const auto parsed = parse(text, TransformsWorld::before_applied);
    SCOPED_TRACE(seed);
    if (!parsed) {
      EXPECT_FALSE(parsed.error().where.empty() && parsed.error().code != ErrorCode::not_found);
      continue;
    }
    for (const Shot& shot : *parsed) EXPECT_NEAR(glm::determinant(shot.rotation), 1, 1e-9);
  }
}

}  // namespace
}  // namespace engine::io
