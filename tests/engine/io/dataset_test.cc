#include "engine/io/dataset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/io/image_file.h"
#include "tests/engine/io/colmap_samples.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using support::TempDir;

void add_photo(const fs::path& path, int width = 64, int height = 48, float value = 0.5f) {
  fs::create_directories(path.parent_path());
  ASSERT_TRUE(write_image(path, scene::Image(width, height, 3, value)));
}

/// The sample model of colmap_samples.h with its photos; cameras: see there.
class ColmapFolder : public testing::Test {
 protected:
  void SetUp() override {
    write_model(root() / "sparse" / "0", samples::images());
    for (const auto& image : samples::images()) add_photo(root() / "images" / image.name);
  }
  static void write_model(const fs::path& folder, const std::vector<samples::ColmapImage>& images,
                          bool as_text = false) {
    fs::create_directories(folder);
    const auto put = [&](const std::string& name, const auto& entries) {
      support::write_file(folder / (name + (as_text ? ".txt" : ".bin")),
                          as_text ? samples::text(entries) : samples::binary(entries));
    };
    put("cameras", samples::cameras()), put("images", images), put("points3D", samples::points());
  }
  [[nodiscard]] const fs::path& root() const { return dir_.path(); }

 private:
  TempDir dir_;
};

std::vector<std::string> names(const Dataset& dataset) {
  std::vector<std::string> out;
  for (const View& view : dataset.views) out.push_back(view.camera.name);
  return out;
}

TEST_F(ColmapFolder, GivesViewsByNameWithPhotosAndPoints) {
  const auto dataset = read_dataset(root());
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->kind, "colmap");
  EXPECT_EQ(dataset->root, root());
  EXPECT_EQ(names(*dataset), (std::vector<std::string>{"a.png", "b 2.png", "sub/c.png"}));
  EXPECT_EQ(dataset->points.size(), 3u);
  const View &distorted = dataset->views[0], &plain = dataset->views[1];
  EXPECT_EQ(plain.photo, root() / "images" / "b 2.png");
  EXPECT_FALSE(plain.lens);
  EXPECT_EQ(plain.camera.fy, 51);
  EXPECT_TRUE(distorted.lens);
  for (const View& view : dataset->views) {
    EXPECT_TRUE(scene::validate(view.camera));
    const auto photo = load_photo(view);
    ASSERT_TRUE(photo) << photo.error().message;
    EXPECT_EQ(photo->width, 64);
    EXPECT_EQ(photo->channels, 3);
    EXPECT_NEAR(photo->at(0, 0), 0.5f, 0.01f);
  }
  EXPECT_TRUE(read_dataset(root(), {.points = false})->points.empty());
}

TEST_F(ColmapFolder, IsFoundWhereverTheModelLies) {
  const auto expected = names(*read_dataset(root()));
  EXPECT_EQ(names(*read_dataset(root() / "sparse" / "0")), expected);  // the model itself, photos beside sparse
  EXPECT_FALSE(read_dataset(root() / "sparse" / "0")->views[0].photo.empty());
  fs::rename(root() / "sparse" / "0", root() / "moved");
  fs::remove(root() / "sparse");
  fs::rename(root() / "moved", root() / "sparse");
  EXPECT_EQ(names(*read_dataset(root())), expected);
  EXPECT_FALSE(read_dataset(root() / "sparse")->views[0].photo.empty());
  EXPECT_EQ(names(*read_dataset((root() / "").string())), expected);  // with a slash at the end
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
    fs::rename(root() / "sparse" / name, root() / name);
  EXPECT_EQ(names(*read_dataset(root())), expected);
}

TEST_F(ColmapFolder, MayBeText) {
  const auto binary = read_dataset(root());
  fs::remove_all(root() / "sparse");
  write_model(root() / "sparse" / "0", samples::images(), true);
  const auto text = read_dataset(root());
  ASSERT_TRUE(binary && text) << text.error().message;
  ASSERT_EQ(names(*binary), names(*text));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(binary->views[i].camera.rotation, text->views[i].camera.rotation);
    EXPECT_EQ(binary->views[i].camera.fx, text->views[i].camera.fx);
  }
  EXPECT_EQ(binary->points, text->points);
}

TEST_F(ColmapFolder, NamesTheMissingPhoto) {
  fs::remove(root() / "images" / "b 2.png");
  const auto dataset = read_dataset(root());
  EXPECT_EQ(dataset.error().code, ErrorCode::not_found);
  EXPECT_NE(dataset.error().message.find("b 2.png"), std::string::npos) << dataset.error().message;
  EXPECT_EQ(dataset.error().where, "images.bin:image[0]");
}

TEST_F(ColmapFolder, WithoutAPictureFolderIsCamerasAlone) {
  fs::remove_all(root() / "images");
  const auto dataset = read_dataset(root());
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->views.size(), 3u);
  EXPECT_TRUE(dataset->views[0].photo.empty());
  EXPECT_EQ(load_photo(dataset->views[0]).error().code, ErrorCode::not_found);
}

TEST_F(ColmapFolder, ScalesCamerasToSmallerPhotos) {
  fs::remove_all(root() / "images");
  for (const auto& image : samples::images()) add_photo(root() / "images_2" / image.name, 32, 24);
  const auto dataset = read_dataset(root());
  ASSERT_TRUE(dataset) << dataset.error().message;
  for (const View& view : dataset->views) {
    EXPECT_EQ(view.camera.width, 32);
    EXPECT_NEAR(view.camera.cx, 16, 1e-12);
    ASSERT_TRUE(load_photo(view));
    EXPECT_EQ(load_photo(view)->height, 24);
  }
  EXPECT_NEAR(dataset->views[1].camera.fy, 25.5, 1e-12);
  EXPECT_EQ(read_dataset(root(), {.image_folder = "images_4"}).error().code, ErrorCode::not_found);
}

TEST_F(ColmapFolder, RefusesAPhotoOfAnotherShape) {
  add_photo(root() / "images" / "a.png", 48, 64);
  const auto dataset = read_dataset(root());
  EXPECT_EQ(dataset.error().code, ErrorCode::corrupt_data);
  EXPECT_NE(dataset.error().message.find("a.png"), std::string::npos);
  EXPECT_NE(dataset.error().message.find("48x64"), std::string::npos) << dataset.error().message;
}

TEST_F(ColmapFolder, RefusesNamesThatLeaveIt) {
  add_photo(root() / "outside.png");
  for (const char* name :
       {"../outside.png", "../../etc/passwd", "/etc/passwd", "sub/../../outside.png", "..", ".", "sub/", "a\nb.png"}) {
    SCOPED_TRACE(name);
    auto images = samples::images();
    images[2].name = name;
    write_model(root() / "sparse" / "0", images);
    const auto dataset = read_dataset(root());
    EXPECT_EQ(dataset.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(dataset.error().where, "images.bin:image[2]");
  }
}

TEST_F(ColmapFolder, RefusesTwoViewsOfOneName) {
  for (const char* name : {"a.png", "./a.png"}) {
    auto images = samples::images();
    images[2].name = name;
    write_model(root() / "sparse" / "0", images);
    const auto dataset = read_dataset(root());
    EXPECT_EQ(dataset.error().code, ErrorCode::corrupt_data);
    EXPECT_NE(dataset.error().message.find("a.png"), std::string::npos);
  }
}

TEST_F(ColmapFolder, NamesACameraThatCannotBe) {
  auto cameras = samples::cameras();
  cameras[1].parameters[0] = -50;
  support::write_file(root() / "sparse" / "0" / "cameras.bin", samples::binary(cameras));
  const auto dataset = read_dataset(root());
  EXPECT_EQ(dataset.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(dataset.error().where, "images.bin:image[0].fx");
}

TEST_F(ColmapFolder, WithoutViewsIsRefused) {
  write_model(root() / "sparse" / "0", {});
  EXPECT_EQ(read_dataset(root()).error().code, ErrorCode::unprocessable);
}

TEST_F(ColmapFolder, CountsWhatDecodingAPhotoTakes) {
  const auto dataset = read_dataset(root());
  ASSERT_TRUE(dataset);
  const View& view = dataset->views[1];
  EXPECT_EQ(photo_memory(view), 64 * 48 * 52 + std::filesystem::file_size(view.photo));
}

// 3 bytes of text are 150 of tree: 58 KB of a zip file became 3 GB.
TEST(Dataset, CountsATreeOfJsonBeforeItIsBuilt) {
  support::TempDir folder;
  std::string text = "{\"frames\":[{}";
  for (int i = 0; i < 100'000; ++i) text += ",{}";
  for (const char* name : {"transforms.json", "cameras.json"}) {
    support::write_file(folder.path() / name, text + "]}");
    MemoryBudget little(1 << 20), enough(std::uint64_t{1} << 30);
    const auto refused = read_dataset(folder.path() / name, {.memory = &little});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::too_large) << refused.error().message;
    EXPECT_EQ(refused.error().where, name);
    EXPECT_EQ(read_dataset(folder.path() / name, {.memory = &enough}).error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(enough.lent(), 0u);
  }
}

TEST_F(ColmapFolder, NoticesAPhotoThatIsDamagedOrReplaced) {
  const auto dataset = read_dataset(root());
  ASSERT_TRUE(dataset);
  add_photo(root() / "images" / "a.png", 32, 24);
  EXPECT_EQ(load_photo(dataset->views[0]).error().code, ErrorCode::corrupt_data);
  support::write_file(root() / "images" / "a.png", "not a picture any more");
  EXPECT_EQ(load_photo(dataset->views[0]).error().code, ErrorCode::unsupported);
  EXPECT_EQ(read_dataset(root()).error().where, "a.png");
}

json identity_rows() {
  return {{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
}

TEST(TransformsFolder, TakesSizeAndExtensionFromThePhotos) {
  const TempDir dir;
  const json file = {{"camera_angle_x", 0.7},
                     {"frames",
                      {{{"file_path", "./train/r_1"}, {"transform_matrix", identity_rows()}},
                       {{"file_path", "./train/r_0"}, {"transform_matrix", identity_rows()}}}}};
  support::write_file(dir.path() / "transforms_train.json", file.dump());
  EXPECT_EQ(read_dataset(dir.path()).error().code, ErrorCode::not_found);
  add_photo(dir.path() / "train" / "r_0.png", 40, 30);
  const auto missing = read_dataset(dir.path());
  EXPECT_EQ(missing.error().code, ErrorCode::not_found);
  EXPECT_NE(missing.error().message.find("train/r_1"), std::string::npos);
  add_photo(dir.path() / "train" / "r_1.png", 40, 30);
  const auto dataset = read_dataset(dir.path());
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->kind, "transforms");
  EXPECT_EQ(names(*dataset), (std::vector<std::string>{"train/r_0.png", "train/r_1.png"}));
  EXPECT_NEAR(dataset->views[0].camera.fx, 20 / std::tan(0.35), 1e-9);
  EXPECT_TRUE(load_photo(dataset->views[1]));
  EXPECT_TRUE(read_dataset(dir.path() / "transforms_train.json"));  // the file itself, too
}

TEST(TransformsFolder, WithSizesInTheFileNeedsNoPhotosButAllOrNone) {
  const TempDir dir;
  const json file = {{"fl_x", 50.0},
                     {"w", 40},
                     {"h", 30},
                     {"frames",
                      {{{"file_path", "images/a.png"}, {"transform_matrix", identity_rows()}},
                       {{"file_path", "images/b.png"}, {"transform_matrix", identity_rows()}}}}};
  support::write_file(dir.path() / "transforms.json", file.dump());
  ASSERT_TRUE(read_dataset(dir.path()));
  EXPECT_TRUE(read_dataset(dir.path())->views[0].photo.empty());
  add_photo(dir.path() / "images" / "b.png", 40, 30);
  const auto one_missing = read_dataset(dir.path());
  EXPECT_EQ(one_missing.error().code, ErrorCode::not_found);
  EXPECT_EQ(one_missing.error().where, "transforms.json:frames[0]");
  json escaping = file;
  escaping["frames"][0]["file_path"] = "../../etc/passwd";
  support::write_file(dir.path() / "transforms.json", escaping.dump());
  EXPECT_EQ(read_dataset(dir.path()).error().where, "transforms.json:frames[0]");
  escaping["frames"][0]["file_path"] = std::string("images/b.png\0.jpg", 17);
  support::write_file(dir.path() / "transforms.json", escaping.dump());
  EXPECT_EQ(read_dataset(dir.path()).error().where, "transforms.json:frames[0]");
}

TEST(InriaFolder, FindsPhotosByTheirStem) {
  const TempDir dir;
  json view = {{"id", 0}, {"img_name", "0001"}, {"width", 40}, {"height", 30}, {"fx", 50.0}, {"fy", 50.0}};
  view["position"] = {0.0, 0.0, 0.0};
  view["rotation"] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  support::write_file(dir.path() / "cameras.json", json::array({view}).dump());
  const auto cameras_alone = read_dataset(dir.path());
  ASSERT_TRUE(cameras_alone) << cameras_alone.error().message;
  EXPECT_EQ(cameras_alone->kind, "inria");
  EXPECT_EQ(names(*cameras_alone), std::vector<std::string>{"0001"});
  add_photo(dir.path() / "images" / "0001.jpg", 40, 30);
  const auto dataset = read_dataset(dir.path());
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(names(*dataset), std::vector<std::string>{"0001.jpg"});
  EXPECT_TRUE(load_photo(dataset->views[0]));
}

TEST(Dataset, SaysWhatItLookedForWhenNothingFits) {
  const TempDir dir;
  const auto nothing = read_dataset(dir.path());
  EXPECT_EQ(nothing.error().code, ErrorCode::not_found);
  for (const char* name : {"cameras.bin", "sparse/0", "transforms.json", "cameras.json"})
    EXPECT_NE(nothing.error().message.find(name), std::string::npos) << name;
  EXPECT_EQ(read_dataset(dir.path() / "absent").error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace engine::io
