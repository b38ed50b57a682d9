#include "server/edits/interval_pictures.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/io/image_file.h"
#include "tests/engine/edit/samples.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/support/data.h"

namespace server::edits {
namespace {

using engine::edit::Moment;
using engine::jobs::code_of;
using engine::jobs::value;

class IntervalPicturesTest : public testing::Test {
 protected:
  /// The scene without its first rows.
  static engine::scene::Overlay without(std::uint32_t rows) {
    engine::scene::Overlay overlay;
    overlay.rows.sh_degree = 2;
    overlay.rows.extra_stride = 5;
    for (std::uint32_t row = 0; row < rows; ++row) overlay.removed.push_back(row);
    return overlay;
  }
  Moment moment(int interval, const std::string& stage, const engine::scene::Overlay& overlay) const {
    return {.interval = interval, .intervals = 9, .name = stage, .overlay = overlay, .views = views};
  }
  /// One for each view, each of another grey.
  [[nodiscard]] std::vector<engine::scene::Image> plain_pictures() const {
    std::vector<engine::scene::Image> pictures;
    for (const engine::scene::Camera& view : views)
      pictures.emplace_back(view.width, view.height, 3, 0.2f * float(1 + pictures.size()));
    return pictures;
  }
  std::string picture(int interval, std::size_t view, const std::string& stage) const {
    return value(read_picture(folder / picture_name(interval, view, stage)));
  }

  support::TempDir dir;
  std::filesystem::path folder = dir.path() / "not/there/yet";
  engine::scene::GaussianCloud input = engine::edit::ball_before_wall(100);
  std::vector<engine::scene::Camera> views = engine::edit::arc_of_cameras(3, 40);
};

TEST_F(IntervalPicturesTest, ShowsTheFirstViewsAtEachMoment) {
  IntervalPictures pictures(folder, input, 2);
  const auto untouched = without(0), changed = without(100);
  value(pictures.add(moment(1, "before", untouched)));
  value(pictures.add(moment(1, "deformed", changed)));
  const auto renders = pictures.renders_of(1);
  ASSERT_EQ(renders.size(), 2u);
  EXPECT_EQ(renders[1].view, "view_1");
  EXPECT_EQ(renders[1].stages, (std::vector<std::string>{"before", "deformed"}));
  EXPECT_NE(picture(1, 0, "before"), picture(1, 1, "before"));
  EXPECT_NE(picture(1, 0, "before"), picture(1, 0, "deformed"));
  EXPECT_FALSE(std::filesystem::exists(folder / picture_name(1, 2, "before")));
}

TEST_F(IntervalPicturesTest, AnotherRunWritesTheSameBytes) {
  const auto some = without(30), more = without(60);
  IntervalPictures whole(folder, input, 3);
  value(whole.add(moment(1, "before", without(0))));
  value(whole.add(moment(1, "deformed", some)));
  value(whole.add(moment(2, "before", some)));
  value(whole.add(moment(2, "deformed", more)));
  const auto first = picture(2, 2, "before"), last = picture(2, 2, "deformed");
  IntervalPictures resumed(folder, input, 3);
  value(resumed.add(moment(2, "before", some)));
  value(resumed.add(moment(2, "deformed", more)));
  EXPECT_EQ(picture(2, 2, "before"), first);
  EXPECT_EQ(picture(2, 2, "deformed"), last);
  EXPECT_EQ(resumed.renders_of(2)[0].stages, whole.renders_of(2)[0].stages);
  EXPECT_TRUE(resumed.renders_of(1).empty());
}

TEST_F(IntervalPicturesTest, ShowsThePicturesThatAMomentBrings) {
  IntervalPictures pictures(folder, input, 2);
  const auto overlay = without(30);
  value(pictures.add(moment(1, "deformed", overlay)));
  Moment corrected = moment(1, "corrected", overlay);
  const auto given = plain_pictures();
  corrected.pictures = given;
  value(pictures.add(corrected));
  for (std::size_t v = 0; v < 2; ++v) {
    SCOPED_TRACE(v);
    const engine::scene::Image shown = value(engine::io::read_image(folder / picture_name(1, v, "corrected")));
    ASSERT_EQ(shown.width, given[v].width);
    ASSERT_EQ(shown.height, given[v].height);
    for (const std::size_t i : {std::size_t{0}, shown.data.size() / 2, shown.data.size() - 1})
      EXPECT_NEAR(shown.data[i], given[v].data[i], 0.02) << i;
  }
  EXPECT_EQ(pictures.renders_of(1)[1].stages, (std::vector<std::string>{"deformed", "corrected"}));
  EXPECT_FALSE(std::filesystem::exists(folder / picture_name(1, 2, "corrected"))) << "of two views only";
}

TEST_F(IntervalPicturesTest, PicturesThatAMomentBringsStandForNoOtherMoment) {
  const auto overlay = without(30);
  IntervalPictures plain(folder, input, 2);
  value(plain.add(moment(1, "deformed", overlay)));
  const std::string deformed = picture(1, 0, "deformed");

  // The scene is still what it was: what came between must not be taken for a picture of it, nor be needed for one.
  for (const bool begins_with_it : {false, true}) {
    SCOPED_TRACE(begins_with_it);
    IntervalPictures pictures(folder, input, 2);
    if (!begins_with_it) value(pictures.add(moment(1, "deformed", overlay)));
    Moment corrected = moment(1, "corrected", overlay);
    const auto given = plain_pictures();
    corrected.pictures = given;
    value(pictures.add(corrected));
    value(pictures.add(moment(1, "optimised", overlay)));
    value(pictures.add(moment(2, "before", overlay)));
    EXPECT_NE(picture(1, 0, "corrected"), deformed);
    EXPECT_EQ(picture(1, 0, "optimised"), deformed);
    EXPECT_EQ(picture(2, 0, "before"), deformed);
  }
}

TEST_F(IntervalPicturesTest, TakesWhatViewsThereAre) {
  IntervalPictures many(folder, input, 100);
  value(many.add(moment(1, "before", without(0))));
  EXPECT_EQ(many.renders_of(1).size(), 3u);
  views.clear();
  IntervalPictures none(folder / "none", input, 4);
  value(none.add(moment(1, "before", without(0))));
  EXPECT_TRUE(none.renders_of(1).empty());
}

TEST_F(IntervalPicturesTest, AreKnownByEveryBitAndEveryCut) {
  views.resize(1);
  IntervalPictures pictures(folder, input, 1);
  value(pictures.add(moment(1, "before", without(0))));
  const auto file = folder / picture_name(1, 0, "before");
  const std::string whole = support::read_file(file), jpeg = value(read_picture(file));
  for (std::size_t bit = 0; bit < 8 * whole.size(); bit += 5) {
    std::string damaged = whole;
    damaged[bit / 8] = char(damaged[bit / 8] ^ 1 << bit % 8);
    support::write_file(file, damaged);
    ASSERT_EQ(code_of(read_picture(file)), engine::ErrorCode::corrupt_data) << bit;
  }
  for (std::size_t size = 0; size < whole.size(); ++size) {
    support::write_file(file, whole.substr(0, size));
    const auto cut = read_picture(file);
    ASSERT_TRUE(!cut || *cut == jpeg) << size;
  }
  support::write_file(file, jpeg);
  EXPECT_EQ(value(read_picture(file)), jpeg) << "of an earlier release";
}

TEST_F(IntervalPicturesTest, AFullDiskIsAnErrorThatSaysWhatToDo) {
  IntervalPictures pictures(folder, input, 1);
  const auto untouched = without(0);
  engine::Error error;
  {
    const engine::jobs::FullDisk full(100);
    const auto added = pictures.add(moment(3, "before", untouched));
    ASSERT_FALSE(added);
    error = added.error();
  }
  EXPECT_EQ(error.code, engine::ErrorCode::no_space);
  EXPECT_NE(error.message.find("pictures of interval 3"), std::string::npos) << error.message;
  EXPECT_NE(error.message.find("free some space"), std::string::npos) << error.message;
  EXPECT_EQ(error.where, "");
  EXPECT_TRUE(pictures.renders_of(3).empty());
  value(pictures.add(moment(3, "before", untouched)));
}

}  // namespace
}  // namespace server::edits
