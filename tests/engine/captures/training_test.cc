#include "engine/captures/training.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>

#include "engine/core/parallel.h"
#include "tests/engine/captures/samples.h"
#include "tests/support/data.h"

namespace engine::captures {
namespace {

fit::FitOptions quick() {
  fit::FitOptions options = training_options(20);
  options.max_gaussians = 300, options.halvings = 0;
  return options;
}

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  return files;
}

TEST(Trained, IsKeptAndFoundAgain) {
  const support::TempDir folder;
  const auto first = trained(sample_capture(), quick(), folder.path());
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_FALSE(first->was_kept);
  EXPECT_EQ(first->cloud.sh_degree, 3);
  EXPECT_GT(first->cloud.size(), 50u);
  EXPECT_GT(first->seconds, 0);
  const auto second = trained(sample_capture(), quick(), folder.path());
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_TRUE(second->was_kept);
  EXPECT_EQ(second->cloud, first->cloud);
  EXPECT_EQ(second->seconds, first->seconds);
  EXPECT_EQ(second->key, first->key);
  EXPECT_EQ(files_in(folder.path()).size(), 1u);
}

TEST(Trained, IsAnotherWhereAnythingThatItDependsOnIs) {
  const auto key = [](const Capture& capture, const fit::FitOptions& options) {
    return key_of(capture, options).value();
  };
  const std::uint64_t usual = key(sample_capture(), quick());
  EXPECT_EQ(key(sample_capture(), quick()), usual);
  Capture photo = sample_capture();
  photo.photos[2].rgb[100] ^= 1;
  EXPECT_NE(key(photo, quick()), usual);
  Capture camera = sample_capture();
  camera.photos[1].camera.translation.x += 1e-9;
  EXPECT_NE(key(camera, quick()), usual);
  Capture point = sample_capture();
  point.points[5].rgb[0] ^= 1;
  EXPECT_NE(key(point, quick()), usual);
  Capture fewer = sample_capture();
  fewer.photos.pop_back();
  EXPECT_NE(key(fewer, quick()), usual);
  fit::FitOptions options = quick();
  options.seed = 1;
  EXPECT_NE(key(sample_capture(), options), usual);
  options = quick();
  options.iterations = 21;
  EXPECT_NE(key(sample_capture(), options), usual);
}

TEST(Trained, FromADamagedFileIsTrainedAgain) {
  const support::TempDir folder;
  const auto first = trained(sample_capture(), quick(), folder.path());
  ASSERT_TRUE(first);
  const std::filesystem::path file = files_in(folder.path()).at(0);
  const std::string whole = support::read_file(file);
  std::string changed = whole;
  changed[whole.size() / 2] ^= 1;
  for (const std::string& bytes : {std::string(), std::string("splatdrag capture\n"), whole.substr(0, whole.size() / 2),
                                   whole.substr(0, whole.size() - 1), changed, whole + "x"}) {
    support::write_file(file, bytes);
    const auto again = trained(sample_capture(), quick(), folder.path());
    ASSERT_TRUE(again) << bytes.size();
    EXPECT_FALSE(again->was_kept) << bytes.size();
    EXPECT_EQ(again->cloud, first->cloud) << bytes.size();
    EXPECT_TRUE(trained(sample_capture(), quick(), folder.path())->was_kept) << "it was written anew";
  }
}

TEST(Trained, UnderTheNameOfAnotherFitIsNotTaken) {
  const support::TempDir one, other;
  fit::FitOptions longer = quick();
  longer.iterations = 30;
  ASSERT_TRUE(trained(sample_capture(), quick(), one.path()));
  ASSERT_TRUE(trained(sample_capture(), longer, other.path()));
  support::write_file(files_in(one.path()).at(0), support::read_file(files_in(other.path()).at(0)));
  EXPECT_FALSE(trained(sample_capture(), quick(), one.path())->was_kept);
}

TEST(Trained, IsTheSameForAnyThreads) {
  const support::TempDir one, four;
  Result<Trained> a, b;
  WorkArena(1).run([&] { a = trained(sample_capture(), quick(), one.path()); });
  WorkArena(4).run([&] { b = trained(sample_capture(), quick(), four.path()); });
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->cloud, b->cloud);
  EXPECT_EQ(a->key, b->key);
}

TEST(Trained, RefusesWhatNoFitBeginsWith) {
  const support::TempDir folder;
  Capture no_photos = sample_capture();
  no_photos.photos.clear();
  EXPECT_EQ(trained(no_photos, quick(), folder.path()).error().code, ErrorCode::unprocessable);
  Capture no_points = sample_capture();
  no_points.points.clear();
  EXPECT_EQ(trained(no_points, quick(), folder.path()).error().code, ErrorCode::unprocessable);
  fit::FitOptions options = quick();
  options.iterations = 0;
  EXPECT_EQ(trained(sample_capture(), options, folder.path()).error().where, "iterations");
  options = quick();
  options.least_opacity = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(trained(sample_capture(), options, folder.path()).error().code, ErrorCode::invalid_argument);
  EXPECT_TRUE(files_in(folder.path()).empty());
}

TEST(Trained, SaysWhenItCannotBeKept) {
  const support::TempDir folder;
  const auto lost = trained(sample_capture(), quick(), folder.path() / "no such folder");
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace engine::captures
